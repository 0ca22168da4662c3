"""Where rays meet the wall: kernels on a wall's grid."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter1d

from pipeline.artefacts import PipeAxis
from pipeline.geometry.rigid import from_parts, inverse
from pipeline.simulator.kernel import kernel
from pipeline.simulator.wall.base import Wall

Float = NDArray[np.float64]
Float32 = NDArray[np.float32]
# Blocks that the two floors look ahead; a step of a ray stays within them.
_NEAR_BLOCKS, _NEAR_STEP_MM = 2, 1.9
_WIDE_BLOCKS, _WIDE_STEP_MM = 32, 31.9
_FINE_MM = 0.3
_FAR_MM = 2000.0
_CLOSE_MM = 2e-5


class Surface(NamedTuple):
    """A wall laid out for the kernels, in a frame W of its own.

    W is P for a bent pipe. For a straight one its z is the axis and its origin distance 0.

    Attributes
    ----------
    radius : (rows, columns + 2) float32
        One column more on each side, so that interpolation needs no wrapping.
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
    reach = (2 * _NEAR_BLOCKS + 1, 2 * _WIDE_BLOCKS + 1)
    return np.stack([minimum_filter1d(least, blocks, mode="nearest") for blocks in reach])


@kernel
def _frame(surface, s, o, R):  # type: ignore[no-untyped-def]
    """Write a bent axis' point and the section's frame at distance s; straight beyond the ends."""
    axis_s, axis_o, turn = surface.axis_s, surface.axis_o, surface.axis_turn
    count = axis_s.shape[0]
    span = (axis_s[count - 1] - axis_s[0]) / (count - 1)
    w = (s - axis_s[0]) / span
    k = min(max(int(np.floor(w)), 0), count - 2)
    w -= k
    inside = min(max(w, 0.0), 1.0)
    for a in range(3):
        for b in range(3):
            R[a, b] = (1.0 - inside) * turn[k, a, b] + inside * turn[k + 1, a, b]
    _orthonormalise(R)
    beyond = (w - inside) * span
    for a in range(3):
        o[a] = (1.0 - inside) * axis_o[k, a] + inside * axis_o[k + 1, a] + beyond * R[a, 2]


@kernel
def _orthonormalise(R):  # type: ignore[no-untyped-def]
    size = np.sqrt(R[0, 2] ** 2 + R[1, 2] ** 2 + R[2, 2] ** 2)
    for a in range(3):
        R[a, 2] /= size
    along = R[0, 0] * R[0, 2] + R[1, 0] * R[1, 2] + R[2, 0] * R[2, 2]
    for a in range(3):
        R[a, 0] -= along * R[a, 2]
    size = np.sqrt(R[0, 0] ** 2 + R[1, 0] ** 2 + R[2, 0] ** 2)
    for a in range(3):
        R[a, 0] /= size
    R[0, 1] = R[1, 2] * R[2, 0] - R[2, 2] * R[1, 0]
    R[1, 1] = R[2, 2] * R[0, 0] - R[0, 2] * R[2, 0]
    R[2, 1] = R[0, 2] * R[1, 0] - R[1, 2] * R[0, 0]


@kernel
def _locate(surface, ray, way, s, o, R):  # type: ignore[no-untyped-def]
    """Return distance, and x and y off the axis in its section, of a ray's point; s is a first guess.

    Leaves the section's axis point and frame in ``o`` and ``R``, unless the axis is straight.
    """
    x, y, z = ray[0] + way * ray[3], ray[1] + way * ray[4], ray[2] + way * ray[5]
    if surface.axis_s.shape[0] == 2:
        return z, x, y
    a, b = 0.0, 0.0
    for _ in range(30):
        _frame(surface, s, o, R)
        dx, dy, dz = x - o[0], y - o[1], z - o[2]
        a = R[0, 0] * dx + R[1, 0] * dy + R[2, 0] * dz
        b = R[0, 1] * dx + R[1, 1] * dy + R[2, 1] * dz
        c = R[0, 2] * dx + R[1, 2] * dy + R[2, 2] * dz
        s += c
        if abs(c) < 1e-9:
            break
    return s, a, b


@kernel
def radius_at(surface, s, psi):  # type: ignore[no-untyped-def]
    """Return the wall's radius at a distance and an azimuth, linear between samples."""
    radius = surface.radius
    rows, columns = radius.shape[0], radius.shape[1] - 2
    y = min(max((s - surface.from_mm) / surface.step_mm, 0.0), rows - 1.0)
    i = min(int(y), rows - 2)
    x = (psi + np.pi) * columns / (2.0 * np.pi) + 0.5
    x -= np.floor((x - 0.5) / columns) * columns
    j = min(max(int(x), 0), columns)
    wy, wx = y - i, x - j
    upper = (1.0 - wx) * radius[i, j] + wx * radius[i, j + 1]
    lower = (1.0 - wx) * radius[i + 1, j] + wx * radius[i + 1, j + 1]
    return (1.0 - wy) * upper + wy * lower


