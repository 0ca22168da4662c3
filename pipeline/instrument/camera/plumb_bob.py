"""Cameras with plumb-bob distortion on a plane: pinhole, and the unified camera of Mei and Rives.

m = (x, y) / (z + ξ |p|); m' = m (1 + k1 r² + k2 r⁴ + k3 r⁶) + tangential(p1, p2); uv = f m' + centre.
C. Mei, P. Rives, "Single view point omnidirectional camera calibration from planar grids", ICRA 2007;
distortion of D. C. Brown, "Close-range camera calibration", 1971, in OpenCV's order. A pinhole has ξ = 0.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property

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

# Nodes of the table that an inversion starts from; Newton's steps do the rest.
_NODES = 256
# Radius on the image plane up to which a model without distortion is used: 89.94° off the axis.
_FARTHEST = 1e3
# Newton's method converges quadratically from the radial solution; 12 steps reach rounding.
_NEWTON_STEPS = 12
# Largest relative error of an inversion that counts as converged.
_CLOSED = 1e-9


class PlumbBobCamera(ABC):
    """A camera with distortion on a plane; its full parameters are ξ, fx, fy, cx, cy, k1, k2, p1, p2, k3."""

    image_size: tuple[int, int]
    focal_px: tuple[float, float]
    centre: tuple[float, float]

    @property
    @abstractmethod
    def _mirror(self) -> float:
        """ξ; 0 for a pinhole."""

    @property
    @abstractmethod
    def _coefficients(self) -> tuple[float, float, float, float, float]:
        """k1, k2, p1, p2, k3."""

    @property
    @abstractmethod
    def _columns(self) -> slice:
        """Which of the ten full parameters the model has."""

    @property
    def centre_px(self) -> Float:
        """(2,) principal point."""
        return np.array(self.centre)

    @cached_property
    def plane_radius_max(self) -> float:
        """Radius on the plane up to which the radial distortion grows."""
        k1, k2, _, _, k3 = self._coefficients
        turning = smallest_positive_root([1.0, 3 * k1, 5 * k2, 7 * k3])
        return float(min(np.sqrt(turning), _FARTHEST))

    def project(self, xyz_c: Float) -> Projection:
        """Project (..., 3) points; NaN and invalid behind the model's horizon or past its distortion."""
        m, valid = self._plane(np.asarray(xyz_c, float))
        return Projection(self._distort(m) * np.array(self.focal_px) + self.centre_px, valid)

    def unproject(self, uv: Float) -> Rays:
        """Return unit rays of (..., 2) pixels; NaN where no ray maps there."""
        m, valid = self._undistort((np.asarray(uv, float) - self.centre_px) / np.array(self.focal_px))
        xi, r2 = self._mirror, np.sum(m * m, -1)
        discriminant = 1 + (1 - xi * xi) * r2
        valid = valid & (discriminant >= 0)
        depth = (xi + np.sqrt(np.where(valid, discriminant, np.nan))) / (1 + r2)
        return Rays(np.concatenate([m * depth[..., None], (depth - xi)[..., None]], -1), valid)

    def project_jacobian(self, xyz_c: Float) -> ProjectionJacobian:
        """Return d uv / d point (..., 2, 3) and d uv / d parameters (..., 2, P); NaN where invalid."""
        p, xi = np.asarray(xyz_c, float), self._mirror
        m, valid = self._plane(p)
        p = np.where(valid[..., None], p, np.nan)
        length = np.linalg.norm(p, axis=-1)
        depth = p[..., 2] + xi * length
        by_depth = xi * p / length[..., None] + np.array([0.0, 0.0, 1.0])
        plane_by_point = (np.eye(2, 3) - m[..., None] * by_depth[..., None, :]) / depth[..., None, None]
        plane_by_xi = -m * (length / depth)[..., None]
        pixel_by_plane = np.array(self.focal_px)[:, None] * self._distort_jacobian(m)
        by_xi = np.einsum("...ij,...j->...i", pixel_by_plane, plane_by_xi)
        return ProjectionJacobian(pixel_by_plane @ plane_by_point, self._by_parameters(m, by_xi))

    def unproject_jacobian(self, uv: Float) -> RaysJacobian:
        """Return d ray / d uv (..., 3, 2) and d ray / d parameters (..., 3, P); NaN where invalid."""
        return rays_jacobian(self.project_jacobian(self.unproject(uv).ray))

    def _plane(self, p: Float) -> tuple[Float, Bool]:
        """Return plane points (..., 2); NaN behind the horizon, past which two rays would share a point."""
        xi, length = self._mirror, np.linalg.norm(p, axis=-1)
        horizon = -xi if xi <= 1 else -1 / xi
        with np.errstate(divide="ignore", invalid="ignore"):
            m = p[..., :2] / (p[..., 2] + xi * length)[..., None]
            ahead = (p[..., 2] > horizon * length) & np.isfinite(length)
            valid = ahead & (np.hypot(m[..., 0], m[..., 1]) <= self.plane_radius_max)
        return np.where(valid[..., None], m, np.nan), valid

    def _radial(self, r: Float) -> Float:
        k1, k2, _, _, k3 = self._coefficients
        r2 = r * r
        return np.asarray(r * (1 + r2 * (k1 + r2 * (k2 + r2 * k3))))

    def _radial_slope(self, r: Float) -> Float:
        k1, k2, _, _, k3 = self._coefficients
        r2 = r * r
        return np.asarray(1 + r2 * (3 * k1 + r2 * (5 * k2 + r2 * 7 * k3)))

    def _distort(self, m: Float) -> Float:
        k1, k2, p1, p2, k3 = self._coefficients
        x, y = m[..., 0], m[..., 1]
        r2 = x * x + y * y
        growth = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        tangential = [2 * p1 * x * y + p2 * (r2 + 2 * x * x), p1 * (r2 + 2 * y * y) + 2 * p2 * x * y]
        return np.asarray(m * growth[..., None] + np.stack(tangential, -1))

    def _distort_jacobian(self, m: Float) -> Float:
        k1, k2, p1, p2, k3 = self._coefficients
        x, y = m[..., 0], m[..., 1]
        r2 = x * x + y * y
        growth = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        twice_slope = 2 * (k1 + r2 * (2 * k2 + r2 * 3 * k3))
        cross = x * y * twice_slope + 2 * p1 * x + 2 * p2 * y
        xx = growth + x * x * twice_slope + 2 * p1 * y + 6 * p2 * x
        yy = growth + y * y * twice_slope + 6 * p1 * y + 2 * p2 * x
        return np.stack([np.stack([xx, cross], -1), np.stack([cross, yy], -1)], -2)

    def _undistort(self, distorted: Float) -> tuple[Float, Bool]:
        """Invert the distortion: the radial part by itself, then Newton steps with the tangential one."""
        radius = np.hypot(distorted[..., 0], distorted[..., 1])
        nodes = np.tan(np.linspace(0, np.arctan(self.plane_radius_max), _NODES))
        straight = invert_increasing(self._radial, self._radial_slope, radius, nodes)
        m = distorted * (straight / np.where(radius > 0, radius, 1.0))[..., None]
        for _ in range(_NEWTON_STEPS):
            jacobian = self._distort_jacobian(m)
            a, b, d = jacobian[..., 0, 0], jacobian[..., 0, 1], jacobian[..., 1, 1]
            e = self._distort(m) - distorted
            with np.errstate(divide="ignore", invalid="ignore"):
                step = np.stack([d * e[..., 0] - b * e[..., 1], a * e[..., 1] - b * e[..., 0]], -1)
                m = m - step / (a * d - b * b)[..., None]
        error = np.abs(self._distort(m) - distorted).max(-1)
        inside = np.hypot(m[..., 0], m[..., 1]) <= self.plane_radius_max * (1 + _CLOSED)
        valid = (error <= _CLOSED * (1 + radius)) & inside
        return np.where(valid[..., None], m, np.nan), valid

    def _by_parameters(self, m: Float, by_xi: Float) -> Float:
        x, y = m[..., 0], m[..., 1]
        r2 = x * x + y * y
        fx, fy = self.focal_px
        out = np.zeros((*x.shape, 2, 10))
        out[..., :, 0] = by_xi
        out[..., 0, 1], out[..., 1, 2] = np.moveaxis(self._distort(m), -1, 0)
        out[..., 0, 3], out[..., 1, 4] = 1, 1
        for column, power in ((5, r2), (6, r2**2), (9, r2**3)):
            out[..., :, column] = m * power[..., None] * np.array(self.focal_px)
        out[..., 0, 7], out[..., 1, 7] = fx * 2 * x * y, fy * (r2 + 2 * y * y)
        out[..., 0, 8], out[..., 1, 8] = fx * (r2 + 2 * x * x), fy * 2 * x * y
        return np.where(np.isnan(x)[..., None, None], np.nan, out)[..., self._columns]


