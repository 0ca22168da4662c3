"""The wall's shape and reflectance as arrays for the compiled kernels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.ndimage import maximum_filter, minimum_filter1d

from pipeline.arrays import Float, Float32, Int
from pipeline.geometry.axis import PipeAxis, frames_at
from pipeline.geometry.rigid import from_parts, inverse
from pipeline.simulator.kernel import kernel
from pipeline.simulator.wall.grid import Wall

# The near and the wide floor are the least radius over so many blocks of 1 mm to both sides.
NEAR_BLOCKS, WIDE_BLOCKS = 2, 32
# The wall's slope is tabled by sectors of azimuth, so that a pit slows only the rays of its sector.
SECTORS = 32
# Spacing of a bent axis' points: at a bend of 50 mm the frames between them, interpolated linearly and not
# orthonormalised again, are wrong by (0.25/50)²/8 = 3e-6.
_AXIS_STEP_MM = 0.25


class Surface(NamedTuple):
    """A wall as arrays for the kernels, in a frame W of its own.

    W is P for a bent pipe. For a straight one its z is the axis and its origin distance 0.

    Attributes
    ----------
    radius : (rows, columns + 2) float32
        One column more on each side, so that interpolation needs no wrapping.
    slope : (rows, columns + 2, 2) float32
        Change of the radius along the pipe, mm/mm, and around it, mm/rad: differences over one cell each way.
    from_mm, rows_per_mm : float
        Of the rows.
    floor_mm : (2, blocks)
        Least radius about every millimetre of distance: within 2 mm, and within 32 mm.
    sector_floor_mm : (blocks, SECTORS)
        Least radius in every millimetre and every sector of azimuth, and those around.
    steepest : (blocks, SECTORS)
        Largest slope between samples, mm/mm, in any direction, about every millimetre of distance and every
        sector of azimuth: within 2 mm, and in the sectors beside it.
    least_mm, most_mm : float
        Of all radii.
    axis_s : (K,), axis_o : (K, 3), axis_turn : (K, 3, 3)
        The axis in W; its points are evenly spaced. Two points: straight.
    T_wp : (4, 4)
    """

    radius: Float32
    slope: Float32
    from_mm: float
    rows_per_mm: float
    floor_mm: Float
    sector_floor_mm: Float
    steepest: Float
    least_mm: float
    most_mm: float
    axis_s: Float
    axis_o: Float
    axis_turn: Float
    T_wp: Float


def surface_of(wall: Wall) -> Surface:
    """Prepare a wall for the kernels."""
    radius = np.concatenate([wall.radius_mm[:, -1:], wall.radius_mm, wall.radius_mm[:, :1]], 1)
    axis = _fine(wall.axis)
    return Surface(
        np.ascontiguousarray(radius, np.float32),
        _slopes(wall),
        wall.shape.distance_from_mm,
        1.0 / wall.shape.step_mm,
        _floor(wall),
        -_most_by_sector(wall, -wall.radius_mm, 1),
        _steepest(wall),
        float(wall.radius_mm.min()),
        float(wall.radius_mm.max()),
        np.asarray(axis.distance_mm, float),
        np.ascontiguousarray(axis.origin_p, float),
        np.ascontiguousarray(axis.R_pa, float),
        _own_frame(wall.axis),
    )


def _fine(axis: PipeAxis) -> PipeAxis:
    """Return a bent axis with evenly spaced points that are close enough; a straight one unchanged."""
    if len(axis.distance_mm) == 2:
        return axis
    first, last = float(axis.distance_mm[0]), float(axis.distance_mm[-1])
    distance = np.linspace(first, last, int(np.ceil((last - first) / _AXIS_STEP_MM)) + 1)
    return PipeAxis(distance, *frames_at(axis, distance))


def _slopes(wall: Wall) -> Float32:
    """Return the changes of radius (rows, columns + 2, 2).

    First and last row have those of their neighbours.
    """
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
    """Return the least radius (2, blocks) within `NEAR_BLOCKS` and `WIDE_BLOCKS` of every millimetre."""
    block = np.floor(wall.shape.step_mm * np.arange(wall.shape.rows)).astype(int)
    least = np.full(block[-1] + 1, np.inf)
    np.minimum.at(least, block, wall.radius_mm.min(1).astype(float))
    filled = np.minimum.accumulate(np.where(np.isfinite(least), least, np.inf))
    least = np.where(np.isfinite(least), least, filled)
    reach = (2 * NEAR_BLOCKS + 1, 2 * WIDE_BLOCKS + 1)
    return np.stack([minimum_filter1d(least, blocks, mode="nearest") for blocks in reach])


def _steepest(wall: Wall) -> Float:
    """Return the largest slope (blocks, SECTORS) around every block and sector."""
    grid, radius = wall.shape, wall.radius_mm
    arc_mm = 2 * np.pi * float(radius.min()) / grid.columns
    slope = np.abs(np.roll(radius, -1, 1) - radius) / arc_mm
    slope[:-1] = np.hypot(slope[:-1], np.diff(radius, axis=0) / grid.step_mm)
    return _most_by_sector(wall, slope, NEAR_BLOCKS)


def _most_by_sector(wall: Wall, value: Float32, beside: int) -> Float:
    """Return the maximum of values (rows, columns) over each block and sector and the ones beside them."""
    grid = wall.shape
    block = np.floor(grid.step_mm * np.arange(grid.rows)).astype(int)
    sector = (SECTORS * np.arange(grid.columns)) // grid.columns
    most = np.full((block[-1] + 1, SECTORS), -np.inf)
    begins = np.minimum(np.searchsorted(sector, np.arange(SECTORS)), grid.columns - 1)
    np.maximum.at(most, block, np.maximum.reduceat(value, begins, axis=1).astype(float))
    # rows farther apart than a millimetre leave blocks between them empty
    reach = beside + int(np.ceil(grid.step_mm))
    return np.asarray(maximum_filter(most, (2 * reach + 1, 3), mode=("nearest", "wrap")))


# Halvings of the texture along the pipe: up to 32 texels a pixel, as at a grazing view.
_LEVELS = 6
# Bits of half a lobe's exponent: up to cos^254.
_LOBE_BITS = 7


class Texture(NamedTuple):
    """Reflectance at several resolutions along the pipe, one below the other.

    Attributes
    ----------
    albedo : (rows of all levels, columns + 2, 3) float32
        Each level halves the rows of the one before; a column more on each side.
    first : (levels + 1,)
        Row at which each level begins.
    from_mm, step_mm : float
        Of the finest level's rows.
    gloss : float
        Share of the reflectance that is a glossy lobe.
    half_lobe : int
        Half of the lobe's exponent.
    """

    albedo: Float32
    first: Int
    from_mm: float
    step_mm: float
    gloss: float
    half_lobe: int


def texture_of(wall: Wall) -> Texture:
    """Prepare a wall's reflectance for the kernels."""
    wide = np.concatenate([wall.albedo_bgr[:, -1:], wall.albedo_bgr, wall.albedo_bgr[:, :1]], 1)
    levels = [np.ascontiguousarray(wide, np.float32)]
    while len(levels) < _LEVELS and len(levels[-1]) >= 4:
        even = levels[-1][: len(levels[-1]) // 2 * 2]
        levels.append(0.5 * (even[0::2] + even[1::2]))
    first = np.cumsum([0, *(len(level) for level in levels)])
    grid = wall.texture
    half_lobe = min(max(round(wall.gloss_lobe / 2), 1), 2**_LOBE_BITS - 1)
    return Texture(
        np.concatenate(levels), first, grid.distance_from_mm, grid.step_mm, float(wall.gloss), half_lobe
    )


@kernel
def albedo_at(texture: Texture, s: float, psi: float, footprint_mm: float, out: Float) -> None:
    """Write the reflectance (3,) at a distance and an azimuth from −π to π, averaged over a footprint."""
    level = 0.0
    if footprint_mm > texture.step_mm:
        level = np.log2(footprint_mm / texture.step_mm)
    last = texture.first.shape[0] - 2
    k = min(int(level), last)
    w = min(level - k, 1.0)
    _level_at(texture, k, s, psi, 1.0 - w if k < last else 1.0, True, out)
    if w > 0.0 and k < last:
        _level_at(texture, k + 1, s, psi, w, False, out)


@kernel
def _level_at(texture: Texture, k: int, s: float, psi: float, weight: float, fresh: bool, out: Float) -> None:
    """Add one level's reflectance, linear between its samples."""
    top, rows = texture.first[k], texture.first[k + 1] - texture.first[k]
    scale = 1 << k
    y = ((s - texture.from_mm) / texture.step_mm - 0.5 * (scale - 1)) / scale
    y = min(max(y, 0.0), rows - 1.0)
    i = min(int(y), rows - 2)
    columns = texture.albedo.shape[1] - 2
    x = (psi + np.pi) * (columns * (0.5 / np.pi)) + 0.5
    j = min(max(int(x), 0), columns)
    wy, wx = y - i, x - j
    i += top
    a = texture.albedo
    for c in range(3):
        upper = (1.0 - wx) * a[i, j, c] + wx * a[i, j + 1, c]
        lower = (1.0 - wx) * a[i + 1, j, c] + wx * a[i + 1, j + 1, c]
        value = weight * ((1.0 - wy) * upper + wy * lower)
        out[c] = value if fresh else out[c] + value


@kernel
def sheen_at(texture: Texture, squared: float) -> float:
    """Return the ratio of the light that the wall sends to the camera to that of a matt wall.

    ``squared`` is the square of the cosine between the wall's normal and the direction halfway between light
    and camera (Blinn-Phong, normalised: (m + 8)/8 cos^m for an exponent m).
    """
    power, factor, left = 1.0, min(squared, 1.0), texture.half_lobe
    for _ in range(_LOBE_BITS):
        power *= factor if left & 1 else 1.0
        factor *= factor
        left >>= 1
    return 1.0 - texture.gloss + texture.gloss * (0.25 * texture.half_lobe + 1.0) * power
