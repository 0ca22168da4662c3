"""One ring in a known pipe, and the exact chain from a disturbed instrument to the radius it reports."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property

import numpy as np

from pipeline.arrays import Float
from pipeline.errors import InputError
from pipeline.instrument.budget.disturbance import Disturbance, observe, observe_jacobian
from pipeline.instrument.camera.base import Camera
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
        The instrument as believed; at zero disturbance also as it is.
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
        """(A, 3) points in C where the believed sheet meets the wall."""
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
        What is believed.
    by_parameters : (P,)
        True minus believed parameters of the probe.
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

    The believed instrument is held: of the wall point the true one makes, it moves by minus the derivative
    of its own triangulation.
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
    """Return what a fitted circle's centre leaves of small radius errors (A, ...)."""
    design = np.concatenate([scan.normals, np.ones((scan.azimuths, 1))], -1)
    flat = error_mm.reshape(scan.azimuths, -1)
    shift = np.linalg.lstsq(design, flat, rcond=None)[0][:2]
    return np.asarray((flat - scan.normals @ shift).reshape(error_mm.shape))


def radius_covariance(scan: RingScan) -> Float:
    """Return the (A, A) covariance of the radius from the probe's uncertainty, mm², pose known."""
    jacobian = radius_jacobian(scan)
    return np.asarray(jacobian @ scan.probe.covariance @ jacobian.T)


def at_baseline(scan: RingScan, baseline_mm: float) -> RingScan:
    """Return the same scan with another baseline."""
    laser = replace(scan.probe.laser, baseline_mm=baseline_mm)
    return replace(scan, probe=replace(scan.probe, laser=laser))


def _true_instrument(probe: Probe, by_parameters: Float) -> tuple[Camera, LaserSheet]:
    split = len(probe.camera.parameter_names)
    camera = probe.camera.with_parameters(probe.camera.parameters + by_parameters[:split])
    return camera, probe.laser.with_parameters(probe.laser.parameters + by_parameters[split:])
