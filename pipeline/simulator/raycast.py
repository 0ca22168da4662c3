"""Where rays first hit the wall, and the wall's normal there: kernels on the wall's grid."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Float
from pipeline.simulator.kernel import kernel
from pipeline.simulator.surface import NEAR_BLOCKS, WIDE_BLOCKS, Surface

# A step of a ray ends this many mm before the end of the stretch for which a floor (the least radius) holds.
_SPARE = 0.1
# Longest step near the wall: about a cell of the relief (0.25 mm), so that no feature is stepped over.
_FINE_MM = 0.3
# Shortest step: the precision of a hit that the line needs.
_LEAST_STEP_MM = 2e-5
# How far from a section's plane a point of a bent pipe may lie: off by this times radius over bend, below
# the precision of a hit.
_SECTION_MM = 1e-5
# Length of a ray, mm, after which it counts as lost: farther than any light reaches in such a pipe.
_FAR_MM = 2000.0


@kernel
def frame_at(surface: Surface, s: float, o: Float, R: Float) -> None:
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
    beyond = (w - inside) * span
    for a in range(3):
        o[a] = (1.0 - inside) * axis_o[k, a] + inside * axis_o[k + 1, a] + beyond * R[a, 2]


@kernel
def _locate(
    surface: Surface, ray: Float, way: float, s: float, o: Float, R: Float
) -> tuple[float, float, float]:
    """Return distance, and x and y off the axis in its section, of a ray's point; s is a first guess.

    Leaves the section's axis point and frame in ``o`` and ``R``, unless the axis is straight.
    """
    x, y, z = ray[0] + way * ray[3], ray[1] + way * ray[4], ray[2] + way * ray[5]
    if surface.axis_s.shape[0] == 2:
        return z, x, y
    a, b = 0.0, 0.0
    for _ in range(30):
        frame_at(surface, s, o, R)
        dx, dy, dz = x - o[0], y - o[1], z - o[2]
        a = R[0, 0] * dx + R[1, 0] * dy + R[2, 0] * dz
        b = R[0, 1] * dx + R[1, 1] * dy + R[2, 1] * dz
        c = R[0, 2] * dx + R[1, 2] * dy + R[2, 2] * dz
        s += c
        if abs(c) < _SECTION_MM:
            break
    return s, a, b


@kernel
def cell_at(surface: Surface, s: float, psi: float) -> tuple[int, int, float, float]:
    """Return row and column of the sample before a place, and the fractions of the way to the next."""
    rows, columns = surface.radius.shape[0], surface.radius.shape[1] - 2
    y = min(max((s - surface.from_mm) * surface.rows_per_mm, 0.0), rows - 1.0)
    x = (psi + np.pi) * (columns * (0.5 / np.pi)) + 0.5
    i, j = min(int(y), rows - 2), min(max(int(x), 0), columns)
    return i, j, y - i, x - j


@kernel
def azimuth_of(y: float, x: float) -> float:
    """Return the azimuth of a point to 2·10⁻⁸ rad, in a third of the time of the library's function.

    Abramowitz and Stegun, Handbook of Mathematical Functions, 4.4.49.
    """
    low, high = min(abs(x), abs(y)), max(abs(x), abs(y))
    t = low / max(high, 1e-300)
    q = t * t
    value = 0.0028662257
    value = value * q - 0.0161657367
    value = value * q + 0.0429096138
    value = value * q - 0.0752896400
    value = value * q + 0.1065626393
    value = value * q - 0.1420889944
    value = value * q + 0.1999355085
    value = value * q - 0.3333314528
    value = (value * q + 1.0) * t
    value = 0.5 * np.pi - value if abs(y) > abs(x) else value
    value = np.pi - value if x < 0.0 else value
    return float(-value if y < 0.0 else value)


@kernel
def radius_at(surface: Surface, s: float, psi: float) -> float:
    """Return the wall's radius at a distance and an azimuth from −π to π, linear between samples."""
    radius = surface.radius
    i, j, wy, wx = cell_at(surface, s, psi)
    upper = (1.0 - wx) * radius[i, j] + wx * radius[i, j + 1]
    lower = (1.0 - wx) * radius[i + 1, j] + wx * radius[i + 1, j + 1]
    return float((1.0 - wy) * upper + wy * lower)


