"""Where rays meet the wall: kernels on a wall's grid."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter1d

from pipeline.simulator.wall.base import Wall

Float = NDArray[np.float64]
Float32 = NDArray[np.float32]
# A coarse step stays within the two millimetres that the floor looks ahead.
_COARSE_MM = 1.9
_FINE_MM = 0.3
_FAR_MM = 2000.0
_CLOSE_MM = 1e-7


class Surface(NamedTuple):
    """A wall laid out for the kernels.

    Attributes
    ----------
    radius : (rows, columns + 2) float32
        One column more on each side, so that interpolation needs no wrapping.
    from_mm, step_mm : float
        Of the rows.
    floor_mm : (blocks,)
        Least radius within and next to every millimetre of distance.
    least_mm, most_mm : float
        Of all radii.
    axis_s : (K,), axis_o : (K, 3), axis_R : (K, 3, 3)
        The axis in P; its points are evenly spaced.
    """

    radius: Float32
    from_mm: float
    step_mm: float
    floor_mm: Float
    least_mm: float
    most_mm: float
    axis_s: Float
    axis_o: Float
    axis_R: Float


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
    )


def _floor(wall: Wall) -> Float:
    """Return the least radius of every millimetre, its neighbours included."""
    block = np.floor(wall.shape.step_mm * np.arange(wall.shape.rows)).astype(int)
    least = np.full(block[-1] + 1, np.inf)
    np.minimum.at(least, block, wall.radius_mm.min(1).astype(float))
    filled = np.minimum.accumulate(np.where(np.isfinite(least), least, np.inf))
    least = np.where(np.isfinite(least), least, filled)
    return np.asarray(minimum_filter1d(least, 5, mode="nearest"))


@njit(cache=True, nogil=True, inline="always")
def _frame(surface, s, o, R):  # type: ignore[no-untyped-def]
    """Write the axis point and the section's frame at distance s; straight beyond the ends."""
    count = surface.axis_s.shape[0]
    if count == 2:
        for a in range(3):
            for b in range(3):
                R[a, b] = surface.axis_R[0, a, b]
            o[a] = surface.axis_o[0, a] + (s - surface.axis_s[0]) * R[a, 2]
        return
    span = (surface.axis_s[count - 1] - surface.axis_s[0]) / (count - 1)
    w = (s - surface.axis_s[0]) / span
    k = min(max(int(np.floor(w)), 0), count - 2)
    w -= k
    inside = min(max(w, 0.0), 1.0)
    for a in range(3):
        for b in range(3):
            R[a, b] = (1.0 - inside) * surface.axis_R[k, a, b] + inside * surface.axis_R[k + 1, a, b]
    _orthonormalise(R)
    beyond = (w - inside) * span
    for a in range(3):
        o[a] = (1.0 - inside) * surface.axis_o[k, a] + inside * surface.axis_o[k + 1, a] + beyond * R[a, 2]


@njit(cache=True, nogil=True, inline="always")
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


@njit(cache=True, nogil=True)
def locate(surface, x, y, z, s, o, R):  # type: ignore[no-untyped-def]
    """Return distance, and x and y off the axis in its section, of a point of P; s is a first guess.

    Leaves the section's axis point and frame in ``o`` and ``R``.
    """
    a, b = 0.0, 0.0
    straight = surface.axis_s.shape[0] == 2
    for _ in range(30):
        _frame(surface, s, o, R)
        dx, dy, dz = x - o[0], y - o[1], z - o[2]
        a = R[0, 0] * dx + R[1, 0] * dy + R[2, 0] * dz
        b = R[0, 1] * dx + R[1, 1] * dy + R[2, 1] * dz
        c = R[0, 2] * dx + R[1, 2] * dy + R[2, 2] * dz
        s += c
        if abs(c) < 1e-9 or straight:
            break
    return s, a, b


@njit(cache=True, nogil=True)
def radius_at(surface, s, psi):  # type: ignore[no-untyped-def]
    """Return the wall's radius at a distance and an azimuth, linear between samples."""
    rows, columns = surface.radius.shape[0], surface.radius.shape[1] - 2
    y = min(max((s - surface.from_mm) / surface.step_mm, 0.0), rows - 1.0)
    i = min(int(y), rows - 2)
    x = (psi + np.pi) * columns / (2.0 * np.pi) + 0.5
    x -= np.floor((x - 0.5) / columns) * columns
    j = min(max(int(x), 0), columns)
    wy, wx = y - i, x - j
    r = surface.radius
    upper = (1.0 - wx) * r[i, j] + wx * r[i, j + 1]
    lower = (1.0 - wx) * r[i + 1, j] + wx * r[i + 1, j + 1]
    return (1.0 - wy) * upper + wy * lower


