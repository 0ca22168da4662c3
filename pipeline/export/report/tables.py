"""Texts and numbers of the report: the verdict, the first screen and the tables."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from pipeline.artefacts.findings import Defect, Defects, Sections
from pipeline.artefacts.measured import RingSamples, RingValidity, Trajectory, Wall, WallTexture
from pipeline.artefacts.model import Overlays
from pipeline.export.report.detectable import limits
from pipeline.export.report.page import Card, Table
from pipeline.export.run_record import mean_diameter
from pipeline.geometry.axis import distance_along
from pipeline.instrument.probe import Probe
from pipeline.machine.outcome import WARNING, Number, StageOutcome, State, state_word
from pipeline.pages import notation
from pipeline.pages.notation import SAMPLE_REASONS, figure_name, stage_title
from pipeline.recording.base import Recording


@dataclass(frozen=True)
class RunSummary:
    """The data of a run for the report; an artefact that was not made is None.

    Attributes
    ----------
    recording, probe
    created : str
        When the run was made, ISO 8601, or empty.
    rings, trajectory, wall, texture, overlays, sections, defects
    stages : tuple of StageOutcome
        Outcome and reported numbers of each. Numbers whose name begins with ``rejected`` count unused data.
    versions : tuple of (str, str)
        Name and version of the program and of its libraries.
    inputs : tuple of (str, str)
        File and hash of each input.
    """

    recording: Recording
    probe: Probe
    created: str
    rings: RingSamples | None = None
    trajectory: Trajectory | None = None
    wall: Wall | None = None
    texture: WallTexture | None = None
    overlays: Overlays | None = None
    sections: Sections | None = None
    defects: Defects | None = None
    stages: tuple[StageOutcome, ...] = ()
    versions: tuple[tuple[str, str], ...] = ()
    inputs: tuple[tuple[str, str], ...] = ()

    @property
    def numbers(self) -> tuple[tuple[str, Number], ...]:
        """All numbers that stages reported, each with its stage's name."""
        return tuple((stage.name, number) for stage in self.stages for number in stage.numbers)


NOT_CALIBRATED = (
    "The instrument's parameters are only stated, not calibrated on a gauge: diameters depend on them, "
    "and a misaligned laser would go unnoticed."
)
_ONE = {"corrosion": "area of corrosion"}
_MANY = {"corrosion": "areas of corrosion"}


def verdict(summary: RunSummary) -> str:
    """Return the run's outcome in one sentence."""
    stopped = [s for s in summary.stages if s.state in (State.UNUSABLE, State.FAILED, State.CANCELLED)]
    if stopped:
        return f"The run stopped at the stage {stopped[0].name}: {stopped[0].problem}"
    if summary.wall is None or summary.defects is None:
        return "The run is not complete: see the stages below."
    length = np.ptp(_seen_distances(summary.wall))
    found = summary.defects.items
    if not found:
        return f"{length:.0f} mm of pipe were inspected and no defect was found."
    text = f"{length:.0f} mm of pipe were inspected. Found: {_counted(found)}."
    deepest = summary.defects.deepest
    if deepest is None:
        return text
    depth = notation.depth(deepest.depth_mm, deepest.depth_sigma_mm)
    return f"{text} The largest deviation is a {deepest.kind}, {depth}, at {deepest.peak_distance_mm:.1f} mm."


def cards(summary: RunSummary) -> tuple[Card, ...]:
    """Return the answers of the first screen."""
    return (_inspected(summary), _instrument(summary), _measured(summary), _found(summary))


def _inspected(summary: RunSummary) -> Card:
    recording = summary.recording
    lines = [
        f"nominal diameter {recording.pipe.nominal_diameter_mm:g} mm",
        f"{len(recording.frames.frame)} frames at {recording.frame_rate:g} per second",
        f"run made {notation.moment(summary.created)}" if summary.created else "date of the run not known",
    ]
    value = "no wall"
    if summary.wall is not None:
        value = f"{np.ptp(_seen_distances(summary.wall)):.0f} mm of pipe"
        lines.insert(1, f"mean diameter {notation.measured(*mean_diameter(summary.wall.radius_map))}")
    return Card("What was inspected", value, tuple(lines))