@kernel
def first_hit(surface: Surface, ray: Float, s: float, close: float, o: Float, R: Float, hit: Float) -> bool:
    """Find where a ray from inside the pipe first meets the wall.

    Parameters
    ----------
    ray : (6,)
        Origin and unit direction in W.
    s : float
        A guess of the origin's distance.
    close : float
        Largest distance of a hit from the wall, mm.
    o, R : (3,), (3, 3)
        Work space; on return the axis point and the section's frame at the hit.
    hit : (6,)
        On return the way along the ray, mm, the wall's distance, azimuth and radius there, and the azimuth's
        cosine and sine.

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
            far = min(_reach(a, b, da, db, surface.floor_mm[1, k]), WIDE_BLOCKS - _SPARE)
            near = min(_reach(a, b, da, db, surface.floor_mm[0, k] + _LEAST_STEP_MM), NEAR_BLOCKS - _SPARE)
            way += max(far, near, _LEAST_STEP_MM)
            continue
        psi = azimuth_of(b, a)
        wall = radius_at(surface, s, psi)
        gap = wall - rho
        write_hit(hit, way, s, psi, wall, a / rho, b / rho)
        if gap <= close:
            break
        low, gap_low = way, gap
        way += min(max(_reach(a, b, da, db, wall), _LEAST_STEP_MM), _FINE_MM)
    if way >= _FAR_MM or np.isnan(way):
        return False
    if gap < -close:
        _refine(surface, ray, close, low, gap_low, way, gap, s, o, R, hit)
    if straight:
        straight_frame(hit[1], o, R)
    return True


@kernel
def straight_frame(s: float, o: Float, R: Float) -> None:
    """Write a straight axis' point and the section's frame at distance s."""
    o[0], o[1], o[2] = 0.0, 0.0, s
    for a in range(3):
        for b in range(3):
            R[a, b] = 1.0 if a == b else 0.0


@kernel
def _reach(a: float, b: float, da: float, db: float, radius: float) -> float:
    """Return the distance from (a, b) in a section to a radius about its axis; 0 from outside it."""
    square, along, left = da * da + db * db, a * da + b * db, a * a + b * b - radius * radius
    if left >= 0.0:
        return 0.0
    if square * _FAR_MM * _FAR_MM < -left:
        return _FAR_MM
    return float((-along + np.sqrt(along * along - square * left)) / square)


@kernel
def _gap(surface: Surface, ray: Float, way: float, s: float, o: Float, R: Float, hit: Float) -> float:
    s, a, b = _locate(surface, ray, way, s, o, R)
    psi, rho = azimuth_of(b, a), np.sqrt(a * a + b * b)
    wall = radius_at(surface, s, psi)
    write_hit(hit, way, s, psi, wall, a / rho, b / rho)
    return float(wall - rho)


@kernel
def write_hit(hit: Float, way: float, s: float, psi: float, wall: float, c: float, sn: float) -> None:
    """Write a hit: way, distance, azimuth, radius, and cosine and sine of the azimuth."""
    hit[0], hit[1], hit[2], hit[3], hit[4], hit[5] = way, s, psi, wall, c, sn


@kernel
def _refine(
    surface: Surface,
    ray: Float,
    close: float,
    low: float,
    f_low: float,
    high: float,
    f_high: float,
    s: float,
    o: Float,
    R: Float,
    hit: Float,
) -> None:
    """Narrow down the crossing between two distances along the ray: regula falsi with the Illinois rule."""
    if f_low <= 0.0:
        f_low = _gap(surface, ray, low, s, o, R, hit)
    if f_low <= 0.0:
        return
    side = 0
    for _ in range(60):
        way = (low * f_high - high * f_low) / (f_high - f_low)
        f = _gap(surface, ray, way, s, o, R, hit)
        if abs(f) < close or high - low < 1e-9:
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
def normal_at(surface: Surface, hit: Float, R: Float, normal: Float) -> None:
    """Write the wall's inward unit normal in W at a hit, from slopes linear between samples.

    The foreshortening of distance in a bend, 1 − κ r cos, is neglected in the slope along the pipe.
    """
    slope = surface.slope
    i, j, wy, wx = cell_at(surface, hit[1], hit[2])
    w00, w01, w10, w11 = (1.0 - wy) * (1.0 - wx), (1.0 - wy) * wx, wy * (1.0 - wx), wy * wx
    along = w00 * slope[i, j, 0] + w01 * slope[i, j + 1, 0]
    along += w10 * slope[i + 1, j, 0] + w11 * slope[i + 1, j + 1, 0]
    around = w00 * slope[i, j, 1] + w01 * slope[i, j + 1, 1]
    around += w10 * slope[i + 1, j, 1] + w11 * slope[i + 1, j + 1, 1]
    around /= hit[3]
    c, sn = hit[4], hit[5]
    size = 1.0 / np.sqrt(1.0 + along * along + around * around)
    x, y, z = -(c + around * sn) * size, -(sn - around * c) * size, along * size
    for k in range(3):
        normal[k] = R[k, 0] * x + R[k, 1] * y + R[k, 2] * z
