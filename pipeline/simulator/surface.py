"""A wall laid out for the kernels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.ndimage import minimum_filter1d

from pipeline.arrays import Float, Float32
from pipeline.artefacts.measured import PipeAxis
from pipeline.geometry.rigid import from_parts, inverse
from pipeline.simulator.wall.base import Wall

# Blocks of a millimetre that the two floors look ahead.
NEAR_BLOCKS, WIDE_BLOCKS = 2, 32


class Surface(NamedTuple):
    """A wall laid out for the kernels, in a frame W of its own.

    W is P for a bent pipe. For a straight one its z is the axis and its origin distance 0.

    Attributes
    ----------
    radius : (rows, columns + 2) float32
        One column more on each side, so that interpolation needs no wrapping.
    slope : (rows, columns + 2, 2) float32
        Change of the radius along the pipe, mm/mm, and around it, mm/rad: differences over one cell each way.
    from_mm, step_mm : float
        Of the rows.
    floor_mm : (2, blocks)
        Least radius about every millimetre of distance: within 2 mm, and within 32 mm.
    least_mm, most_mm : float
        Of all radii.
    axis_s : (K,), axis_o : (K, 3), axis_turn : (K, 3, 3)
        The axis in W; its points are evenly spaced. Two points: straight.
    T_wp : (4, 4)
    """

    radius: Float32
    slope: Float32
    from_mm: float
    step_mm: float
    floor_mm: Float
    least_mm: float
    most_mm: float
    axis_s: Float
    axis_o: Float
    axis_turn: Float
    T_wp: Float


def surface_of(wall: Wall) -> Surface:
    """Lay a wall out for the kernels."""
    radius = np.concatenate([wall.radius_mm[:, -1:], wall.radius_mm, wall.radius_mm[:, :1]], 1)
    return Surface(
        np.ascontiguousarray(radius, np.float32),
        _slopes(wall),
        wall.shape.distance_from_mm,
        wall.shape.step_mm,
        _floor(wall),
        float(wall.radius_mm.min()),
        float(wall.radius_mm.max()),
        np.asarray(wall.axis.distance_mm, float),
        np.ascontiguousarray(wall.axis.origin_p, float),
        np.ascontiguousarray(wall.axis.R_pa, float),
        _own_frame(wall.axis),
    )


def _slopes(wall: Wall) -> Float32:
    """Return the radius' changes (rows, columns + 2, 2); on the first and last row as on the next."""
    grid, radius = wall.shape, wall.radius_mm
    slope = np.empty((grid.rows, grid.columns + 2, 2), np.float32)
    along, around = slope[:, 1:-1, 0], slope[:, 1:-1, 1]
    np.divide(radius[2:] - radius[:-2], 2 * grid.step_mm, out=along[1:-1])
    along[0], along[-1] = along[1], along[-2]
    around[:] = np.roll(radius, -1, 1) - np.roll(radius, 1, 1)
    around *= grid.columns / (4 * np.pi)
    slope[:, 0], slope[:, -1] = slope[:, -2], slope[:, 1]
    return slope


def _own_frame(axis: PipeAxis) -> Float:
    """Return ``T_wp``."""
    if len(axis.distance_mm) > 2:
        return np.eye(4)
    R_pa = axis.R_pa[0]
    return inverse(from_parts(R_pa, axis.origin_p[0] - axis.distance_mm[0] * R_pa[:, 2]))


def _floor(wall: Wall) -> Float:
    """Return the least radius (2, blocks) near and less near every millimetre."""
    block = np.floor(wall.shape.step_mm * np.arange(wall.shape.rows)).astype(int)
    least = np.full(block[-1] + 1, np.inf)
    np.minimum.at(least, block, wall.radius_mm.min(1).astype(float))
    filled = np.minimum.accumulate(np.where(np.isfinite(least), least, np.inf))
    least = np.where(np.isfinite(least), least, filled)
    reach = (2 * NEAR_BLOCKS + 1, 2 * WIDE_BLOCKS + 1)
    return np.stack([minimum_filter1d(least, blocks, mode="nearest") for blocks in reach])