def _instrument(summary: RunSummary) -> Card:
    probe = summary.probe
    width, height = probe.camera.image_size
    lines = (
        f"{type(probe.camera).__name__}, {width} × {height} px",
        f"laser {probe.laser.wavelength_nm:g} nm, baseline {probe.laser.baseline_mm:.3f} mm",
    )
    if probe.calibrated_from:
        return Card("With which instrument", f"calibrated on {probe.calibrated_from}", lines)
    return Card("With which instrument", "stated, not calibrated", lines, NOT_CALIBRATED)


def _measured(summary: RunSummary) -> Card:
    if summary.wall is None:
        return Card("How well it was measured", "not measured", ())
    radius_map = summary.wall.radius_map
    seen = np.isfinite(radius_map.radius_mm)
    rows = seen.any(1)
    sigma, random = (float(np.median(s[seen])) for s in (radius_map.sigma_mm, radius_map.sigma_random_mm))
    local = float(np.sqrt(np.mean(radius_map.displaced_in(np.flatnonzero(rows)) ** 2)))
    lines = [
        f"{100 * seen[rows].mean():.1f} % of the wall was seen",
        f"of this uncertainty, {random:.3f} mm is random and "
        f"{np.sqrt(max(0.0, sigma**2 - random**2 - local**2)):.3f} mm comes from the calibration",
    ]
    if local > 0:
        lines.append(f"{local:.3f} mm of it is by how much photo and laser line differ from place to place")
    if summary.trajectory is not None:
        lines += _motion(summary.trajectory)
    return Card("How well it was measured", f"radius ± {sigma:.3f} mm (1 σ)", tuple(lines))


def _motion(trajectory: Trajectory) -> list[str]:
    path = float(np.abs(np.diff(distance_along(trajectory.axis, trajectory.T_pc))).sum())
    last = np.sqrt(np.maximum(np.diag(trajectory.covariance[-1]), 0))
    distance, roll = f"{trajectory.distance_sigma_mm:.2f} mm", f"{np.degrees(last[5]):.2f}°"
    return [f"distance ± {distance} and roll ± {roll} at the end of {path:.0f} mm (1 σ)"]


def _found(summary: RunSummary) -> Card:
    defects = summary.defects
    if defects is None:
        return Card("What was found", "not searched", ())
    lines = [
        *limits(defects.detectable),
        f"{defects.false_alarm_rate:.2g} false findings are expected in such a recording, from the wall's "
        "texture and from glints that two rings show at the same place",
    ]
    if defects.unconfirmed:
        lines.append(
            "seen in one ring or in the photo alone, or more likely false than real: "
            f"{len(defects.unconfirmed)} more, listed as unconfirmed and not counted"
        )
    if not defects.items:
        return Card("What was found", "no defect", tuple(lines))
    found = "1 finding" if len(defects.items) == 1 else f"{len(defects.items)} findings"
    return Card("What was found", found, (_counted(defects.items), *lines))


def _seen_distances(wall: Wall) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    rows = np.isfinite(wall.radius_map.radius_mm).any(1)
    return np.asarray(wall.radius_map.distance_mm[rows] if rows.any() else [0.0], float)


def _counted(found: tuple[Defect, ...]) -> str:
    counts = Counter(d.kind for d in found)
    words = [f"{n} {_ONE.get(k, k) if n == 1 else _MANY.get(k, k + 's')}" for k, n in counts.most_common()]
    return ", ".join(words)


REASONS = {v: SAMPLE_REASONS[v.name.lower()] for v in RingValidity}
# Frames that a cell lists before it only counts the others.
_SHOWN = 24


