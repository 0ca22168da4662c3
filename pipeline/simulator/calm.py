"""A fast search for hits from a good start value, where the wall is so smooth that rays meet it only once."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import minimum_filter1d

from pipeline.arrays import Float
from pipeline.simulator.kernel import kernel
from pipeline.simulator.raycast import azimuth_of, frame_at, radius_at, straight_frame, write_hit
from pipeline.simulator.surface import NEAR_BLOCKS, SECTORS, Surface

# Steepest wall over the ray's own rate of approach that counts as calm. Below 1 the ray can meet the wall
# once; half of it holds for the rays of lamps a bore's half radius aside as well.
_CALM = 0.5
# Distance from a section's plane up to which a bend does not turn the section: 0.1²/(2·50 mm) = 0.1 µm.
_SAME_SECTION_MM = 0.1
_STEPS = 10


# The clear radius of a sector is the least of it and of so many neighbours on each side, 45° to either. A ray
# turns by less than 45° about the axis once the part of its start beside its own direction is less than
# sin 45° of the radius that it has reached. See `clear_mm`.
_BESIDE = 4
_ABREAST = 1 / np.sqrt(2)


def clear_mm(surface: Surface, T_wc: Float, distance_mm: float, aside_mm: float) -> Float:
    """Return the largest radius (blocks, SECTORS) that is surely in plain view.

    A straight line from within ``e`` of the axis at the camera's distance d to radius ρ at distance s is at
    most e + f (ρ − e) off the axis after a share f of the way; it is clear of a wall of radius w there while
    (ρ − e)/|s − d| < (w − e)/(f |s − d|). In a bend the line strays from the axis by a further sagitta. Its
    azimuth then differs from the last by asin(e/(f ρ)) at most; until that is less than the sectors beside,
    the wall all round counts.

    Parameters
    ----------
    surface : Surface
    T_wc : (3, 4)
        Camera in W.
    distance_mm : float
        Of the camera.
    aside_mm : float
        Largest distance from the camera at which the lines may begin.
    """
    o, R = np.zeros(3), np.eye(3)
    if len(surface.axis_s) > 2:
        frame_at(surface, distance_mm, o, R)
    off = (T_wc[:, 3] - o) @ R
    away = np.asarray(surface.from_mm + np.arange(len(surface.floor_mm[0])) + 0.5 - distance_mm, float)
    floor = surface.sector_floor_mm
    all_round = floor.min(1)
    beside = minimum_filter1d(floor, 2 * _BESIDE + 1, axis=1, mode="wrap")
    clear = np.full(floor.shape, np.inf)
    for side in (1.0, -1.0):
        order = np.argsort(side * away)
        ahead = order[side * away[order] > 0]
        e = float(np.hypot(off[0], off[1])) + aside_mm + _sagitta_mm(surface, away[ahead])
        near = np.minimum(e / (_ABREAST * all_round[ahead]), 1.0)
        part = np.full((len(ahead), SECTORS), np.inf)
        _write_clear(all_round[ahead], beside[ahead], np.abs(away[ahead]), e, near, part)
        clear[ahead] = part
    return clear


def _sagitta_mm(surface: Surface, along_mm: Float) -> Float:
    """Return the largest distance between the axis and a chord of it, mm."""
    if len(surface.axis_s) == 2:
        return np.zeros(len(along_mm))
    turned = np.linalg.norm(np.diff(surface.axis_turn[:, :, 2], axis=0), axis=1).max()
    step = (surface.axis_s[-1] - surface.axis_s[0]) / (len(surface.axis_s) - 1)
    return np.asarray(turned / step * along_mm**2 / 8)


@kernel
def _write_clear(all_round: Float, beside: Float, along: Float, e: Float, near: Float, clear: Float) -> None:
    """Write the clearance (N, SECTORS) at blocks (N,) in order of their distance from the camera."""
    for k in range(along.shape[0]):
        least_round = np.inf
        for j in range(k - NEAR_BLOCKS):
            if along[j] > near[k] * along[k]:
                break
            least_round = min(least_round, (all_round[j] - e[k]) / along[j])
        for sector in range(beside.shape[1]):
            least = least_round
            for j in range(k - NEAR_BLOCKS - 1, -1, -1):
                if along[j] <= near[k] * along[k]:
                    break
                least = min(least, (beside[j, sector] - e[k]) / along[j])
            if least < np.inf:
                clear[k, sector] = e[k] + least * max(along[k] - 1.0, 0.0)


@kernel
def hit_near(
    surface: Surface, clear: Float, ray: Float, way: float, s: float, close: float, o: Float, R: Float,
    hit: Float,
) -> bool:  # fmt: skip
    """Find a hit, given a way along the ray and a distance close to it; the outputs are `first_hit`'s.

    Returns
    -------
    bool
        False where the search does not converge, or where the ray might meet the wall earlier: then
        `first_hit` has to be called.
    """
    straight = surface.axis_s.shape[0] == 2
    base, a0, b0, c0, da, db, dc = 0.0, ray[0], ray[1], ray[2], ray[3], ray[4], ray[5]
    if not straight:
        base = s
        a0, b0, c0, da, db, dc = _in_section(surface, ray, s, o, R)
    last = surface.steepest.shape[0] - 1
    for _ in range(_STEPS):
        c = c0 + way * dc
        if not straight and abs(c) > _SAME_SECTION_MM:
            base += c
            a0, b0, c0, da, db, dc = _in_section(surface, ray, base, o, R)
            c = c0 + way * dc
        a, b = a0 + way * da, b0 + way * db
        squared = a * a + b * b
        per_rho = 1.0 / np.sqrt(squared)
        rho, psi = squared * per_rho, azimuth_of(b, a)
        gap, rate = radius_at(surface, base + c, psi) - rho, (a * da + b * db) * per_rho
        k = min(max(int(base + c - surface.from_mm), 0), last)
        sector = min(int((psi + np.pi) * (SECTORS * 0.5 / np.pi)), SECTORS - 1)
        steepest = surface.steepest[k, sector]
        if not (steepest < _CALM * rate and rho + gap < clear[k, sector]):
            return False
        further = gap / rate
        # after this step the ray misses the wall by at most what the wall rises and bends away on it
        if abs(further) * (steepest + abs(further) * per_rho) < close:
            psi += further * (a * db - b * da) * per_rho * per_rho
            a, b = a + further * da, b + further * db
            per_rho = 1.0 / np.sqrt(a * a + b * b)
            write_hit(hit, way + further, base + c + further * dc, psi, rho + gap, a * per_rho, b * per_rho)
            if straight:
                straight_frame(hit[1], o, R)
            return True
        way += further
    return False


@kernel
def _in_section(
    surface: Surface, ray: Float, s: float, o: Float, R: Float
) -> tuple[float, float, float, float, float, float]:
    """Return a ray's origin and direction in the frame of the section at distance s.

    Writes that frame to o and R.
    """
    frame_at(surface, s, o, R)
    x, y, z = ray[0] - o[0], ray[1] - o[1], ray[2] - o[2]
    return (
        R[0, 0] * x + R[1, 0] * y + R[2, 0] * z,
        R[0, 1] * x + R[1, 1] * y + R[2, 1] * z,
        R[0, 2] * x + R[1, 2] * y + R[2, 2] * z,
        R[0, 0] * ray[3] + R[1, 0] * ray[4] + R[2, 0] * ray[5],
        R[0, 1] * ray[3] + R[1, 1] * ray[4] + R[2, 1] * ray[5],
        R[0, 2] * ray[3] + R[1, 2] * ray[4] + R[2, 2] * ray[5],
    )
