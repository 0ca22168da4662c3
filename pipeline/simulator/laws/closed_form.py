"""The closed-form laws of the physics notes: radius error, apparent less true, over azimuth.

Each takes the pipe's radius ``r``, mm, and azimuths ``psi`` (A,), rad, then the catalogue's quantities by
name, and returns the error (A,), mm. Constants are those of the bench. In the formulas c_m = cos m(ψ − ψ₀), l
is the baseline, f the focal length, T = r/l and S the function `lever_of`. Where the traced result shows that
the notes are wrong, `pipeline.simulator.laws.radius` uses the law that holds.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np

from pipeline.arrays import Float
from pipeline.physics.instrument import DOME_POWER, GLASS_INDEX, TUBE_OUTER_RADIUS_MM, TUBE_THICKNESS_MM
from pipeline.simulator.laws import BASELINE_MM, FOCAL_PX

Law = Callable[..., Float]


def theta_of(r: float) -> float:
    """Return the polar angle, rad, at which a ring of radius ``r``, mm, is seen."""
    return float(np.arctan2(r, BASELINE_MM))


def lever_of(r: float) -> float:
    """Return S, mm of radius for each radian of polar angle."""
    return (BASELINE_MM**2 + r**2) / BASELINE_MM


def crest(psi: Float, direction_deg: float, order: float = 1) -> Float:
    """Return c_m = cos m(ψ − ψ₀) (A,)."""
    return np.asarray(np.cos(order * (psi - np.radians(direction_deg))))


def laser_tilt(r: float, psi: Float, tilt_deg: float, direction_deg: float) -> Float:
    """−r x / (1 + x), x = T tan φ c₁."""
    x = r / BASELINE_MM * np.tan(np.radians(tilt_deg)) * crest(psi, direction_deg)
    return np.asarray(-r * x / (1 + x))


def laser_cone(r: float, psi: Float, cone_deg: float) -> Float:
    """−(r²/l) ε₀."""
    return np.full_like(psi, -(r**2) / BASELINE_MM * np.radians(cone_deg))


def baseline(r: float, psi: Float, baseline_mm: float) -> Float:
    """−(r/l) δl."""
    return np.full_like(psi, -r / BASELINE_MM * baseline_mm)


def beam_decentre(r: float, psi: Float, height_mm: float, direction_deg: float) -> Float:
    """−(r/l) h c₁."""
    return np.asarray(-r / BASELINE_MM * height_mm * crest(psi, direction_deg))


def sheet_waviness(r: float, psi: Float, amplitude_mrad: float, order: float, direction_deg: float) -> Float:
    """−(r²/l) ε_m c_m."""
    return np.asarray(-(r**2) / BASELINE_MM * 1e-3 * amplitude_mrad * crest(psi, direction_deg, order))


def principal_point(r: float, psi: Float, shift_px: float, direction_deg: float) -> Float:
    """(S/f) c c₁."""
    return np.asarray(lever_of(r) * shift_px / FOCAL_PX * crest(psi, direction_deg))


def focal_scale(r: float, psi: Float, relative: float) -> Float:
    """S κ θ."""
    return np.full_like(psi, lever_of(r) * relative * theta_of(r))


def radial_distortion(r: float, psi: Float, k: float) -> Float:
    """S k θ³."""
    return np.full_like(psi, lever_of(r) * k * theta_of(r) ** 3)


def sensor_tilt(r: float, psi: Float, p: float, direction_deg: float) -> Float:
    """3 S p₂ θ² c₁."""
    return np.asarray(3 * lever_of(r) * p * theta_of(r) ** 2 * crest(psi, direction_deg))


def pixel_aspect(r: float, psi: Float, relative: float) -> Float:
    """S (a/2) θ c₂."""
    return np.asarray(lever_of(r) * relative / 2 * theta_of(r) * np.cos(2 * psi))


def pupil_shift(r: float, psi: Float, shift_mm: float) -> Float:
    """(r/l) E(θ), E = ε (θ / sin θ − 1)."""
    theta = theta_of(r)
    return np.full_like(psi, r / BASELINE_MM * shift_mm * (theta / np.sin(theta) - 1))


def pixel_locking(r: float, psi: Float, amplitude_px: float) -> Float:
    """S (a/f) sin 2πρ."""
    rho = FOCAL_PX * theta_of(r)
    return np.full_like(psi, lever_of(r) * amplitude_px / FOCAL_PX * np.sin(2 * np.pi * rho))


def housing_glass(r: float, psi: Float, thickness_mm: float) -> Float:
    """−t (1 − tan i′ / tan i), tan i = l/r, sin i′ = sin i / n."""
    return np.full_like(psi, -thickness_mm * _glass_share(r))


def tube_wedge(r: float, psi: Float, wedge_mm: float, direction_deg: float) -> Float:
    """−δt (1 − tan i′ / tan i) c₁."""
    return np.asarray(-wedge_mm * _glass_share(r) * crest(psi, direction_deg))


def tube_tilt(r: float, psi: Float, tilt_deg: float, direction_deg: float) -> Float:
    """(d′(i) / sin θ) χ c₁ of the viewing ray, and −(r/l) t χ (1 − 1/n) c₁ of the sheet."""
    return _tilted_tube(r, psi, tilt_deg, direction_deg, np.sin(theta_of(r)))


def dome_axial(r: float, psi: Float, offset_mm: float) -> Float:
    """S (n−1) t d sin θ / (n ρ²)."""
    return np.full_like(psi, lever_of(r) * DOME_POWER * offset_mm * np.sin(theta_of(r)))


def dome_lateral(r: float, psi: Float, offset_mm: float, direction_deg: float) -> Float:
    """S (n−1) t d cos θ / (n ρ²) c₁."""
    size = lever_of(r) * DOME_POWER * offset_mm * np.cos(theta_of(r))
    return np.asarray(size * crest(psi, direction_deg))


def outside_index(r: float, psi: Float, index_excess: float) -> Float:
    """−(r − r_t) δn / sin² θ."""
    return np.full_like(psi, -(r - TUBE_OUTER_RADIUS_MM) * index_excess / np.sin(theta_of(r)) ** 2)


def ovality(r: float, psi: Float, amplitude_mm: float, direction_deg: float) -> Float:
    """a₂ c₂, of the pipe itself."""
    return np.asarray(amplitude_mm * crest(psi, direction_deg, 2))


def mended_tube_tilt(r: float, psi: Float, tilt_deg: float, direction_deg: float) -> Float:
    """(d′(i) / sin i) χ c₁ of the viewing ray, sin i = cos θ, and the same of the sheet."""
    return _tilted_tube(r, psi, tilt_deg, direction_deg, np.cos(theta_of(r)))


def _tilted_tube(r: float, psi: Float, tilt_deg: float, direction_deg: float, across: float) -> Float:
    chi, incidence, step = np.radians(tilt_deg), np.pi / 2 - theta_of(r), 1e-4
    change = (_offset(incidence + step) - _offset(incidence - step)) / (2 * step)
    sheet = -r / BASELINE_MM * TUBE_THICKNESS_MM * (1 - 1 / GLASS_INDEX)
    return np.asarray((change / across + sheet) * chi * crest(psi, direction_deg))


def _glass_share(r: float) -> float:
    incidence = np.pi / 2 - theta_of(r)
    return float(1 - np.tan(np.arcsin(np.sin(incidence) / GLASS_INDEX)) / np.tan(incidence))


def _offset(incidence: float) -> float:
    """Return d(i) = t sin(i − i′) / cos i′, by which a plate of the tube's glass displaces a ray."""
    inside = np.arcsin(np.sin(incidence) / GLASS_INDEX)
    return float(TUBE_THICKNESS_MM * np.sin(incidence - inside) / np.cos(inside))


LAWS: Mapping[str, Law] = MappingProxyType({
    law.__name__: law
    for law in (
        laser_tilt, laser_cone, baseline, beam_decentre, sheet_waviness, principal_point, focal_scale,
        radial_distortion, sensor_tilt, pixel_aspect, pupil_shift, pixel_locking, housing_glass, tube_wedge,
        tube_tilt, dome_axial, dome_lateral, outside_index, ovality,
    )
})  # fmt: skip
