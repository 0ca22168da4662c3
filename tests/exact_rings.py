"""Exact image position of the laser line by root finding, without the renderer's kernels."""

from collections.abc import Callable, Sequence

import numpy as np

from pipeline.arrays import Float
from pipeline.simulator.sheet import room_mm
from pipeline.simulator.truth import SceneTruth

# Image radii, px, between which the ring is searched: from just off the image centre to beyond the corner of
# a
# picture of 2 MP (1000 px).
_SEARCH_PX = (20.0, 900.0)
# Step of that search, px: finer than the image of any step of the wall that a scene may have.
_SEARCH_STEP_PX = 4.0
# 4 px halved 34 times is 2e-10 px.
_BISECTIONS = 34


def exact_rings(truth: SceneTruth, frames: Sequence[int], azimuth_rad: Float, centre_px: Float) -> Float:
    """Return the image radius (F, A) of the line's mean about ``centre_px``, px, at image azimuths (A,).

    It is the first point of the sheet, counted from the laser, that lies on the wall; NaN where none is in
    view. Occlusion of that point by the wall is not tested. A rolling shutter is modelled row by row.
    """
    return np.stack([_ring(truth, frame, azimuth_rad, centre_px) for frame in frames])


def _ring(truth: SceneTruth, frame: int, azimuth_rad: Float, centre_px: Float) -> Float:
    outward = np.stack([np.cos(azimuth_rad), np.sin(azimuth_rad)], -1)

    def room(radius_px: Float) -> Float:
        return room_mm(truth, frame, centre_px + radius_px[..., None] * outward)

    low, high = _bracket(room, len(azimuth_rad))
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        inside = room(middle) > 0
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    return 0.5 * (low + high)


def _bracket(room: Callable[[Float], Float], count: int) -> tuple[Float, Float]:
    """Return the first radii between which the sheet passes into the wall; NaN where it never does."""
    radii = np.arange(*_SEARCH_PX, _SEARCH_STEP_PX)
    left = np.stack([room(np.full(count, radius)) for radius in radii])
    entering = (left[:-1] > 0) & (left[1:] <= 0)
    first = np.argmax(entering, axis=0)
    found = entering.any(axis=0)
    return np.where(found, radii[first], np.nan), np.where(found, radii[first + 1], np.nan)


def seen_above_water(azimuth_rad: Float, radius: float, centre_y: float, water_y: float) -> Float:
    """Return points (A, 2) of a round pipe about (0, centre_y), mirrored at a still water surface."""
    direction = np.stack([np.cos(azimuth_rad), np.sin(azimuth_rad)], -1)

    def along(y: float) -> Float:
        b = direction[:, 1] * y
        return np.asarray((b + np.sqrt(np.maximum(b * b - y * y + radius**2, 0)))[:, None] * direction)

    wall = along(centre_y)
    return np.where(wall[:, 1:] > water_y, along(2 * water_y - centre_y), wall)
