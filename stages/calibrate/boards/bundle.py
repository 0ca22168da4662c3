"""Least squares over one camera and many board poses: residuals, their derivatives, and the covariance.

A pose acts only on its own view, the camera on all views: the normal equations have the shape of an arrow
(`ArrowEquations`). Residuals get Huber weights by iterated reweighting. A plane board may be bent: it has the
same quadratic sag in all views, as in the board warp of mrcal.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from pipeline.adjustment.levenberg_marquardt import Stop, minimise
from pipeline.adjustment.normal_equations import ArrowEquations, covariance_of
from pipeline.adjustment.robust import cluster_covariance
from pipeline.arrays import Float, Int
from pipeline.geometry.rigid import from_parts, rotation_from_vector, skew
from pipeline.instrument.camera import Camera
from pipeline.instrument.camera.calibration import BoardView

POSE = 6
# Residual, px, of a corner that lies outside the camera model's field of view. With a tenth or ten times of
# it, with half or twice the trials, or with a tenth or ten times the gain at which a fit stops, no
# Kannala-Brandt camera moves by 1e-6 of its σ.
_OUT_OF_MODEL_PX = 1e4
STOP = Stop(trials=300, enough=1e-10)


@dataclass(frozen=True)
class Corners:
    """All corners of all views.

    Attributes
    ----------
    view : (M,) int
        Ascending.
    xyz_b : (M, 3)
        On the flat board, mm.
    uv : (M, 2)
    sag : (M, 3)
        Distance of each corner from the plane, mm, for 1 mm of each of the three shape parameters.
    views : int
    """

    view: Int
    xyz_b: Float
    uv: Float
    sag: Float
    views: int

    @staticmethod
    def of(views: Sequence[BoardView]) -> Corners:
        """Return the corners of board views, one after another."""
        view = np.repeat(np.arange(len(views)), [len(v.uv) for v in views])
        xyz_b, uv = np.concatenate([v.xyz_b for v in views]), np.concatenate([v.uv for v in views])
        return Corners(view, xyz_b, uv, _sag(xyz_b), len(views))

    def slices(self) -> list[slice]:
        """Return the rows of each view."""
        edges = np.searchsorted(self.view, np.arange(self.views + 1))
        return [slice(int(a), int(b)) for a, b in pairwise(edges)]


@dataclass(frozen=True)
class Free:
    """Parameters estimated in addition to the poses: indices of camera and of shape parameters."""

    camera: Int
    shape: Int

    @property
    def count(self) -> int:
        """Number of shared parameters."""
        return len(self.camera) + len(self.shape)


FLAT = np.zeros(0, np.int64)
BENT = np.arange(3)
POSES_ONLY = Free(FLAT, FLAT)


@dataclass(frozen=True)
class Estimate:
    """A camera, board poses ``T_cb`` (V, 4, 4) and the board's shape (3,), mm: see `Corners.sag`."""

    camera: Camera
    T_cb: Float
    shape_mm: Float

    def residuals(self, corners: Corners) -> Float:
        """Return projected minus observed (M, 2), px; NaN where the model has no projection."""
        return np.asarray(self.camera.project(self.points(corners)).uv - corners.uv)

    def points(self, corners: Corners) -> Float:
        """Return the corners (M, 3), mm, in C."""
        T = self.T_cb[corners.view]
        xyz_b = corners.xyz_b + (corners.sag @ self.shape_mm)[:, None] * np.array([0.0, 0.0, 1.0])
        return np.asarray(np.einsum("mij,mj->mi", T[:, :3, :3], xyz_b) + T[:, :3, 3])

    def moved(self, free: Free, shared_step: Float, pose_step: Float) -> Estimate:
        """Return the estimate after a step of the free shared parameters and of (V, 6) pose tangents."""
        parameters, shape_mm = self.camera.parameters, self.shape_mm.copy()
        parameters[free.camera] += shared_step[: len(free.camera)]
        shape_mm[free.shape] += shared_step[len(free.camera) :]
        rotation = rotation_from_vector(pose_step[:, :3]) @ self.T_cb[:, :3, :3]
        T_cb = from_parts(rotation, self.T_cb[:, :3, 3] + pose_step[:, 3:])
        return replace(self, camera=self.camera.with_parameters(parameters), T_cb=T_cb, shape_mm=shape_mm)


@dataclass(frozen=True)
class Linearised:
    """An estimate with its robust cost; its normal equations are computed at first use."""

    estimate: Estimate
    corners: Corners
    free: Free
    huber_px: float

    @cached_property
    def cost(self) -> float:
        """Huber's cost."""
        return cost(self.estimate.residuals(self.corners), self.huber_px)

    @cached_property
    def normal(self) -> ArrowEquations:
        """The weighted normal equations."""
        return linearise(self.estimate, self.corners, self.free, self.huber_px)

    def step(self, damping: float) -> tuple[Float, Float]:
        """Return the damped step of the shared parameters (F,) and of the poses (V, 6)."""
        return self.normal.step(damping)

    def decrease(self, step: tuple[Float, Float]) -> float:
        """Return the decrease of the cost by a step if the residuals are linear."""
        return self.normal.decrease(step)


