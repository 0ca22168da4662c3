"""What cameras share whose image radius depends on the polar angle alone, up to an affine map."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np

from pipeline.arrays import Bool, Float
from pipeline.instrument.camera.base import Projection, ProjectionJacobian, Rays, RaysJacobian
from pipeline.instrument.camera.inverse import rays_jacobian

_ON_AXIS = 1e-12


class Polar(NamedTuple):
    """Distance ``r`` from the axis, polar angle ``theta``, radius ``rho`` and image direction ``unit``."""

    r: Float
    theta: Float
    rho: Float
    unit: Float


class RadialCamera(ABC):
    """uv = affine · ρ(θ) (cos ψ, sin ψ) + centre, with ρ growing up to ``theta_max``."""

    image_size: tuple[int, int]
    centre: tuple[float, float]

    @property
    @abstractmethod
    def theta_max(self) -> float:
        """Largest polar angle, rad, that the model maps; at most π."""

    @property
    @abstractmethod
    def rho_max(self) -> float:
        """ρ(`theta_max`)."""

    @property
    @abstractmethod
    def affine_matrix(self) -> Float:
        """(2, 2) from (ρ cos ψ, ρ sin ψ) to pixels."""

    @abstractmethod
    def _rho(self, theta: Float) -> Float:
        """ρ of polar angles."""

    @abstractmethod
    def _theta(self, rho: Float) -> Float:
        """Inverse of `_rho`."""

    @abstractmethod
    def _slope(self, theta: Float, rho: Float) -> Float:
        """dρ/dθ where ρ(``theta``) = ``rho``."""

    @abstractmethod
    def _by_parameters(self, polar: Polar) -> Float:
        """(..., 2, P) derivatives of the pixel at a fixed ray."""

    @property
    def centre_px(self) -> Float:
        """(2,) principal point."""
        return np.array(self.centre)

    def project(self, xyz_c: Float) -> Projection:
        """Project (..., 3) points; NaN and invalid beyond `theta_max` or at the viewpoint."""
        polar, valid = self._polar(xyz_c)
        uv = (polar.rho[..., None] * polar.unit) @ self.affine_matrix.T + self.centre_px
        return Projection(uv, valid)

    def unproject(self, uv: Float) -> Rays:
        """Return unit rays of (..., 2) pixels; NaN where no ray maps there."""
        m = (np.asarray(uv, float) - self.centre_px) @ np.linalg.inv(self.affine_matrix).T
        rho = np.hypot(m[..., 0], m[..., 1])
        valid = rho <= self.rho_max
        theta = self._theta(np.where(valid, rho, np.nan))
        unit = m / np.where(rho > 0, rho, 1.0)[..., None]
        return Rays(np.concatenate([unit * np.sin(theta)[..., None], np.cos(theta)[..., None]], -1), valid)

    def project_jacobian(self, xyz_c: Float) -> ProjectionJacobian:
        """Return d uv / d point (..., 2, 3) and d uv / d parameters (..., 2, P); NaN where invalid."""
        polar, valid = self._polar(xyz_c)
        z = np.where(valid, np.asarray(xyz_c, float)[..., 2], np.nan)
        slope = self._slope(polar.theta, polar.rho)
        c, s = polar.unit[..., 0], polar.unit[..., 1]
        by_theta = np.stack([c * z, s * z, -polar.r], -1) * (slope / (polar.r**2 + z**2))[..., None]
        by_psi = np.stack([-s, c, np.zeros_like(c)], -1) * (polar.rho / polar.r)[..., None]
        normal = np.stack([-s, c], -1)
        by_point = polar.unit[..., None] * by_theta[..., None, :] + normal[..., None] * by_psi[..., None, :]
        return ProjectionJacobian(self.affine_matrix @ by_point, self._by_parameters(polar))

    def unproject_jacobian(self, uv: Float) -> RaysJacobian:
        """Return d ray / d uv (..., 3, 2) and d ray / d parameters (..., 3, P); NaN where invalid."""
        return rays_jacobian(self.project_jacobian(self.unproject(uv).ray))

    def _polar(self, xyz_c: Float) -> tuple[Polar, Bool]:
        p = np.asarray(xyz_c, float)
        r = np.hypot(p[..., 0], p[..., 1])
        on_axis = r < _ON_AXIS * np.abs(p[..., 2])
        theta = np.arctan2(r, p[..., 2])
        valid = (theta <= self.theta_max) & (r + np.abs(p[..., 2]) > 0) & np.isfinite(r)
        r = np.where(valid, np.where(on_axis, _ON_AXIS * np.abs(p[..., 2]), r), np.nan)
        theta = np.arctan2(r, np.where(valid, p[..., 2], np.nan))
        unit = np.where(on_axis[..., None], np.array([1.0, 0.0]), p[..., :2] / r[..., None])
        return Polar(r, theta, self._rho(theta), unit), valid
