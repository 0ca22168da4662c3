"""Evidence of left-out physics in an inspection, and what the inspection cannot show."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.arrays import Float, Int
from pipeline.files.codec import NOT_STORED
from pipeline.geometry.axis import to_pipe
from pipeline.machine.stage import Progress, unheard
from pipeline.recording.base import Illumination, Recording
from stages.diagnose.effects.base import EffectModel, ImagePoints, Shape
from stages.diagnose.effects.kinds import Periodic
from stages.diagnose.field.reduce import evidence_of, reduced
from stages.diagnose.field.run import FieldRun, ring_points
from stages.diagnose.field.system import ENCODER_SCALE, OWN, Asked, field_system
from stages.diagnose.inference import Evidence
from stages.diagnose.travel.evidence import TravelEvidence, travel_evidence
from stages.diagnose.travel.sight import sight_of_trajectory

# Effects with more shapes are searched in the motion's spectrum or in the readings, not shape by shape.
_FEW_SHAPES = 12
_CELL_MM, _CELL_RAD = 10.0, np.radians(30.0)
# Relative error of a nominal diameter: pipes are made to about 1 %, of which this is 3 σ.
_DIAMETER_SHARE = 0.03
_SHORTEST_MM = 40.0
# With fewer lit pictures the motion is undetermined: 3 of a simulated pipe, 5 mm apart, gave a path of 58 mm.
_FEWEST_LIT = 10
# 1 σ of a common radial error of the line, px: the mean radius of three rendered inspections, each with its
# right probe, was off by -0.09, 0.03 and 0.09 (open-1, open-3, a03). It scales the distance seen.
_LINE_PX = 0.08
_LOST_SHARE = 0.25
_LEAST_OFFSET_MM = 0.5
_LEAST_ROLL_RAD = np.radians(5.0)


def shortcomings_of(run: FieldRun) -> tuple[str, ...]:
    """Return sentences on what this inspection cannot show."""
    nominal, found = run.recording.pipe.nominal_diameter_mm, 2 * float(run.state.globals[0])
    lost, T = run.measured.tracks.poses.lost[1:], run.trajectory.T_pc
    lost_share = float(np.mean(lost)) if len(lost) else 1.0
    across = float(np.sqrt(np.mean(np.var(T[:, :2, 3], axis=0))))
    roll = float(np.ptp(np.unwrap(np.arctan2(T[:, 1, 0], T[:, 0, 0]))))
    rules = (
        (abs(found / nominal - 1) >= _DIAMETER_SHARE,
         f"The rings show a pipe of {found:.1f} mm, not of {nominal:.1f} mm as stated: the stated diameter, "
         "the baseline or the lens is wrong; an inspection alone cannot tell which."),
        (_lit(run) < _FEWEST_LIT,
         f"Only {_lit(run)} pictures show the lit wall, where {_FEWEST_LIT} are needed to follow the probe: "
         "drift and relief of the wall look like errors of the instrument."),
        (_lit(run) >= _FEWEST_LIT and not travels(run),
         f"The probe travels only {_way_mm(run):.0f} mm: relief of the wall looks like errors of the "
         "instrument, and a drift of the instrument like the pipe's own shape."),
        (lost_share >= _LOST_SHARE,
         f"In {100 * lost_share:.0f} % of the lit frames there is too little texture: poses rest on the "
         "rings there and absorb how a tilted or decentred sheet moves these, so that it hardly shows."),
        (across < _LEAST_OFFSET_MM,
         f"The probe moves across the pipe by only {across:.2f} mm (1 σ): a shifted image looks nearly "
         "like a tilted or decentred sheet."),
        (roll < _LEAST_ROLL_RAD,
         f"The probe rolls by only {np.degrees(roll):.1f}°: an error with two waves around "
         "the ring looks like an oval pipe."),
        (True,
         "In one pipe of unknown diameter, errors of cone, focal length, pupil and windows look alike, and "
         "an error of the baseline shows only against encoder and texture."),
    )  # fmt: skip
    return tuple(sentence for holds, sentence in rules if holds)


def travels(run: FieldRun) -> bool:
    """Return whether the probe is followed far enough for an agreement to be meaningful."""
    return _lit(run) >= _FEWEST_LIT and _way_mm(run) > _SHORTEST_MM


def _lit(run: FieldRun) -> int:
    return len(run.measured.tracks.poses.frames)


def _way_mm(run: FieldRun) -> float:
    return float(np.abs(np.diff(run.trajectory.T_pc[:, 2, 3])).sum())


@dataclass(frozen=True)
class FieldEvidence:
    """All evidence from an inspection's rings, texture and encoder.

    Attributes
    ----------
    travel : TravelEvidence or None
        Motion against encoder, and lines in the motion's spectrum.
    whole : Evidence
        From rings and texture together.
    shortcomings : tuple of str
        What this recording cannot show, and why.
    run : FieldRun or None
        None when rings and texture alone do not determine the motion. It is not stored with the evidence: a
        stage of its own stores it.
    encoder_scale : float
        Known relative error by which the encoder reads too much; the evidence is relative to it.
    """

    travel: TravelEvidence | None
    whole: Evidence
    shortcomings: tuple[str, ...] = ()
    run: FieldRun | None = field(default=None, metadata=NOT_STORED)
    encoder_scale: float = field(default=0.0, metadata=NOT_STORED)

    def about(self, asked: Asked) -> Evidence | None:
        """Return the evidence about other effects or shapes; None without a motion."""
        if self.run is None:
            return None
        found = _evidence(self.run, asked, _slips(self.run, self.travel))
        return _about_encoder(found, self.encoder_scale)

    def with_encoder(self, scale: float) -> FieldEvidence:
        """Return the evidence when the relative error of the encoder is known."""
        # As a share of the reading, like its column, and not of the true distance.
        share = scale / (1 + scale)
        return replace(self, whole=_about_encoder(self.whole, share), encoder_scale=share)


def _about_encoder(found: Evidence, scale: float) -> Evidence:
    """Return the evidence with the encoder's scale relative to another value than the stated one."""
    if ENCODER_SCALE not in found.place:
        return found
    own = found.place[ENCODER_SCALE]
    by_scale = found.information[:, own]
    misfit = found.misfit - 2 * scale * found.right[own] + scale**2 * by_scale[own]
    return replace(found, right=found.right - scale * by_scale, misfit=float(misfit))