@dataclass(frozen=True)
class Pinhole(PlumbBobCamera):
    """Pinhole camera.

    Attributes
    ----------
    image_size : (int, int)
        Width and height, px.
    focal_px, centre : (float, float)
        (fx, fy) and (cx, cy).
    distortion : (float, float, float, float, float)
        k1, k2, p1, p2, k3.
    """

    image_size: tuple[int, int]
    focal_px: tuple[float, float]
    centre: tuple[float, float]
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)

    model = "pinhole"
    parameter_names = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")

    @property
    def parameters(self) -> Float:
        """(9,) fx, fy, cx, cy, k1, k2, p1, p2, k3."""
        return np.array([*self.focal_px, *self.centre, *self.distortion], float)

    def with_parameters(self, parameters: Float) -> Pinhole:
        """Return the same camera with other parameters (9,)."""
        fx, fy, cx, cy, k1, k2, p1, p2, k3 = (float(p) for p in parameters)
        return replace(self, focal_px=(fx, fy), centre=(cx, cy), distortion=(k1, k2, p1, p2, k3))

    @property
    def _mirror(self) -> float:
        return 0.0

    @property
    def _coefficients(self) -> tuple[float, float, float, float, float]:
        return self.distortion

    @property
    def _columns(self) -> slice:
        return slice(1, 10)


