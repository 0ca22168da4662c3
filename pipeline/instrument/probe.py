"""The probe: camera, laser sheet, shutter, lighting, and the covariance of their parameters."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Float
from pipeline.artefacts.measured import Trajectory
from pipeline.artefacts.motion import LaserKnock
from pipeline.instrument.camera import Camera
from pipeline.instrument.laser import LaserSheet


@dataclass(frozen=True)
class Shutter:
    """Shutter ``kind`` (``global`` or ``rolling``), exposure and, when rolling, readout time, in s."""

    kind: str = "global"
    exposure_s: float = 0.0015
    readout_s: float = 0.0


@dataclass(frozen=True)
class Lighting:
    """A ring of ``leds`` LEDs of radius ``radius_mm`` in the plane z = ``z_mm`` of C, facing forward."""

    kind: str = "led_ring"
    leds: int = 8
    radius_mm: float = 11.0
    z_mm: float = -1.0


@dataclass(frozen=True)
class ImuMount:
    """The mounting of the inertial measurement unit on the camera, and its errors.

    The defaults are those of consumer chips of 2015 to 2025 (MPU-6050, BMI160, ICM-20948; their data sheets
    state 0.005 to 0.015 °/s/√Hz and 100 to 400 µg/√Hz). Names and units are Kalibr's.

    Attributes
    ----------
    R_ci : (3, 3)
        Rotates directions in I (IMU) to C (camera).
    gyroscope_noise_density : float
        rad/s/√Hz.
    gyroscope_random_walk : float
        Of its bias, rad/s²/√Hz.
    accelerometer_noise_density : float
        m/s²/√Hz.
    accelerometer_bias : float
        1 σ, m/s², of the constant part of its bias.
    """

    R_ci: Float
    gyroscope_noise_density: float = 2e-4
    gyroscope_random_walk: float = 2e-5
    accelerometer_noise_density: float = 3e-3
    accelerometer_bias: float = 0.2


@dataclass(frozen=True)
class Probe:
    """The assumed parameters of the instrument, stated or calibrated, and their uncertainty.

    Attributes
    ----------
    camera, laser, shutter, lighting
    covariance : (P, P)
        Of `parameter_names`: the camera's parameters followed by the laser's.
    encoder_scale_sigma : float
        Relative 1 σ of the encoder's scale.
    calibrated_from : str
        Name of the gauge run, empty when the numbers are merely stated.
    imu : ImuMount or None
    """

    camera: Camera
    laser: LaserSheet
    covariance: Float
    shutter: Shutter = Shutter()
    lighting: Lighting = Lighting()
    encoder_scale_sigma: float = 0.002
    calibrated_from: str = ""
    imu: ImuMount | None = None

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of all P parameters: camera, then laser."""
        return (*self.camera.parameter_names, *LaserSheet.PARAMETER_NAMES)

    @property
    def parameters(self) -> Float:
        """(P,) values of `parameter_names`."""
        return np.concatenate([self.camera.parameters, self.laser.parameters])

    def with_parameters(self, parameters: Float, covariance: Float) -> Probe:
        """Return the probe with other parameters (P,) and their covariance (P, P)."""
        split = len(self.camera.parameter_names)
        camera = self.camera.with_parameters(parameters[:split])
        laser = self.laser.with_parameters(parameters[split:])
        return replace(self, camera=camera, laser=laser, covariance=covariance)

    def as_found_in(self, trajectory: Trajectory) -> Probe:
        """Return the probe with the parameters that the motion estimate of a run gives it."""
        if trajectory.instrument is None or trajectory.instrument_covariance is None:
            return self
        return self.with_parameters(trajectory.instrument, trajectory.instrument_covariance)

    def after(self, knock: LaserKnock) -> Probe:
        """Return the probe after a knock of its laser, with the covariance of the knock added."""
        first, count = len(self.camera.parameter_names), len(knock.change)
        parameters, covariance = self.parameters, self.covariance.copy()
        parameters[first : first + count] += knock.change
        covariance[first : first + count, first : first + count] += knock.covariance
        return self.with_parameters(parameters, covariance)

    def principal_uncertainties(self) -> Float:
        """Return (P, Q) the independent directions of the covariance, each 1 σ long, largest first.

        The covariance is scaled to correlations before its decomposition, so that no direction is lost
        because of its unit.
        """
        sigma = np.sqrt(np.diagonal(self.covariance))
        scale = np.where(sigma > 0, sigma, 1.0)
        value, vector = np.linalg.eigh(self.covariance / np.outer(scale, scale))
        keep = value > 1e-9
        return np.asarray(scale[:, None] * vector[:, keep] * np.sqrt(value[keep]))[:, ::-1]

    def triangulate(self, uv: Float) -> Float:
        """Return the wall points (..., 3), mm in C, of laser-line pixels (..., 2); NaN where impossible."""
        return self.laser.intersect(self.camera.unproject(uv).ray)

    def triangulate_jacobian(self, uv: Float) -> tuple[Float, Float]:
        """Return derivatives of `triangulate`: by pixel (..., 3, 2), by parameters (..., 3, P)."""
        ray = self.camera.unproject(uv).ray
        by_ray, by_laser = self.laser.intersect_jacobian(ray)
        rays = self.camera.unproject_jacobian(uv)
        return by_ray @ rays.by_pixel, np.concatenate([by_ray @ rays.by_parameters, by_laser], -1)
