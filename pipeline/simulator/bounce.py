"""Light that the wall throws back into the bore once: a glow that depends on the distance along it alone.

The bore is taken as a straight dull cylinder of the wall's mean radius and reflectance, the camera on its
axis. What a ring of the wall sends to another ring is exact for that; harmonics around the bore are left out,
and so is light that bounces twice, which is weaker by a further factor of the reflectance.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import fftconvolve

from pipeline.arrays import Float
from pipeline.simulator.instrument import TrueLaser
from pipeline.simulator.line_light import REFERENCE_MM
from pipeline.simulator.wall_light import GLOW_STEP_MM, Lamps

# Way on each side of the camera that is tabled, in radii: a ring sends 10⁻⁴ of its light farther than 12.
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
