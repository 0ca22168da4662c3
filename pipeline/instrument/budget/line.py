"""How well one sample of the laser line can be placed in the image: 1 σ in px of each random source."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Float
from pipeline.instrument.budget.scan import RingScan


@dataclass(frozen=True)
class LinePhotometry:
    """What the line looks like to the sensor.

    Attributes
    ----------
    amplitude_grey, noise_grey : float
        Height of the line; noise of a pixel from reading and quantisation.
    electrons_per_grey : float
    blur_px : float
        1 σ of lens and pixel blur.
    pupil_radius_mm, speckle_contrast : float
        Of the lens; contrast after pixel and exposure have averaged.
    albedo_slope_per_mm : float
        1 σ of the wall's d ln(reflectance) / dz.
    """

    amplitude_grey: float = 120.0
    noise_grey: float = 2.0
    electrons_per_grey: float = 40.0
    blur_px: float = 0.6
    pupil_radius_mm: float = 0.28
    speckle_contrast: float = 0.5
    albedo_slope_per_mm: float = 0.1


def line_sigma_px(scan: RingScan, photometry: LinePhotometry) -> dict[str, Float]:
    """Return 1 σ (A,) in px of the line's position for each random source that depends on the scan.

    Shot noise: width / √(electrons). Image noise: the Cramér–Rao bound of a Gaussian line's position in white
    noise, (σ_n / A) √(2 w / √π). Speckle: C λ / (2π sin u) across the line of sight, u the aperture angle.
    Texture: the centroid of a line of thickness σ_z moves by σ_z² ∂ ln A.
    """
    per_mm = _px_per_axial_mm(scan)
    sigma_z = scan.probe.laser.line_sigma_mm
    width = np.hypot(per_mm * sigma_z, photometry.blur_px)
    electrons = photometry.amplitude_grey * photometry.electrons_per_grey * math.sqrt(2 * math.pi) * width
    noise = photometry.noise_grey / photometry.amplitude_grey
    return {
        "line_width": width / np.sqrt(electrons),
        "image_noise": noise * np.sqrt(2 * width / math.sqrt(math.pi)),
        "speckle": _speckle_px(scan, photometry),
        "albedo_bias": per_mm * sigma_z**2 * photometry.albedo_slope_per_mm,
    }


def _px_per_axial_mm(scan: RingScan) -> Float:
    """Return how far (A,) in px the line moves when the sheet moves by 1 mm along the wall."""
    by_point = scan.probe.camera.project_jacobian(scan.wall_points).by_point
    return np.asarray(np.linalg.norm(by_point[..., 2], axis=-1))


def _speckle_px(scan: RingScan, photometry: LinePhotometry) -> Float:
    xyz = scan.wall_points
    away = np.linalg.norm(xyz, axis=-1)
    across_mm = photometry.speckle_contrast * scan.probe.laser.wavelength_nm * 1e-6
    across_mm = across_mm / (2 * math.pi * photometry.pupil_radius_mm / away)
    # across the line of sight, 1 mm along the wall shows as sin θ mm
    return np.asarray(across_mm / (np.linalg.norm(xyz[:, :2], axis=-1) / away) * _px_per_axial_mm(scan))
