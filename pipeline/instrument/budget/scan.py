"""One ring in a known pipe: the exact chain from a disturbed instrument to the radius; the line's noise."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property

import numpy as np

from pipeline.arrays import Float
from pipeline.errors import InputError
from pipeline.instrument.budget.sources import Disturbance, observe, observe_jacobian
from pipeline.instrument.camera import Camera
from pipeline.instrument.laser import LaserSheet
from pipeline.instrument.misalignment import fit_circle, in_image, sheet_on_wall
from pipeline.instrument.probe import Probe


class Pose(StrEnum):
    """How the pipe's axis is known: from elsewhere, or as the centre of a circle fitted to the ring."""

    KNOWN = "known"
    FITTED = "fitted"


@dataclass(frozen=True)
class RingScan:
    """A ring in a straight round pipe parallel to the probe.

    Attributes
    ----------
    probe : Probe
        The stated instrument; at zero disturbance also the true one.
    diameter_mm : float
    offset_mm : (float, float)
        Probe minus pipe axis in the section, along x and y of C.
    azimuths : int
        Samples around the ring, uniform in azimuth in C.

    Raises
    ------
    InputError
        If the diameter is not positive, the probe is outside the pipe, or part of the ring is out of sight.
    """

    probe: Probe
    diameter_mm: float
    offset_mm: tuple[float, float] = (0.0, 0.0)
    azimuths: int = 72

    def __post_init__(self) -> None:
        if not (math.isfinite(self.diameter_mm) and self.diameter_mm > 0):
            raise InputError(
                "error budget", f"{self.diameter_mm} is out of range",
                place="diameter_mm", expected="a diameter above 0 mm",
            )  # fmt: skip
        if not math.hypot(*self.offset_mm) < self.radius_mm:
            raise InputError(
                "error budget", "the probe is outside the pipe",
                place="offset_mm", expected="an offset below the pipe's radius",
            )  # fmt: skip
        seen = np.isfinite(in_image(self.probe.camera, self.pixels)).all(-1)
        if not seen.all():
            raise InputError(
                "error budget", f"the camera sees {seen.mean():.0%} of the ring", place="diameter_mm",
                expected="the whole ring", hint="take a smaller diameter or a longer baseline",
            )  # fmt: skip

    @property
    def radius_mm(self) -> float:
        """Radius of the pipe."""
        return self.diameter_mm / 2

    @cached_property
    def azimuth_rad(self) -> Float:
        """(A,) azimuths in C."""
        return -np.pi + 2 * np.pi * np.arange(self.azimuths) / self.azimuths

    @cached_property
    def wall_points(self) -> Float:
        """(A, 3) points in C where the stated sheet meets the wall."""
        return sheet_on_wall(self.probe.laser, self.radius_mm, np.array(self.offset_mm), self.azimuth_rad)

    @cached_property
    def pixels(self) -> Float:
        """(A, 2) pixels of the undisturbed ring."""
        return np.asarray(self.probe.camera.project(self.wall_points).uv)

    @cached_property
    def normals(self) -> Float:
        """(A, 2) unit vectors from the pipe's axis to the wall points."""
        return np.asarray((self.wall_points[:, :2] + np.array(self.offset_mm)) / self.radius_mm)

    @cached_property
    def line_normals(self) -> Float:
        """(A, 2) directions in the image across the line: away from the principal point."""
        away = self.pixels - self.probe.camera.centre_px
        return np.asarray(away / np.linalg.norm(away, axis=-1, keepdims=True))


