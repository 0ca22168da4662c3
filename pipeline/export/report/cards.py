"""The report's first screen: what was inspected, how well it was measured, what was found."""

from __future__ import annotations

from collections import Counter

import numpy as np

from pipeline.artefacts.findings import Defect
from pipeline.artefacts.measured import Trajectory, Wall
from pipeline.export.report.page import Card
from pipeline.export.report.summary import RunSummary
from pipeline.geometry.axis import distance_along
from pipeline.machine.outcome import State

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
    told = f"{length:.0f} mm of pipe were inspected. Found: {_counted(found)}."
    deepest = summary.defects.deepest
    if deepest is None:
        return told
    where = f"{_depth(deepest)} at {deepest.distance_from_mm:.0f} mm"
    return f"{told} The largest deviation is a {deepest.kind} of {where}."


def cards(summary: RunSummary) -> tuple[Card, ...]:
    """Return the answers that the first screen gives."""
    return (_inspected(summary), _instrument(summary), _measured(summary), _found(summary))


def _inspected(summary: RunSummary) -> Card:
    recording = summary.recording
    lines = [
        f"nominal diameter {recording.pipe.nominal_diameter_mm:g} mm",
        f"{len(recording.frames.frame)} frames at {recording.frame_rate:g} per second",
        f"run made {summary.created}" if summary.created else "date: the recording does not state one",
    ]
    value = "no wall"
    if summary.wall is not None:
        value = f"{np.ptp(_seen_distances(summary.wall)):.0f} mm of pipe"
        lines.insert(1, f"mean diameter {_mean_diameter(summary.wall)}")
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
    warning = (
        "The instrument's numbers are only stated, not calibrated on a gauge: diameters rest on them, "
        "and a misaligned laser would go unnoticed."
    )
    return Card("With which instrument", "stated, not calibrated", lines, warning)


def _measured(summary: RunSummary) -> Card:
    if summary.wall is None:
        return Card("How well it was measured", "not measured", ())
    radius_map = summary.wall.radius_map
    seen = np.isfinite(radius_map.radius_mm)
    rows = seen.any(1)
    sigma, random = (float(np.median(s[seen])) for s in (radius_map.sigma_mm, radius_map.sigma_random_mm))
    lines = [
        f"{100 * seen[rows].mean():.1f} % of the wall was seen",
        f"of this uncertainty, {random:.3f} mm is random and "
        f"{np.sqrt(max(0.0, sigma**2 - random**2)):.3f} mm comes from the calibration",
    ]
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
        f"nine of ten defects of 3 mm × 3 mm are found from {defects.smallest_depth_mm:.2f} mm depth on",
        f"the wall's noise and roughness would make {defects.false_alarm_rate:g} false reports in this "
        "recording; what is taken for the line and is not, such as bright texture beside it, comes on top",
    ]
    if not defects.items:
        return Card("What was found", "no defect", tuple(lines))
    return Card("What was found", f"{len(defects.items)} findings", (_counted(defects.items), *lines))


def _seen_distances(wall: Wall) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    rows = np.isfinite(wall.radius_map.radius_mm).any(1)
    return np.asarray(wall.radius_map.distance_mm[rows] if rows.any() else [0.0], float)


def _mean_diameter(wall: Wall) -> str:
    """Return the mean diameter ± 1 σ; calibration is common to all cells, noise is nothing beside it."""
    m = wall.radius_map
    seen = np.isfinite(m.radius_mm)
    excess = m.sigma_mm[seen].astype(float) ** 2 - m.sigma_random_mm[seen].astype(float) ** 2
    sigma = 2 * np.sqrt(max(0.0, float(excess.mean())))
    return f"{2 * float(m.radius_mm[seen].mean(dtype=np.float64)):.3f} ± {sigma:.3f} mm"


def _counted(found: tuple[Defect, ...]) -> str:
    counts = Counter(d.kind for d in found)
    words = [f"{n} {_ONE.get(k, k) if n == 1 else _MANY.get(k, k + 's')}" for k, n in counts.most_common()]
    return ", ".join(words)


def _depth(defect: Defect) -> str:
    way = "depth" if defect.depth_mm > 0 else "height"
    return f"{abs(defect.depth_mm):.2f} ± {defect.depth_sigma_mm:.2f} mm {way}"
