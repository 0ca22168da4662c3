"""Preliminary sections of a recording that is still being written: a circle through every ring.

Motion, wall and axis need the whole recording, so that the probe's pose affects every figure.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.adjustment.robust import spread_about_median
from pipeline.arrays import Float
from pipeline.errors import UnusableError
from pipeline.instrument.misalignment import fit_circle
from pipeline.instrument.probe import Probe
from pipeline.machine.stage import Context
from pipeline.recording.base import FrameTable, Recording
from stages.rings import RingParameters, extract_rings
from stages.triangulate import TriangulateParameters, triangulate_rings

# A quarter of the preview's 360 azimuths: a circle through less is badly determined.
_LEAST_POINTS = 90
_TRIANGULATE = TriangulateParameters(largest_departure=0.2)
# Correlation length of a line's errors around the ring, degrees. Debt: data/debts.md.
_ALIKE = 8.0


@dataclass(frozen=True)
class PreliminarySection:
    """The circle through one frame's ring.

    Attributes
    ----------
    frame, time_s
    distance_mm : float
        By the encoder as it was read; NaN without one.
    diameter_mm, diameter_sigma_mm : float
        σ from the scatter of the points about the circle; the calibration is not in it.
    seen : float
        Share of the ring with a usable line.
    """

    frame: int
    time_s: float
    distance_mm: float
    diameter_mm: float
    diameter_sigma_mm: float
    seen: float


def preliminary_sections(
    recording: Recording, probe: Probe, after_frame: int, parameters: RingParameters, context: Context
) -> tuple[PreliminarySection, ...]:
    """Return the sections of the laser frames behind ``after_frame``; none where no ring can be used."""
    later = _behind(recording, after_frame)
    try:
        rings = extract_rings(later, probe, parameters, context)
    except UnusableError:
        return ()
    points = triangulate_rings(rings, probe, _TRIANGULATE, context)
    times = dict(zip(later.frames.frame.tolist(), later.frames.time_s.tolist(), strict=True))
    return tuple(
        _section(int(frame), times[int(frame)], _reading(recording, times[int(frame)]), xyz)
        for frame, xyz in zip(points.frame, points.xyz_c.astype(float), strict=True)
        if np.isfinite(xyz).all(-1).sum() >= _LEAST_POINTS
    )


def _behind(recording: Recording, after_frame: int) -> Recording:
    table = recording.frames
    new = table.frame > after_frame
    return replace(recording, frames=FrameTable(table.frame[new], table.time_s[new], table.illumination[new]))


def _section(frame: int, time_s: float, distance_mm: float, xyz_c: Float) -> PreliminarySection:
    """Fit the circle twice, the second time without what lies off the first: deposits, branches."""
    xy = xyz_c[np.isfinite(xyz_c).all(-1), :2]
    centre, radius = fit_circle(xy)
    off = np.linalg.norm(xy - centre, axis=-1) - radius
    spread = spread_about_median(off)
    near = np.abs(off - np.median(off)) <= 3 * spread
    _, radius = fit_circle(xy[near])
    seen = len(xy) / len(xyz_c)
    independent = max(360.0 * seen / _ALIKE, 1.0)
    sigma = 2 * spread / float(np.sqrt(independent))
    return PreliminarySection(frame, time_s, distance_mm, 2 * radius, sigma, seen)


def _reading(recording: Recording, time_s: float) -> float:
    encoder = recording.encoder
    if encoder is None or time_s > encoder.time_s[-1]:
        return float("nan")
    return float(np.interp(time_s, encoder.time_s, encoder.distance_mm))