def solve(start: Estimate, corners: Corners, free: Free, huber_px: float, stop: Stop = STOP) -> Estimate:
    """Return the estimate of least robust cost reached from ``start``.

    Parameters
    ----------
    free
        Parameters to estimate in addition to the poses.
    huber_px
        Residual length beyond which a corner counts linearly.
    stop
        When the search ends.
    """

    def linearised(estimate: Estimate, _: None) -> Linearised:
        return Linearised(estimate, corners, free, huber_px)

    def moved(estimate: Estimate, step: tuple[Float, Float]) -> Estimate:
        return estimate.moved(free, *step)

    def as_given(equations: Linearised) -> tuple[Linearised, None]:
        return equations, None

    return minimise(start, linearised, moved, as_given, stop).state


def cost(residual: Float, huber_px: float) -> float:
    """Return Huber's cost of (M, 2) residuals; corners without a projection count as very far."""
    length = np.nan_to_num(np.hypot(residual[:, 0], residual[:, 1]), nan=_OUT_OF_MODEL_PX)
    return float(np.sum(np.where(length <= huber_px, length**2, huber_px * (2 * length - huber_px))))


def weights(residual: Float, huber_px: float) -> Float:
    """Return Huber's weights (M,) of residuals; 0 without a projection."""
    length = np.hypot(residual[:, 0], residual[:, 1])
    return np.nan_to_num(huber_px / np.maximum(length, huber_px), nan=0.0)


def linearise(estimate: Estimate, corners: Corners, free: Free, huber_px: float) -> ArrowEquations:
    """Return the weighted normal equations at an estimate."""
    points = estimate.points(corners)
    residual = estimate.residuals(corners)
    root = np.sqrt(weights(residual, huber_px))[:, None, None]
    jacobian = estimate.camera.project_jacobian(points)
    arms = points - estimate.T_cb[corners.view][:, :3, 3]
    by_pose = jacobian.by_point @ np.concatenate(
        [-skew(arms), np.broadcast_to(np.eye(3), (len(arms), 3, 3))], -1
    )
    normal = estimate.T_cb[corners.view][:, :3, 2]
    by_shape = (jacobian.by_point @ normal[..., None]) * corners.sag[:, None, free.shape]
    by_camera = jacobian.by_parameters[..., free.camera]
    rows = np.concatenate([by_camera, by_shape, by_pose, residual[..., None]], -1)
    rows = np.where(root > 0, rows, 0.0) * root
    blocks = np.stack([_gram(rows[part]) for part in corners.slices()])
    f = free.count
    pose = slice(f, f + POSE)
    return ArrowEquations(
        blocks[:, :f, :f].sum(0), blocks[:, :f, pose], blocks[:, pose, pose] + 1e-12 * np.eye(POSE),
        blocks[:, :f, -1], blocks[:, pose, -1],
    )  # fmt: skip


def covariance(estimate: Estimate, corners: Corners, free: Free, huber_px: float) -> tuple[Float, float]:
    """Return the covariance (F, F) of the shared parameters and the 1 σ of a corner coordinate, px.

    The residuals of one picture are often correlated (a board that bends, a pattern that the model cannot
    follow), so that a picture has less information than the number of its corners suggests. The covariance is
    scaled up by the ratio of the scatter of the pictures' gradients to that of independent corners.
    """
    residual = estimate.residuals(corners)
    weight = weights(residual, huber_px)
    squares = float(np.nansum(weight * np.sum(residual**2, -1)))
    freedom = 2 * int(np.count_nonzero(weight)) - free.count - POSE * corners.views
    variance = squares / max(freedom, 1)
    information, gradients = linearise(estimate, corners, free, huber_px).marginal()
    inverse = covariance_of(information)
    return variance * _correlation_factor(gradients, inverse, variance) * inverse, float(np.sqrt(variance))


def pose_covariances(estimate: Estimate, corners: Corners, huber_px: float) -> Float:
    """Return the covariance (V, 6, 6) of the poses' tangents, rad and mm, with the camera held.

    Each is computed for independent corners with the scatter of its own picture.
    """
    residual = estimate.residuals(corners)
    weight = weights(residual, huber_px)
    squares = np.nan_to_num(weight * np.sum(residual**2, -1))
    variance = [squares[p].sum() / max(2 * np.count_nonzero(weight[p]) - POSE, 1) for p in corners.slices()]
    block = linearise(estimate, corners, POSES_ONLY, huber_px).block
    return np.stack([v * covariance_of(b) for v, b in zip(variance, block, strict=True)])


def _correlation_factor(gradients: Float, inverse: Float, variance: float) -> float:
    """Return the scatter of the pictures' gradients (V, F) over that of independent corners.

    At least 1: the covariance is never narrowed.
    """
    views, count = gradients.shape
    if views < 2 or count == 0 or variance == 0:
        return 1.0
    scatter = np.trace(inverse @ cluster_covariance(gradients, np.arange(views)))
    return float(max(scatter / variance / count, 1.0))


def _sag(xyz_b: Float) -> Float:
    """Return x², xy and y² (M, 3) of corners, from the board's centre in units of its half diagonal."""
    xy = xyz_b[:, :2] - (xyz_b[:, :2].min(0) + xyz_b[:, :2].max(0)) / 2
    x, y = (xy / max(float(np.linalg.norm(xy, axis=1).max()), 1e-12)).T
    return np.stack([x * x, x * y, y * y], -1)


def _gram(rows: Float) -> Float:
    flat = rows.reshape(-1, rows.shape[-1])
    return np.asarray(flat.T @ flat)
