"""Evidence of left-out physics in a field recording, and whether it confirms the gauge's findings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Float, Int
from pipeline.geometry.axis import to_pipe
from pipeline.physics.effect import Channel
from stages.diagnose.effects.base import EffectModel, Shape
from stages.diagnose.effects.kinds import Periodic
from stages.diagnose.field.parts import part_of
from stages.diagnose.field.points import ring_points
from stages.diagnose.field.reduce import evidence_of, reduced
from stages.diagnose.field.run import FieldRun
from stages.diagnose.field.shortcomings import nothing_said, shortcomings_of
from stages.diagnose.field.system import OWN, Asked, field_system
from stages.diagnose.inference import ChannelEvidence, Evidence
from stages.diagnose.travel.evidence import TravelEvidence, travel_evidence
from stages.diagnose.travel.sight import sight_of_trajectory

# More shapes than this are searched in the motion's spectrum or in the readings, not one by one.
_FEW_SHAPES = 12
_CELL_MM, _CELL_RAD = 10.0, np.radians(30.0)
_STRETCHES = 3
_LEAST_FRAMES = 40


@dataclass(frozen=True)
class FieldEvidence:
    """All that a field recording says.

    Attributes
    ----------
    run : FieldRun or None
        None when rings and texture alone do not determine the motion.
    travel : TravelEvidence or None
        Motion against encoder, and lines in the motion.
    channel : ChannelEvidence
        Evidence of rings and texture together, with the travel's anomalies and all shortcomings.
    """

    run: FieldRun | None
    travel: TravelEvidence | None
    channel: ChannelEvidence

    def about(self, asked: Asked) -> Evidence | None:
        """Return the evidence about other effects or shapes; None without a motion."""
        if self.run is None:
            return None
        return _evidence(self.run, asked, _slips(self.run, self.travel))


def field_evidence(run: FieldRun, library: Mapping[str, EffectModel]) -> FieldEvidence:
    """Return what a field recording says of every effect whose columns it can have.

    Poses, landmarks, the pipe's radius, ovality and axis, errors of matching and the encoder's creep are
    eliminated; the stated instrument's parameters stay as columns, without prior.
    """
    travel = travel_of_run(run)
    asked, slips = asked_of(library, run, travel), _slips(run, travel)
    try:
        whole = _evidence(run, asked, slips)
    except np.linalg.LinAlgError:
        return FieldEvidence(run, travel, nothing_said(run.recording, ""))
    regimes = tuple(_regimes(run, asked, slips))
    missing = (*(travel.shortcomings if travel else ()), *shortcomings_of(run))
    anomalies = travel.anomalies if travel else ()
    return FieldEvidence(
        run, travel, ChannelEvidence("field", Channel.RING, whole, regimes, anomalies, missing)
    )


def asked_of(
    library: Mapping[str, EffectModel], run: FieldRun, travel: TravelEvidence | None
) -> list[tuple[EffectModel, Shape]]:
    """Return effects and shapes for which a field recording can have columns.

    Periodic effects are asked about at the lines of the motion, slips where the readings jump.
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


def travel_of_run(run: FieldRun, source: str = "field") -> TravelEvidence | None:
    """Return what the run's motion and encoder say; None where no frame shows the way."""
    sight = sight_of_trajectory(run.recording, run.trajectory)
    if not len(sight.frame):
        return None
    first, last = np.searchsorted(run.trajectory.frame, sight.frame[[0, -1]])
    return travel_evidence(
        source, run.recording, sight, run.trajectory.T_pc[first : last + 1], run.probe.encoder_scale_sigma
    )


def _slips(run: FieldRun, travel: TravelEvidence | None) -> Int:
    """Return the frames before which the readings jump."""
    if travel is None:
        return np.zeros(0, np.int64)
    steps = (*travel.slips, *travel.doubtful)
    return np.array([int(np.searchsorted(run.measured.time_s, s.time_s)) for s in steps], np.int64)


def _evidence(run: FieldRun, asked: Asked, slips: Int) -> Evidence:
    system = field_system(run, asked, slips)
    found = reduced(system, len(run.state.T_pc))
    points = ring_points(run)
    assert points.distance_mm is not None
    s, azimuth, _ = to_pipe(run.state.axis, run.state.xyz_p)
    return evidence_of(system, found, _cells(points.distance_mm, points.azimuth_p_rad), _cells(s, azimuth))


def _cells(distance_mm: Float, azimuth_rad: Float) -> Int:
    """Return numbers (M,) of the cells of wall in which points lie: relief is alike within one."""
    along = np.floor((distance_mm - np.min(distance_mm, initial=0.0)) / _CELL_MM).astype(np.int64)
    around = np.floor((azimuth_rad % (2 * np.pi)) / _CELL_RAD).astype(np.int64)
    return np.asarray(100 * along + around)


def _regimes(run: FieldRun, asked: Asked, slips: Int) -> Sequence[tuple[str, Evidence]]:
    """Return the evidence of stretches on their own; one that tells nothing is left out."""
    edges = np.linspace(0, len(run.measured.time_s), _STRETCHES + 1).round().astype(int)
    out = []
    for k in range(_STRETCHES):
        first, end = int(edges[k]), int(edges[k + 1])
        if end - first < _LEAST_FRAMES:
            continue
        inside = slips[(slips > first) & (slips < end)] - first
        try:
            out.append((f"field, stretch {k + 1}", _evidence(part_of(run, first, end), asked, inside)))
        except np.linalg.LinAlgError:
            continue
    return out