@kernel
def meet(surface, ray, s, o, R, hit):  # type: ignore[no-untyped-def]
    """Find where a ray from inside the pipe first meets the wall.

    Parameters
    ----------
    ray : (6,)
        Origin and unit direction in W.
    s : float
        A guess of the origin's distance.
    o, R : (3,), (3, 3)
        Work space; on return the axis point and the section's frame at the hit.
    hit : (4,)
        On return the way along the ray, mm, the wall's distance, azimuth and radius there.

    Returns
    -------
    bool
        False where the ray leaves without meeting the wall within two metres.
    """
    straight, last = surface.axis_s.shape[0] == 2, surface.floor_mm.shape[1] - 1
    way, low, gap, gap_low = 0.0, 0.0, 0.0, -1.0
    da, db = ray[3], ray[4]
    if straight:
        way = _reach(ray[0], ray[1], da, db, surface.least_mm * 0.999)
    while way < _FAR_MM:
        s, a, b = _locate(surface, ray, way, s, o, R)
        if not straight:
            da = R[0, 0] * ray[3] + R[1, 0] * ray[4] + R[2, 0] * ray[5]
            db = R[0, 1] * ray[3] + R[1, 1] * ray[4] + R[2, 1] * ray[5]
        rho = np.sqrt(a * a + b * b)
        k = min(max(int(s - surface.from_mm), 0), last)
        if rho < surface.floor_mm[0, k]:
            low, gap_low = way, -1.0
            far = min(_reach(a, b, da, db, surface.floor_mm[1, k]), _WIDE_STEP_MM)
            near = min(_reach(a, b, da, db, surface.floor_mm[0, k] + _CLOSE_MM), _NEAR_STEP_MM)
            way += max(far, near, _CLOSE_MM)
            continue
        psi = np.arctan2(b, a)
        wall = radius_at(surface, s, psi)
        gap = wall - rho
        hit[0], hit[1], hit[2], hit[3] = way, s, psi, wall
        if gap <= _CLOSE_MM:
            break
        low, gap_low = way, gap
        way += min(max(_reach(a, b, da, db, wall), _CLOSE_MM), _FINE_MM)
    if way >= _FAR_MM or np.isnan(way):
        return False
    if gap < -_CLOSE_MM:
        _refine(surface, ray, low, gap_low, way, gap, s, o, R, hit)
    if straight:
        _straight_frame(hit[1], o, R)
    return True


@kernel
def _straight_frame(s, o, R):  # type: ignore[no-untyped-def]
    o[0], o[1], o[2] = 0.0, 0.0, s
    for a in range(3):
        for b in range(3):
            R[a, b] = 1.0 if a == b else 0.0


@kernel
def _reach(a, b, da, db, radius):  # type: ignore[no-untyped-def]
    """Return the way from (a, b) in a section to a radius about its axis; 0 from beyond it."""
    square, along, left = da * da + db * db, a * da + b * db, a * a + b * b - radius * radius
    if left >= 0.0:
        return 0.0
    if square * _FAR_MM * _FAR_MM < -left:
        return _FAR_MM
    return (-along + np.sqrt(along * along - square * left)) / square


@kernel
def _gap(surface, ray, way, s, o, R, hit):  # type: ignore[no-untyped-def]
    s, a, b = _locate(surface, ray, way, s, o, R)
    psi = np.arctan2(b, a)
    wall = radius_at(surface, s, psi)
    hit[0], hit[1], hit[2], hit[3] = way, s, psi, wall
    return wall - np.sqrt(a * a + b * b)


@kernel
def _refine(surface, ray, low, f_low, high, f_high, s, o, R, hit):  # type: ignore[no-untyped-def]
    """Close in on the crossing between two ways: regula falsi with the Illinois rule."""
    if f_low <= 0.0:
        f_low = _gap(surface, ray, low, s, o, R, hit)
    if f_low <= 0.0:
        return
    side = 0
    for _ in range(60):
        way = (low * f_high - high * f_low) / (f_high - f_low)
        f = _gap(surface, ray, way, s, o, R, hit)
        if abs(f) < _CLOSE_MM or high - low < 1e-9:
            return
        if f > 0.0:
            low, f_low = way, f
            if side == 1:
                f_high *= 0.5
            side = 1
        else:
            high, f_high = way, f
            if side == -1:
                f_low *= 0.5
            side = -1


@kernel
def normal_at(surface, hit, R, normal):  # type: ignore[no-untyped-def]
    """Write the wall's inward unit normal in W at a hit, from differences over one cell each way.

    The foreshortening of distance in a bend, 1 − κ r cos, is left out of the slope along the pipe.
    """
    radius, psi = surface.radius, hit[2]
    rows, columns = radius.shape[0], radius.shape[1] - 2
    y = min(max((hit[1] - surface.from_mm) / surface.step_mm, 1.0), rows - 2.001)
    x = (psi + np.pi) * columns / (2.0 * np.pi) + 0.5
    i, j = int(y), int(np.floor(x))
    wy, wx = y - i, x - j
    j = (j - 1) % columns + 1
    left, right, beyond = j - 1 if j > 1 else columns, j + 1, j + 2 if j < columns else 2
    along = (1.0 - wx) * (
        (1.0 - wy) * (radius[i + 1, j] - radius[i - 1, j]) + wy * (radius[i + 2, j] - radius[i, j])
    )
    along += wx * (
        (1.0 - wy) * (radius[i + 1, right] - radius[i - 1, right])
        + wy * (radius[i + 2, right] - radius[i, right])
    )
    around = (1.0 - wy) * (
        (1.0 - wx) * (radius[i, right] - radius[i, left]) + wx * (radius[i, beyond] - radius[i, j])
    )
    around += wy * (
        (1.0 - wx) * (radius[i + 1, right] - radius[i + 1, left])
        + wx * (radius[i + 1, beyond] - radius[i + 1, j])
    )
    along /= 2.0 * surface.step_mm
    around *= columns / (4.0 * np.pi * hit[3])
    c, sn = np.cos(psi), np.sin(psi)
    size = 1.0 / np.sqrt(1.0 + along * along + around * around)
    x, y, z = -(c + around * sn) * size, -(sn - around * c) * size, along * size
    for k in range(3):
        normal[k] = R[k, 0] * x + R[k, 1] * y + R[k, 2] * z
