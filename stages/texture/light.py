"""How brightly the probe's lights show the wall: LED ring, smooth correction over the image, frame gains."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import map_coordinates

from pipeline.artefacts import Float
from pipeline.instrument.probe import Lighting


def irradiance(lighting: Lighting, xyz_c: Float, normal_c: Float) -> Float:
    """Return the irradiance (...), 1/mm², of wall points (..., 3) with unit normals, lit by unit LEDs.

    Each LED is a Lambert source facing forward: cos(at LED) cos(at wall) / distance²; mean over the LEDs.
    The wall is Lambertian, so this is also what the camera sees up to a factor.
    """
    total = np.zeros(xyz_c.shape[:-1])
    for turn in 2 * np.pi * np.arange(lighting.leds) / lighting.leds:
        x, y = lighting.radius_mm * np.cos(turn), lighting.radius_mm * np.sin(turn)
        ray = xyz_c - np.array([x, y, lighting.z_mm])
        square = np.sum(ray * ray, -1)
        at_wall = np.maximum(-np.sum(ray * normal_c, -1), 0)
        total += np.maximum(ray[..., 2], 0) * at_wall / (square * square)
    return np.asarray(total / lighting.leds)


@dataclass(frozen=True)
class LightField:
    """Brightness of a white wall in the image.

    Attributes
    ----------
    lighting : Lighting
    theta_from, theta_step : float
        Polar angles, rad, of the correction's rows.
    log_correction : (T, P)
        Of the irradiance, over polar angle and image azimuth (columns uniform from −π).
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