def empty_evidence(recording: Recording, problem: str) -> FieldEvidence:
    """Return empty evidence, with the reason, if rings and texture do not determine the motion."""
    lit = len(recording.frames.of(Illumination.LED, Illumination.BOTH))
    why = problem or "they do not determine the motion"
    sentences = [f"Rings and texture of the inspection say nothing about the instrument: {why}."]
    if not lit:
        sentences.append(
            "No frame of the inspection shows the wall's texture, so that the rings alone place the probe."
        )
    sentences.append(
        "A pose that rests on the ring alone absorbs errors of the sheet and of the lens, and hides them."
    )
    none = Evidence((), np.zeros((0, 0)), np.zeros(0), np.zeros((0, 0)), 0.0, np.zeros(0))
    return FieldEvidence(None, none, tuple(sentences))


def field_evidence(
    run: FieldRun, library: Mapping[str, EffectModel], without: Collection[str] = (),
    progress: Progress = unheard,
) -> FieldEvidence:  # fmt: skip
    """Return an inspection's evidence about every effect for which it has columns; some may be unknown.

    Poses, landmarks, the pipe's radius, ovality and axis, errors of matching and the encoder's creep are
    eliminated; the stated instrument's parameters remain as columns, without prior.
    """
    travel = travel_of_run(run, without=without)
    asked, slips = asked_of(library, run, travel), _slips(run, travel)
    progress(0, 1)
    try:
        whole = _evidence(run, asked, slips)
    except np.linalg.LinAlgError:
        return replace(empty_evidence(run.recording, ""), travel=travel, run=run)
    missing = (*(travel.shortcomings if travel else ()), *shortcomings_of(run))
    return FieldEvidence(travel, whole, missing, run)


