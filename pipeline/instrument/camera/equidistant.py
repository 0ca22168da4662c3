"""Equidistant fisheye camera: u = fx θ cos ψ + cx, v = fy θ sin ψ + cy; Kannala-Brandt without distortion."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Float
from pipeline.instrument.camera.radial import Polar, RadialCamera


@dataclass(frozen=True)
class Equidistant(RadialCamera):
    """Equidistant fisheye camera.

    Attributes
    ----------
    image_size : (int, int)
        Width and height, px.
    focal_px, centre : (float, float)
        (fx, fy), px/rad, and (cx, cy).
    """

    image_size: tuple[int, int]
    focal_px: tuple[float, float]
    centre: tuple[float, float]

    model = "equidistant"
    parameter_names = ("fx", "fy", "cx", "cy")

    @property
    def parameters(self) -> Float:
        """(4,) fx, fy, cx, cy."""
        return np.array([*self.focal_px, *self.centre], float)

    def with_parameters(self, parameters: Float) -> Equidistant:
        """Return the same camera with other parameters (4,)."""
        fx, fy, cx, cy = (float(p) for p in parameters)
        return replace(self, focal_px=(fx, fy), centre=(cx, cy))

    @property
    def theta_max(self) -> float:
        """π: every direction is mapped."""
        return float(np.pi)

    @property
    def rho_max(self) -> float:
        """π."""
        return float(np.pi)

    @property
    def affine_matrix(self) -> Float:
        """(2, 2) diagonal of fx and fy."""
        return np.diag(self.focal_px)

    def _rho(self, theta: Float) -> Float:
        return theta

    def _theta(self, rho: Float) -> Float:
        return rho

    def _slope(self, theta: Float, rho: Float) -> Float:
        return np.ones_like(theta)

    def _by_parameters(self, polar: Polar) -> Float:
        out = np.zeros((*polar.theta.shape, 2, 4))
        m = polar.rho[..., None] * polar.unit
        out[..., 0, 0], out[..., 1, 1] = m[..., 0], m[..., 1]
        out[..., 0, 2], out[..., 1, 3] = 1, 1
        return np.where(np.isnan(polar.theta)[..., None, None], np.nan, out)
