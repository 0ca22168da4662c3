"""Light of the LEDs, and uniform stray light, that the wall sends to each pixel."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.signal import fftconvolve

from pipeline.arrays import Float
from pipeline.simulator.instrument import LedRing, TrueLaser, lamp_azimuth_rad
from pipeline.simulator.kernel import kernel
from pipeline.simulator.raycast import azimuth_of, first_hit, normal_at, radius_at
from pipeline.simulator.rays import part_ray_at
from pipeline.simulator.surface import Surface, albedo_at, sheen_at
from pipeline.simulator.view import REFERENCE_MM, View, Work, to_wall

# Largest distance of a hit from the wall, mm: less than a hundredth of a pixel even at grazing incidence.
_CLOSE_MM = 5e-4
# Distance from a hit within which wall is tested for shading, mm: wall farther off would have to protrude by
# more than 10 mm to hide an LED. And the least protrusion that is tested, mm: ten times the error of the
# map's
# cells.
_SHADOW_MM, _STANDS_IN_MM = 40.0, 0.01
# Spacing of the table of light from wall to wall: far below a bore's radius, its scale.
GLOW_STEP_MM = 0.5


class Lamps(NamedTuple):
    """What lights the wall.

    Attributes
    ----------
    place : (3, L)
        LEDs in C.
    share : (L,)
        Light of each, full scales, on a white wall that faces it squarely from the reference distance.
    lobe, even : float
        See `LedRing`.
    ambient : float
        Light, full scales, of a white wall under stray light.
    radius_mm : float
        Of the LEDs' circle about the camera's axis.
    glow : (K, 3)
        Light, by colour, that the wall throws on itself, every `GLOW_STEP_MM` of distance; K may be 0.
    glow_from_mm : float
        Distance of the first.
    """

    place: Float
    share: Float
    lobe: float
    even: float
    ambient: float
    radius_mm: float
    glow: Float
    glow_from_mm: float


def lamps_of(ring: LedRing) -> Lamps:
    """Return the lamps of a ring of LEDs."""
    around = lamp_azimuth_rad(ring.leds)
    across = ring.radius_mm * np.stack([np.cos(around), np.sin(around)])
    place = np.concatenate([across, np.full((1, ring.leds), ring.z_mm)])
    share = ring.level / ring.leds * np.array(ring.pattern or (1.0,) * ring.leds)
    return Lamps(place, share, ring.lobe, ring.even, 0.0, ring.radius_mm, np.zeros((0, 3)), 0.0)


def stray_light(level: float) -> Lamps:
    """Return no lamps but uniform stray light."""
    return Lamps(np.zeros((3, 0)), np.zeros(0), 1.0, 0.0, level, 0.0, np.zeros((0, 3)), 0.0)


@kernel
def least_ahead(lamps: Lamps) -> float:
    """Return the cosine to the optical axis below which nothing is lit.

    LEDs face forward and are near the viewpoint; stray light comes from everywhere.
    """
    return -0.05 if lamps.ambient == 0.0 and lamps.glow.shape[0] == 0 else -1.0


@kernel
def glow_at(lamps: Lamps, s: float, c: int) -> float:
    """Return the light from wall to wall at a distance, in one colour; 0 beyond the table."""
    x = (s - lamps.glow_from_mm) * (1.0 / GLOW_STEP_MM)
    if not (x >= 0.0 and x < lamps.glow.shape[0] - 1):
        return 0.0
    k = int(x)
    return float(lamps.glow[k, c] + (x - k) * (lamps.glow[k + 1, c] - lamps.glow[k, c]))


@kernel
def light_of_ray(
    view: View, lamps: Lamps, v: int, u: int, n: int, k: int, samples: int, work: Work, lit: Float,
    total: Float,
) -> None:  # fmt: skip
    """Add the light, by colour (3,), that part ``n`` of a pixel sees of the lamps at moment ``k``.

    ``lit`` (3, L) is work space for the contribution of each lamp.
    """
    part_ray_at(view.rays, u, v, n, samples, work.c_ray)
    _ray_light(view, lamps, v, k, samples, work, lit, total)


@kernel
def _ray_light(
    view: View, lamps: Lamps, row: int, k: int, samples: int, work: Work, lit: Float, total: Float
) -> None:
    c_ray, w_ray, hit, normal, albedo = work.c_ray, work.w_ray, work.hit, work.normal, work.albedo
    if not (c_ray[5] > least_ahead(lamps)):
        return
    to_wall(view, row, k, c_ray, w_ray)
    if not first_hit(view.surface, w_ray, view.distance_mm, _CLOSE_MM, work.o, work.R, hit):
        return
    normal_at(view.surface, hit, work.R, normal)
    facing = -(w_ray[3] * normal[0] + w_ray[4] * normal[1] + w_ray[5] * normal[2])
    if facing <= 0.0:
        return
    light = lamps.ambient
    if lamps.place.shape[1] > 0:
        T = view.pose[min(row, view.pose.shape[0] - 1), k]
        light += _lamp_light(view, lamps, T, facing, work, lit)
    foot = hit[0] / (view.px_per_rad * samples * max(facing, 0.05))
    albedo_at(view.texture, hit[1], hit[2], foot, albedo)
    for c in range(3):
        total[c] += (light + glow_at(lamps, hit[1], c)) * albedo[c]


@kernel
def _lamp_light(view: View, lamps: Lamps, T: Float, facing: float, work: Work, lit: Float) -> float:
    """Return the light of all lamps at the hit in ``work``.

    ``lit`` (3, L) is work space for each contribution.
    """
    at, way, normal, place = work.at, work.way, work.normal, lamps.place
    for a in range(3):
        at[a] = work.c_ray[a] + work.hit[0] * work.c_ray[3 + a]
    _face_lamps(place, at, work.c_ray, normal, T, facing, lit)
    hidden = _may_hide(view.surface, lamps.radius_mm, work.hit, T, work.o, work.R)
    light = 0.0
    for n in range(place.shape[1]):
        if lit[0, n] <= 0.0 or lit[1, n] <= 0.0:
            continue
        if hidden:
            for a in range(3):
                way[a] = at[a] - place[a, n]
            distance = np.sqrt(way[0] * way[0] + way[1] * way[1] + way[2] * way[2])
            if _shaded(view.surface, work.hit, T, way, distance, work.R):
                continue
        lobe = lit[1, n] if lamps.lobe == 1.0 else lit[1, n] ** lamps.lobe
        light += (
            lamps.share[n]
            * (lamps.even + (1.0 - lamps.even) * lobe)
            * lit[0, n]
            * sheen_at(view.texture, lit[2, n])
        )
    return light


@kernel
def _face_lamps(
    place: Float, at: Float, ray: Float, normal: Float, T: Float, facing: float, lit: Float
) -> None:
    """Write for each lamp: light over its lobe, cosine at the lamp, squared cosine of the half-way direction.

    Without branches and sums, so that several lamps are computed at once.
    """
    px, py, pz, rx, ry, rz = at[0], at[1], at[2], ray[3], ray[4], ray[5]
    nx = T[0, 0] * normal[0] + T[1, 0] * normal[1] + T[2, 0] * normal[2]
    ny = T[0, 1] * normal[0] + T[1, 1] * normal[1] + T[2, 1] * normal[2]
    nz = T[0, 2] * normal[0] + T[1, 2] * normal[1] + T[2, 2] * normal[2]
    for n in range(place.shape[1]):
        x, y, z = px - place[0, n], py - place[1, n], pz - place[2, n]
        near = 1.0 / np.sqrt(x * x + y * y + z * z)
        square = -(x * nx + y * ny + z * nz) * near
        along = (x * rx + y * ry + z * rz) * near
        lit[0, n] = square * (REFERENCE_MM * near) ** 2
        lit[1, n] = z * near
        lit[2, n] = (square + facing) ** 2 / (2.0 + 2.0 * along)


@kernel
def _may_hide(surface: Surface, lamps_mm: float, hit: Float, T: Float, o: Float, R: Float) -> bool:
    """Return whether the wall between a hit and the camera protrudes far enough to hide LEDs on a circle."""
    along = R[0, 2] * (o[0] - T[0, 3]) + R[1, 2] * (o[1] - T[1, 3]) + R[2, 2] * (o[2] - T[2, 3])
    if along <= 1.0:
        return False
    back = 0.5
    while back < min(along, _SHADOW_MM):
        k = min(max(int(hit[1] - back - surface.from_mm), 0), surface.floor_mm.shape[1] - 1)
        if surface.floor_mm[0, k] < hit[3] * (1.0 - back / along) + lamps_mm * back / along:
            return True
        back *= 2.0
    return False


@kernel
def _shaded(surface: Surface, hit: Float, T: Float, way: Float, distance: float, R: Float) -> bool:
    """Return whether the wall lies between a hit and an LED; the section's frame is taken as straight.

    ``way`` (3,) leads from the LED to the hit in C and is ``distance`` long, ``T`` transforms C to W.
    """
    c, s, dx, dy, dz = hit[4], hit[5], 0.0, 0.0, 0.0
    for a in range(3):
        turned = -(T[a, 0] * way[0] + T[a, 1] * way[1] + T[a, 2] * way[2]) / distance
        dx += R[a, 0] * turned
        dy += R[a, 1] * turned
        dz += R[a, 2] * turned
    step = 0.3
    back = step
    while back < min(distance, _SHADOW_MM):
        x, y = hit[3] * c + back * dx, hit[3] * s + back * dy
        rho = np.sqrt(x * x + y * y)
        if rho < surface.least_mm:
            return False
        if radius_at(surface, hit[1] + back * dz, azimuth_of(y, x)) < rho - _STANDS_IN_MM:
            return True
        step *= 1.25
        back += step
    return False


# Tabled distance on each side of the camera, in radii: a ring sends 10⁻⁴ of its light farther than 12.
_REACH_RADII = 12.0
_AZIMUTHS = 48


def ring_to_ring(apart_mm: Float, radius_mm: float) -> Float:
    """Return the share of a ring's light, per mm, that meets the wall at a distance (...) from it.

    Its integral over the whole bore is 1. From the view factor between coaxial discs, differentiated twice:
    J. R. Howell, A Catalog of Radiation Heat Transfer Configuration Factors, ring to ring of a cylinder.
    """
    x = np.abs(np.asarray(apart_mm, float)) / (2 * radius_mm)
    return np.asarray((1 - x * (2 * x**2 + 3) / (2 * (x**2 + 1) ** 1.5)) / (2 * radius_mm))


def glow_of_lamps(lamps: Lamps, radius_mm: float, albedo: Float, distance_mm: float) -> Lamps:
    """Return lamps with the light that the wall, lit by them, throws on itself.

    Parameters
    ----------
    lamps : Lamps
    radius_mm : float
        The wall's mean.
    albedo : (3,)
        Its mean, by colour; times anything less than 1 for a part of the light.
    distance_mm : float
        Of the camera.
    """
    z = _ahead(radius_mm)
    lit = _lit(lamps, radius_mm, z)
    thrown = GLOW_STEP_MM * fftconvolve(lit, ring_to_ring(z, radius_mm), mode="same")
    return _with_glow(lamps, thrown, albedo, distance_mm + z[0])


def glow_of_line(
    dark: Lamps, laser: TrueLaser, radius_mm: float, albedo: Float, distance_mm: float
) -> Lamps:  # fmt: skip
    """Return lamps with the light that the line throws on the wall: see `glow_of_lamps`."""
    z = _ahead(radius_mm)
    around = np.linspace(-np.pi, np.pi, 360, endpoint=False)
    left = np.mean([np.prod([sector.left(a) for sector in laser.sectors]) for a in around])
    power = laser.power_mm * REFERENCE_MM / radius_mm * float(left)
    thrown = power * ring_to_ring(z - laser.sheet.baseline_mm, radius_mm)
    return _with_glow(dark, thrown, albedo, distance_mm + z[0])


def _ahead(radius_mm: float) -> Float:
    half = int(np.ceil(_REACH_RADII * radius_mm / GLOW_STEP_MM))
    return np.asarray(GLOW_STEP_MM * np.arange(-half, half + 1), float)


def _lit(lamps: Lamps, radius_mm: float, z: Float) -> Float:
    """Return the light of lamps (K,) on a white bore at distances ahead, mean over its azimuths."""
    around = 2 * np.pi * np.arange(_AZIMUTHS) / _AZIMUTHS
    lit = np.zeros(len(z))
    for (px, py, pz), share in zip(lamps.place.T, lamps.share, strict=True):
        x, y = radius_mm * np.cos(around) - px, radius_mm * np.sin(around) - py
        along = (z - pz)[:, None]
        d = np.sqrt(x**2 + y**2 + along**2)
        square = (x * np.cos(around) + y * np.sin(around)) / d
        sent = lamps.even + (1 - lamps.even) * np.clip(along / d, 0, 1) ** lamps.lobe
        lit += share * np.mean(np.where(along > 0, sent * square * (REFERENCE_MM / d) ** 2, 0.0), axis=1)
    return lit


def _with_glow(lamps: Lamps, thrown: Float, albedo: Float, from_mm: float) -> Lamps:
    glow = np.ascontiguousarray(thrown[:, None] * np.asarray(albedo, float))
    return lamps._replace(glow=glow, glow_from_mm=float(from_mm))