def asked_of(
    library: Mapping[str, EffectModel], run: FieldRun, travel: TravelEvidence | None
) -> list[tuple[EffectModel, Shape]]:
    """Return effects and shapes for which an inspection can have columns.

    Periodic effects are tested at the lines of the motion's spectrum, slips where the readings jump.
    """
    duration = float(run.measured.time_s[-1] - run.measured.time_s[0])
    out: list[tuple[EffectModel, Shape]] = []
    for name, model in library.items():
        if name in OWN:
            continue
        shapes = model.shapes(duration, run.recording.frame_rate)
        if isinstance(model, Periodic):
            shapes = tuple((line.frequency_hz,) for line in travel.lines) if travel else ()
        elif name == "encoder_slip":
            shapes = tuple((step.time_s,) for step in travel.slips) if travel else ()
        out += [(model, shape) for shape in shapes if len(shapes) <= _FEW_SHAPES]
    return out


def travel_of_run(
    run: FieldRun, source: str = "field", without: Collection[str] = ()
) -> TravelEvidence | None:
    """Return the evidence from the run's motion and encoder, with some effects unknown.

    None where no frame shows the motion.
    """
    sight = sight_of_trajectory(run.recording, run.trajectory)
    if not len(sight.frame):
        return None
    scale_sigma = float(np.hypot(sight.scale_sigma, scale_by_line(ring_points(run))))
    sight = replace(sight, scale_sigma=scale_sigma)
    first, last = np.searchsorted(run.trajectory.frame, sight.frame[[0, -1]])
    return travel_evidence(
        source, run.recording, sight, run.trajectory.T_pc[first : last + 1], run.probe.encoder_scale_sigma,
        without=without,
    )  # fmt: skip


def scale_by_line(points: ImagePoints) -> float:
    """Return the relative 1 σ of the radius, and so of the distance seen, by the line's common error."""
    if not len(points.uv):
        return 0.0
    farther = points.probe.triangulate(points.uv + _LINE_PX * points.outward)
    return float(np.nanmedian(np.hypot(farther[:, 0], farther[:, 1]) / points.radius_mm) - 1)


def _slips(run: FieldRun, travel: TravelEvidence | None) -> Int:
    """Return the frames before which the readings jump: all frames of a slip that lasts."""
    if travel is None:
        return np.zeros(0, np.int64)
    time_s, found = run.measured.time_s, [np.zeros(0, np.int64)]
    for s in (*travel.slips, *travel.doubtful):
        first, last = np.searchsorted(time_s, [s.time_s - s.lasting_s / 2, s.time_s + s.lasting_s / 2])
        found.append(np.arange(first, last + 1))
    return np.unique(np.concatenate(found))


def _evidence(run: FieldRun, asked: Asked, slips: Int) -> Evidence:
    system = field_system(run, asked, slips)
    found = reduced(system, len(run.state.T_pc))
    points = ring_points(run)
    assert points.distance_mm is not None
    s, azimuth, _ = to_pipe(run.state.axis, run.state.xyz_p)
    return evidence_of(system, found, _cells(points.distance_mm, points.azimuth_p_rad), _cells(s, azimuth))


def _cells(distance_mm: Float, azimuth_rad: Float) -> Int:
    """Return each point's cell number (M,) on the wall: relief is correlated within a cell."""
    along = np.floor((distance_mm - np.min(distance_mm, initial=0.0)) / _CELL_MM).astype(np.int64)
    around = np.floor((azimuth_rad % (2 * np.pi)) / _CELL_RAD).astype(np.int64)
    return np.asarray(100 * along + around)
