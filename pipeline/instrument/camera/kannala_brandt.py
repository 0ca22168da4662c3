"""Kannala-Brandt camera in OpenCV's fisheye convention.

ρ(θ) = θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸); u = fx ρ cos ψ + cx, v = fy ρ sin ψ + cy.
J. Kannala, S. Brandt, "A generic camera model and calibration method", PAMI 2006.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pipeline.instrument.camera.base import Projection, ProjectionJacobian, Rays, RaysJacobian

Float = NDArray[np.float64]


@dataclass(frozen=True)
class KannalaBrandt:
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
    def centre_px(self) -> Float:
        """(2,) principal point."""
        return np.array(self.centre)

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
        theta = np.linspace(0, np.pi, 2000)
        falling = np.flatnonzero(self._slope(theta) <= 0)
        return float(theta[falling[0] - 1] if falling.size else np.pi)

    def _rho(self, theta: Float) -> Float:
        k1, k2, k3, k4 = self.distortion
        t2 = theta * theta
        return np.asarray(theta * (1 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4)))))

    def _slope(self, theta: Float) -> Float:
        k1, k2, k3, k4 = self.distortion
        t2 = theta * theta
        return np.asarray(1 + t2 * (3 * k1 + t2 * (5 * k2 + t2 * (7 * k3 + t2 * 9 * k4))))

    def _theta(self, rho: Float) -> Float:
        """Invert ρ(θ) by Newton steps kept inside [0, theta_max]."""
        theta = np.minimum(rho, self.theta_max)
        for _ in range(30):
            step = (self._rho(theta) - rho) / np.maximum(self._slope(theta), 1e-6)
            theta = np.clip(theta - step, 0, self.theta_max)
            if not np.any(np.abs(step) > 1e-14):
                break
        return np.asarray(theta)

    def project(self, xyz_c: Float) -> Projection:
        """Project (..., 3) points; NaN and invalid beyond `theta_max` or at the viewpoint."""
        p = np.asarray(xyz_c, float)
        r = np.hypot(p[..., 0], p[..., 1])
        theta = np.arctan2(r, p[..., 2])
        valid = (theta <= self.theta_max) & (r + np.abs(p[..., 2]) > 0) & np.isfinite(theta)
        rho = self._rho(theta)
        scale = np.where(r > 0, rho / np.where(r > 0, r, 1.0), 0.0)
        uv = p[..., :2] * scale[..., None] * np.array(self.focal_px) + self.centre_px
        return Projection(np.where(valid[..., None], uv, np.nan), valid)

    def unproject(self, uv: Float) -> Rays:
        """Return unit rays of (..., 2) pixels; NaN where no ray maps there."""
        m = (np.asarray(uv, float) - self.centre_px) / np.array(self.focal_px)
        rho = np.hypot(m[..., 0], m[..., 1])
        valid = rho <= self._rho(np.array(self.theta_max))
        theta = self._theta(np.where(valid, rho, 0.0))
        unit = m / np.where(rho > 0, rho, 1.0)[..., None]
        ray = np.concatenate([unit * np.sin(theta)[..., None], np.cos(theta)[..., None]], -1)
        return Rays(np.where(valid[..., None], ray, np.nan), valid)

    def project_jacobian(self, xyz_c: Float) -> ProjectionJacobian:
        """Return d uv / d point (..., 2, 3) and d uv / d parameters (..., 2, 8)."""
        p = np.asarray(xyz_c, float)
        x, y, z = p[..., 0], p[..., 1], p[..., 2]
        r = np.maximum(np.hypot(x, y), 1e-12)
        theta = np.arctan2(r, z)
        c, s = x / r, y / r
        n2 = r * r + z * z
        g = self._slope(theta)
        rho = self._rho(theta)
        radial = np.stack([c * z / n2, s * z / n2, -r / n2], -1) * g[..., None]
        tangential = np.stack([-s, c, np.zeros_like(c)], -1) * (rho / r)[..., None]
        f = np.array(self.focal_px)
        unit, normal = np.stack([c, s], -1), np.stack([-s, c], -1)
        by_point = (unit[..., None] * radial[..., None, :] + normal[..., None] * tangential[..., None, :]) * f[
            :, None
        ]
        return ProjectionJacobian(by_point, self._by_parameters(theta, unit))

    def _by_parameters(self, theta: Float, unit: Float) -> Float:
        out = np.zeros((*theta.shape, 2, 8))
        rho = self._rho(theta)
        out[..., 0, 0], out[..., 1, 1] = rho * unit[..., 0], rho * unit[..., 1]
        out[..., 0, 2], out[..., 1, 3] = 1, 1
        for i in range(4):
            out[..., :, 4 + i] = (theta ** (2 * i + 3))[..., None] * unit * np.array(self.focal_px)
        return out

    def unproject_jacobian(self, uv: Float) -> RaysJacobian:
        """Return d ray / d uv (..., 3, 2) and d ray / d parameters (..., 3, 8).

        By the implicit function theorem: on unit rays, d ray/d uv is the inverse of d uv/d ray in the
        tangent plane, and d ray/d parameters = −(d ray/d uv)(d uv/d parameters).
        """
        m = (np.asarray(uv, float) - self.centre_px) / np.array(self.focal_px)
        rho = np.maximum(np.hypot(m[..., 0], m[..., 1]), 1e-12)
        theta = self._theta(rho)
        unit = m / rho[..., None]
        normal = np.stack([-unit[..., 1], unit[..., 0]], -1)
        sin, cos = np.sin(theta)[..., None], np.cos(theta)[..., None]
        e_theta = np.concatenate([unit * cos, -sin], -1) / self._slope(theta)[..., None]
        e_psi = np.concatenate([normal * sin, np.zeros_like(sin)], -1) / rho[..., None]
        by_m = e_theta[..., None] * unit[..., None, :] + e_psi[..., None] * normal[..., None, :]
        by_pixel = by_m / np.array(self.focal_px)
        return RaysJacobian(by_pixel, -by_pixel @ self._by_parameters(theta, unit))