def radius_error(
    scan: RingScan, by_parameters: Float, disturbance: Disturbance, shift_px: Float | float = 0.0
) -> Float:
    """Return triangulated minus true radius (2, A), exactly, with the pose known and fitted.

    Parameters
    ----------
    scan
        The scan, with the instrument that is assumed.
    by_parameters : (P,)
        True minus assumed parameters of the probe.
    disturbance
        Effects the probe's parameters do not describe.
    shift_px : (A,)
        Displacement of the line in the image, outward.
    """
    camera, laser = _true_instrument(scan.probe, by_parameters)
    offset = np.array(scan.offset_mm)
    on_wall = sheet_on_wall(laser, scan.radius_mm, offset, scan.azimuth_rad)
    uv = observe(camera, on_wall, disturbance)
    uv = uv + np.asarray(shift_px)[..., None] * scan.line_normals
    xy = scan.probe.triangulate(uv)[:, :2] + offset
    known = np.linalg.norm(xy, axis=-1) - scan.radius_mm
    fitted = np.linalg.norm(xy - fit_circle(xy)[0], axis=-1) - scan.radius_mm
    return np.stack([known, fitted])


def radius_jacobian(scan: RingScan) -> Float:
    """Return d (triangulated radius) / d (true parameters) (A, P), pose known: −n · d X/d parameters.

    The assumed instrument triangulates with fixed parameters. Changes of the true parameters move the pixel
    of a wall point. If true and assumed parameters changed equally, the point would stay, hence the minus
    sign.
    """
    by_parameters = scan.probe.triangulate_jacobian(scan.pixels)[1]
    return -np.asarray(np.einsum("ni,nip->np", scan.normals, by_parameters[:, :2]))


def radius_by_pixel(scan: RingScan) -> Float:
    """Return d radius / d pixel (A, 2), mm per px, pose known."""
    by_pixel = scan.probe.triangulate_jacobian(scan.pixels)[0]
    return np.asarray(np.einsum("ni,nip->np", scan.normals, by_pixel[:, :2]))


def disturbance_jacobian(scan: RingScan) -> Float:
    """Return d radius / d disturbance (A, E), pose known, in the order of `Disturbance`'s fields."""
    by_disturbance = observe_jacobian(scan.probe.camera, scan.wall_points)
    return np.asarray(np.einsum("ni,nie->ne", radius_by_pixel(scan), by_disturbance))


def without_centre(scan: RingScan, error_mm: Float) -> Float:
    """Return small radius errors (A, ...) without the part that the centre of a fitted circle absorbs."""
    design = np.concatenate([scan.normals, np.ones((scan.azimuths, 1))], -1)
    flat = error_mm.reshape(scan.azimuths, -1)
    shift = np.linalg.lstsq(design, flat, rcond=None)[0][:2]
    return np.asarray((flat - scan.normals @ shift).reshape(error_mm.shape))


def at_baseline(scan: RingScan, baseline_mm: float) -> RingScan:
    """Return the same scan with another baseline."""
    laser = replace(scan.probe.laser, baseline_mm=baseline_mm)
    return replace(scan, probe=replace(scan.probe, laser=laser))


def _true_instrument(probe: Probe, by_parameters: Float) -> tuple[Camera, LaserSheet]:
    split = len(probe.camera.parameter_names)
    camera = probe.camera.with_parameters(probe.camera.parameters + by_parameters[:split])
    return camera, probe.laser.with_parameters(probe.laser.parameters + by_parameters[split:])


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
    """Return the displacement (A,), px, of the line when the sheet moves by 1 mm along the wall."""
    by_point = scan.probe.camera.project_jacobian(scan.wall_points).by_point
    return np.asarray(np.linalg.norm(by_point[..., 2], axis=-1))


def _speckle_px(scan: RingScan, photometry: LinePhotometry) -> Float:
    xyz = scan.wall_points
    away = np.linalg.norm(xyz, axis=-1)
    across_mm = photometry.speckle_contrast * scan.probe.laser.wavelength_nm * 1e-6
    across_mm = across_mm / (2 * math.pi * photometry.pupil_radius_mm / away)
    # across the line of sight, 1 mm along the wall shows as sin θ mm
    return np.asarray(across_mm / (np.linalg.norm(xyz[:, :2], axis=-1) / away) * _px_per_axial_mm(scan))