def tables(summary: RunSummary) -> tuple[Table, ...]:
    """Return all tables below the pictures; empty ones are left out."""
    made = (_frames(summary), _samples(summary.rings), _rejections(summary), _events(summary),
            _numbers(summary), _stages(summary), _versions(summary))  # fmt: skip
    return tuple(t for t in made if t is not None)


def _frames(summary: RunSummary) -> Table:
    """Account for every frame: rows add up to the recording's frames."""
    frames = summary.recording.frames
    rows = []
    for kind, count in sorted(Counter(map(str, frames.illumination)).items()):
        rows.append((f"lit by {kind}", str(count), ""))
    rows.append(("in the recording", str(len(frames.frame)), ""))
    if summary.trajectory is not None:
        lost = np.setdiff1d(frames.frame, summary.trajectory.frame)
        rows.append(("without a pose", str(len(lost)), _listed(lost)))
    if summary.rings is not None:
        whole = summary.rings.frame[~summary.rings.valid.any(1)]
        rows.append(("laser frames of which no sample was used", str(len(whole)), _listed(whole)))
    return Table("Frames", ("frames", "number", "which"), tuple(rows))


def _listed(frames: np.ndarray[tuple[int], np.dtype[np.int64]]) -> str:
    more = f" … and {len(frames) - _SHOWN} more" if len(frames) > _SHOWN else ""
    return ", ".join(str(f) for f in frames[:_SHOWN]) + more


def _samples(rings: RingSamples | None) -> Table | None:
    if rings is None or not rings.validity.size:
        return None
    counts = np.bincount(rings.validity.ravel(), minlength=len(RingValidity))
    total = rings.validity.size
    rows = [(REASONS[v], f"{counts[v]:,}", f"{100 * counts[v] / total:.2f} %") for v in RingValidity]
    rows = [r for r in rows if r[1] != "0"]
    return Table("Ring samples", ("outcome", "samples", "share"), (*rows, ("all", f"{total:,}", "")))


def _rejections(summary: RunSummary) -> Table | None:
    rejected = [(stage, n) for stage, n in summary.numbers if n.name.startswith("rejected")]
    rows = tuple(
        (stage_title(s), n.name.removeprefix("rejected").strip(": "), _value(n)) for s, n in rejected
    )
    return Table("Not used, by stage and reason", ("stage", "reason", "count"), rows) if rows else None


def _events(summary: RunSummary) -> Table | None:
    if summary.trajectory is None:
        return None
    rows = tuple(
        (e.kind, f"{e.frame_from} – {e.frame_to}", f"{e.size:.3g} {e.unit}", e.note)
        for e in summary.trajectory.events
    )
    note = "" if rows else "No slip, stop, reversal, dropped or repeated frame, or lost track was seen."
    return Table("Events of the motion", ("event", "frames", "size", "note"), rows, note)


def _numbers(summary: RunSummary) -> Table | None:
    figures = [(s, n) for s, n in summary.numbers if n.name != WARNING and not n.name.startswith("rejected")]
    rows = tuple((stage_title(stage), figure_name(n.name), _value(n)) for stage, n in figures)
    return Table("What the stages measured", ("stage", "quantity", "value"), rows) if rows else None


def _value(number: Number) -> str:
    text = f"{number.value:.6g}" if isinstance(number.value, float) else str(number.value)
    return f"{text} {number.unit}".strip()


def _stages(summary: RunSummary) -> Table | None:
    rows = tuple(
        (s.name, s.version, state_word(s.state), f"{s.seconds:.1f} s", s.key[:16], s.problem)
        for s in summary.stages
    )
    header = ("stage", "version", "state", "time", "key", "note")
    return Table("Stages", header, rows) if rows else None


def _versions(summary: RunSummary) -> Table | None:
    rows = tuple(("version", name, value) for name, value in summary.versions)
    rows += tuple(("hash of the input", name, value) for name, value in summary.inputs)
    return Table("Versions and hashes", ("what", "of", "value"), rows) if rows else None
