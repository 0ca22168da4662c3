"""A weld found again: the mean height of the ring along the pipe, looked for in the later run."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Float32
from pipeline.review.comparison.coarse import best_place
from pipeline.review.comparison.surface import Surface, sampled

_HALF_RADII = 0.2
_ROOM_RADII = 0.06
_SAMPLES_PER_CELL = 2
_LEAST_CORRELATION = 0.8
_AZIMUTHS = 360


def weld_place(before_mm: float, expected_mm: float, earlier: Surface, now: Surface) -> float | None:
    """Return the later run's distance of the weld at ``before_mm``; None where it does not show it."""
    step = now.wall.step_mm / _SAMPLES_PER_CELL
    half, room = (round(share * now.radius_mm / step) for share in (_HALF_RADII, _ROOM_RADII))
    bead = _profile(earlier, before_mm, step, half)
    around = _profile(now, expected_mm, step, half + room)
    if not (np.isfinite(bead).all() and np.isfinite(around).all()):
        return None
    row, _, correlation = best_place(bead[:, None], around[:, None])
    inside = 0 < row < 2 * room
    return expected_mm + (row - room) * step if inside and correlation > _LEAST_CORRELATION else None


def _profile(surface: Surface, middle_mm: float, step_mm: float, half: int) -> Float32:
    """Return the ring's mean radius (2 half + 1,) along the pipe; NaN where less than half was seen."""
    s = np.asarray(middle_mm + step_mm * np.arange(-half, half + 1), float)
    wall = surface.wall
    ring = sampled(wall.radius_mm, float(wall.distance_mm[0]), wall.step_mm, s, _AZIMUTHS)
    seen = np.isfinite(ring)
    mean = np.nan_to_num(ring).sum(1) / np.maximum(seen.sum(1), 1)
    return np.asarray(np.where(seen.mean(1) > 0.5, mean, np.nan), np.float32)
