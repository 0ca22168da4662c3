"""Fisheye cameras whose image radius depends on the polar angle alone: Kannala-Brandt and equidistant.

Equidistant: u = fx θ cos ψ + cx, v = fy θ sin ψ + cy. Kannala-Brandt in OpenCV's fisheye convention:
ρ(θ) = θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸); u = fx ρ cos ψ + cx, v = fy ρ sin ψ + cy.
J. Kannala, S. Brandt, "A generic camera model and calibration method", PAMI 2006.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from pipeline.arrays import Bool, Float
from pipeline.instrument.camera import (
    Projection,
    ProjectionJacobian,
    Rays,
    RaysJacobian,
    invert_increasing,
    rays_jacobian,
    smallest_positive_root,
)

# Sine of the angle below which a point counts as on the axis, where the azimuth has no meaning.
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
        by_angle, around = slope / (polar.r * polar.r + z * z), polar.rho / polar.r
        outward, mixed = z * by_angle, c * s * (z * by_angle - around)
        by_x = c * c * outward + s * s * around, mixed, -c * polar.r * by_angle
        by_y = mixed, s * s * outward + c * c * around, -s * polar.r * by_angle
        by_point = np.empty((*z.shape, 2, 3))
        for i, (a, b) in enumerate(self.affine_matrix.tolist()):
            for k in range(3):
                by_point[..., i, k] = a * by_x[k] + b * by_y[k]
        return ProjectionJacobian(by_point, self._by_parameters(polar))

    def unproject_jacobian(self, uv: Float) -> RaysJacobian:
        """Return d ray / d uv (..., 3, 2) and d ray / d parameters (..., 3, P); NaN where invalid."""
        return rays_jacobian(self.project_jacobian(self.unproject(uv).ray))

    def _polar(self, xyz_c: Float) -> tuple[Polar, Bool]:
        p = np.asarray(xyz_c, float)
        r = np.hypot(p[..., 0], p[..., 1])
        least = _ON_AXIS * np.abs(p[..., 2])
        on_axis = r < least
        r = np.where(on_axis, least, r)
        theta = np.arctan2(r, p[..., 2])
        valid = (theta <= self.theta_max) & (r + np.abs(p[..., 2]) > 0) & np.isfinite(r)
        r, theta = np.where(valid, r, np.nan), np.where(valid, theta, np.nan)
        unit = np.where(on_axis[..., None], np.array([1.0, 0.0]), p[..., :2] / r[..., None])
        return Polar(r, theta, self._rho(theta), unit), valid


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
        out[np.isnan(polar.theta)] = np.nan
        return out


# Nodes of the table that an inversion starts from; Newton's steps do the rest.
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
        power, focal = polar.theta, np.array(self.focal_px)
        for i in range(4):
            power = power * polar.theta * polar.theta
            out[..., :, 4 + i] = power[..., None] * polar.unit * focal
        out[np.isnan(polar.theta)] = np.nan
        return out
