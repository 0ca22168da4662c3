"""Model of the wall's illumination by the probe: LED ring, smooth correction over the image, frame gains."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.ndimage import map_coordinates

from pipeline.arrays import Float
from pipeline.instrument.probe import Lighting

# Places with less than this share of the reference light are not used: a grey level or two (chosen).
LEAST_LIGHT = 0.01


def irradiance(lighting: Lighting, xyz_c: Float, normal_c: Float) -> Float:
    """Return the irradiance (...), 1/mm², of wall points (..., 3) with unit normals, lit by unit LEDs.

    Each LED is a Lambert source facing forward: cos(at LED) cos(at wall) / distance²; mean over the LEDs.
    The wall is Lambertian, so this is also the brightness in the picture up to a factor.
    """
    turn = 2 * np.pi * np.arange(lighting.leds) / lighting.leds
    led_xy = lighting.radius_mm * np.stack([np.cos(turn), np.sin(turn)], -1)
    normal = np.broadcast_to(normal_c, xyz_c.shape).reshape(-1, 3)
    light = _lit_by(led_xy, lighting.z_mm, xyz_c.reshape(-1, 3), normal)
    return np.asarray(light.reshape(xyz_c.shape[:-1]))


@njit(cache=True, nogil=True, error_model="numpy")
def _lit_by(led_xy, led_z, xyz, normal):  # type: ignore[no-untyped-def]
    """Return the mean irradiance (N,) of points (N, 3) by LEDs at ``led_xy`` (L, 2) in one plane."""
    out = np.empty(len(xyz))
    for k in range(len(xyz)):
        total, dz = 0.0, xyz[k, 2] - led_z
        for j in range(len(led_xy)):
            dx, dy = xyz[k, 0] - led_xy[j, 0], xyz[k, 1] - led_xy[j, 1]
            square = dx * dx + dy * dy + dz * dz
            at_wall = -(dx * normal[k, 0] + dy * normal[k, 1] + dz * normal[k, 2])
            total += max(dz, 0.0) * max(at_wall, 0.0) / (square * square)
        out[k] = total / len(led_xy)
    return out


@dataclass(frozen=True)
class LightField:
    """Brightness of a white wall in the image.

    Attributes
    ----------
    lighting : Lighting
    theta_from, theta_step : float
        Polar angles, rad, of the correction's rows.
    log_correction : (T, P)
        Log correction of the irradiance over polar angle and image azimuth (columns uniform from −π).
    reference : float
        Irradiance that counts as 1.
    """

    lighting: Lighting
    theta_from: float
    theta_step: float
    log_correction: Float
    reference: float

    def brightness(self, xyz_c: Float, normal_c: Float) -> Float:
        """Return the relative brightness (...) of white wall, points and normals (..., 3) in C."""
        row, column = self.indices(xyz_c)
        log = map_coordinates(self.log_correction, [row, column], order=1, mode="grid-wrap")
        return np.asarray(irradiance(self.lighting, xyz_c, normal_c) / self.reference * np.exp(log))

    def indices(self, xyz_c: Float) -> tuple[Float, Float]:
        """Return fractional rows and columns of the correction for points (..., 3) in C."""
        theta = np.arctan2(np.hypot(xyz_c[..., 0], xyz_c[..., 1]), xyz_c[..., 2])
        azimuth = np.arctan2(xyz_c[..., 1], xyz_c[..., 0])
        rows, columns = self.log_correction.shape
        row = np.clip((theta - self.theta_from) / self.theta_step, 0, rows - 1)
        return row, np.mod((azimuth + np.pi) / (2 * np.pi), 1.0) * columns
