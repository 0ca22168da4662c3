"""Kannala-Brandt camera in OpenCV's fisheye convention.

ρ(θ) = θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸); u = fx ρ cos ψ + cx, v = fy ρ sin ψ + cy.
J. Kannala, S. Brandt, "A generic camera model and calibration method", PAMI 2006.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pipeline.arrays import Float
from pipeline.instrument.camera.inverse import invert_increasing, smallest_positive_root
from pipeline.instrument.camera.radial import Polar, RadialCamera

_NODES = 256


@dataclass(frozen=True)
class KannalaBrandt(RadialCamera):
    """Kannala-Brandt fisheye camera.

    Attributes
    ----------
    image_size : (int, int)
        Width and height, px.
    focal_px, centre : (float, float)
        (fx, fy) and (cx, cy).
    distortion : (float, float, float, float)
        k1..k4.
    """

    image_size: tuple[int, int]
    focal_px: tuple[float, float]
    centre: tuple[float, float]
    distortion: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)

    model = "kannala_brandt"
    parameter_names = ("fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4")

    @property
    def parameters(self) -> Float:
        """(8,) fx, fy, cx, cy, k1..k4."""
        return np.array([*self.focal_px, *self.centre, *self.distortion], float)

    def with_parameters(self, parameters: Float) -> KannalaBrandt:
        """Return the same camera with other parameters (8,)."""
        fx, fy, cx, cy, *k = (float(p) for p in parameters)
        return replace(self, focal_px=(fx, fy), centre=(cx, cy), distortion=(k[0], k[1], k[2], k[3]))

    @cached_property
    def theta_max(self) -> float:
        """Largest polar angle, rad, up to which ρ(θ) grows; at most π."""
        k1, k2, k3, k4 = self.distortion
        squared = smallest_positive_root([1.0, 3 * k1, 5 * k2, 7 * k3, 9 * k4])
        return float(min(np.sqrt(squared), np.pi))

    @cached_property
    def rho_max(self) -> float:
        """ρ(`theta_max`)."""
        return float(self._rho(np.array(self.theta_max)))

    @property
    def affine_matrix(self) -> Float:
        """(2, 2) diagonal of fx and fy."""
        return np.diag(self.focal_px)

    def _rho(self, theta: Float) -> Float:
        k1, k2, k3, k4 = self.distortion
        t2 = theta * theta
        return np.asarray(theta * (1 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4)))))

    def _growth(self, theta: Float) -> Float:
        k1, k2, k3, k4 = self.distortion
        t2 = theta * theta
        return np.asarray(1 + t2 * (3 * k1 + t2 * (5 * k2 + t2 * (7 * k3 + t2 * 9 * k4))))

    def _slope(self, theta: Float, rho: Float) -> Float:
        return self._growth(theta)

    def _theta(self, rho: Float) -> Float:
        return invert_increasing(self._rho, self._growth, rho, np.linspace(0, self.theta_max, _NODES))

    def _by_parameters(self, polar: Polar) -> Float:
        out = np.zeros((*polar.theta.shape, 2, 8))
        m = polar.rho[..., None] * polar.unit
        out[..., 0, 0], out[..., 1, 1] = m[..., 0], m[..., 1]
        out[..., 0, 2], out[..., 1, 3] = 1, 1
        for i in range(4):
            out[..., :, 4 + i] = (
                (polar.theta ** (2 * i + 3))[..., None] * polar.unit * np.array(self.focal_px)
            )
        return np.where(np.isnan(polar.theta)[..., None, None], np.nan, out)