@dataclass(frozen=True)
class Unified(PlumbBobCamera):
    """Unified camera of Mei and Rives (Kalibr's omni-radtan, camodocal's MEI).

    Attributes
    ----------
    image_size : (int, int)
        Width and height, px.
    xi : float
        Mirror parameter ξ ≥ 0.
    focal_px, centre : (float, float)
        Generalised focal lengths (γ1, γ2) and principal point.
    distortion : (float, float, float, float)
        k1, k2, p1, p2.
    """

    image_size: tuple[int, int]
    xi: float
    focal_px: tuple[float, float]
    centre: tuple[float, float]
    distortion: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)

    model = "unified"
    parameter_names = ("xi", "fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2")

    @property
    def parameters(self) -> Float:
        """(9,) xi, fx, fy, cx, cy, k1, k2, p1, p2."""
        return np.array([self.xi, *self.focal_px, *self.centre, *self.distortion], float)

    def with_parameters(self, parameters: Float) -> Unified:
        """Return the same camera with other parameters (9,)."""
        xi, fx, fy, cx, cy, k1, k2, p1, p2 = (float(p) for p in parameters)
        return replace(self, xi=xi, focal_px=(fx, fy), centre=(cx, cy), distortion=(k1, k2, p1, p2))

    @property
    def _mirror(self) -> float:
        return self.xi

    @property
    def _coefficients(self) -> tuple[float, float, float, float, float]:
        return (*self.distortion, 0.0)

    @property
    def _columns(self) -> slice:
        return slice(0, 9)