@njit(cache=True, nogil=True)
def _floor_at(surface, s):  # type: ignore[no-untyped-def]
    k = int(s - surface.from_mm)
    return surface.floor_mm[min(max(k, 0), surface.floor_mm.shape[0] - 1)]


@njit(cache=True, nogil=True)
def meet(surface, ray, s, o, R, hit):  # type: ignore[no-untyped-def]
    """Find where a ray from inside the pipe first meets the wall.

    Parameters
    ----------
    ray : (6,)
        Origin and unit direction in P.
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
    way, low = 0.0, 0.0
    s, a, b = locate(surface, ray[0], ray[1], ray[2], s, o, R)
    if surface.axis_s.shape[0] == 2:
        way = max(_to_cylinder(ray, o, R, surface.least_mm * 0.999), 0.0)
    gap = 0.0
    while way < _FAR_MM:
        s, a, b = locate(
            surface, ray[0] + way * ray[3], ray[1] + way * ray[4], ray[2] + way * ray[5], s, o, R
        )
        rho = np.sqrt(a * a + b * b)
        floor = _floor_at(surface, s)
        if rho < floor:
            low = way
            way += min(max(floor - rho, _FINE_MM), _COARSE_MM)
            continue
        gap = radius_at(surface, s, np.arctan2(b, a)) - rho
        if gap <= 0.0:
            break
        low = way
        way += min(max(0.5 * gap, 0.02), _FINE_MM)
    if way >= _FAR_MM or not way == way:
        return False
    _refine(surface, ray, low, way, s, o, R, hit)
    return True


@njit(cache=True, nogil=True, inline="always")
def _to_cylinder(ray, o, R, radius):  # type: ignore[no-untyped-def]
    """Return the way at which a ray reaches a radius about a straight axis; 0 if it starts beyond."""
    px, py, dx, dy = 0.0, 0.0, 0.0, 0.0
    for k in range(3):
        px += R[k, 0] * (ray[k] - o[k])
        py += R[k, 1] * (ray[k] - o[k])
        dx += R[k, 0] * ray[3 + k]
        dy += R[k, 1] * ray[3 + k]
    a, b, c = dx * dx + dy * dy, px * dx + py * dy, px * px + py * py - radius * radius
    if c >= 0.0:
        return 0.0
    if a * _FAR_MM * _FAR_MM < -c:
        return _FAR_MM
    return (-b + np.sqrt(b * b - a * c)) / a


@njit(cache=True, nogil=True)
def _gap(surface, ray, way, s, o, R, hit):  # type: ignore[no-untyped-def]
    s, a, b = locate(surface, ray[0] + way * ray[3], ray[1] + way * ray[4], ray[2] + way * ray[5], s, o, R)
    psi = np.arctan2(b, a)
    radius = radius_at(surface, s, psi)
    hit[0], hit[1], hit[2], hit[3] = way, s, psi, radius
    return radius - np.sqrt(a * a + b * b)


@njit(cache=True, nogil=True)
def _refine(surface, ray, low, high, s, o, R, hit):  # type: ignore[no-untyped-def]
    """Close in on the crossing between two ways: regula falsi with the Illinois rule."""
    f_low = _gap(surface, ray, low, s, o, R, hit)
    f_high = _gap(surface, ray, high, s, o, R, hit)
    if f_low <= 0.0:
        _gap(surface, ray, low, s, o, R, hit)
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


@njit(cache=True, nogil=True)
def normal_at(surface, hit, R, normal):  # type: ignore[no-untyped-def]
    """Write the wall's inward unit normal in P at a hit, from differences over one cell each way.

    The foreshortening of distance in a bend, 1 − κ r cos, is left out of the slope along the pipe.
    """
    s, psi, r = hit[1], hit[2], hit[3]
    ds = surface.step_mm
    dp = 2.0 * np.pi / (surface.radius.shape[1] - 2)
    along = (radius_at(surface, s + ds, psi) - radius_at(surface, s - ds, psi)) / (2.0 * ds)
    around = (radius_at(surface, s, psi + dp) - radius_at(surface, s, psi - dp)) / (2.0 * dp * r)
    c, sn = np.cos(psi), np.sin(psi)
    size = np.sqrt(1.0 + along * along + around * around)
    x, y, z = -(c + around * sn) / size, -(sn - around * c) / size, along / size
    for k in range(3):
        normal[k] = R[k, 0] * x + R[k, 1] * y + R[k, 2] * z
