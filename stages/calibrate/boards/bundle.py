"""Least squares over one camera and many board poses: Levenberg-Marquardt on the camera's Schur complement.

Each pose couples only to its own view and to the camera, so eliminating the 6 × 6 pose blocks leaves a dense
system of the camera's few parameters (W. Triggs et al., "Bundle adjustment - a modern synthesis", 2000, § 6).
Residuals are weighted after Huber by iterated reweighting. A plane board may be bent: the same quadratic
sag in all views, as in mrcal's board warp.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from pipeline.arrays import Float, Int
from pipeline.geometry.rigid import from_parts, rotation_from_vector, skew
from pipeline.instrument.camera.base import Camera
from pipeline.instrument.camera.calibration import BoardView

POSE = 6
_OUT_OF_MODEL_PX = 1e4
_MOST_STEPS = 300
_SMALLEST_GAIN = 1e-10
_STEADY_STEPS = 3
_LARGEST_DAMPING = 1e12


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
        How far each corner leaves the plane, mm, for 1 mm of each of the three shape parameters.
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
    """What is estimated beside the poses: indices of camera parameters, and of the shape's parameters."""

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
        """Return projected minus observed (M, 2), px; NaN where the model does not reach."""
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
class NormalEquations:
    """Gauss-Newton system: shared (F, F), coupling (V, F, 6) and pose (V, 6, 6) blocks, gradients by view."""

    shared: Float
    coupling: Float
    pose: Float
    shared_gradients: Float
    pose_gradient: Float

    def step(self, damping: float) -> tuple[Float, Float]:
        """Return the damped step of the shared parameters (F,) and of the poses (V, 6)."""
        pose = self.pose + damping * _diagonals(self.pose)
        shared = self.shared + damping * np.diag(np.diag(self.shared))
        solved = np.linalg.solve(pose, np.swapaxes(self.coupling, 1, 2))
        solved_gradient = np.linalg.solve(pose, self.pose_gradient[..., None])[..., 0]
        reduced = shared - np.einsum("vfp,vpg->fg", self.coupling, solved)
        gradient = self.shared_gradients.sum(0) - np.einsum("vfp,vp->f", self.coupling, solved_gradient)
        shared_step = -_solve_scaled(reduced, gradient)
        return shared_step, -solved_gradient - np.einsum("vpf,f->vp", solved, shared_step)

    def shared_information(self) -> Float:
        """Return the information (F, F) of the shared parameters with the poses marginalised."""
        solved = np.linalg.solve(self.pose, np.swapaxes(self.coupling, 1, 2))
        return np.asarray(self.shared - np.einsum("vfp,vpg->fg", self.coupling, solved))


def solve(start: Estimate, corners: Corners, free: Free, huber_px: float) -> Estimate:
    """Return the estimate of least robust cost reached from ``start``.

    Parameters
    ----------
    free
        What to estimate beside the poses.
    huber_px
        Residual length beyond which a corner counts linearly.
    """
    estimate, damping, steady = start, 1e-3, 0
    value = cost(estimate.residuals(corners), huber_px)
    for _ in range(_MOST_STEPS):
        system = linearise(estimate, corners, free, huber_px)
        while damping < _LARGEST_DAMPING:
            candidate = estimate.moved(free, *system.step(damping))
            following = cost(candidate.residuals(corners), huber_px)
            if following <= value:
                break
            damping *= 10
        else:
            return estimate
        steady = steady + 1 if value - following <= _SMALLEST_GAIN * value else 0
        estimate, value, damping = candidate, following, max(damping / 10, 1e-14)
        if steady >= _STEADY_STEPS:
            break
    return estimate


def cost(residual: Float, huber_px: float) -> float:
    """Return Huber's cost of (M, 2) residuals; corners out of the model's reach count as very far."""
    length = np.nan_to_num(np.hypot(residual[:, 0], residual[:, 1]), nan=_OUT_OF_MODEL_PX)
    return float(np.sum(np.where(length <= huber_px, length**2, huber_px * (2 * length - huber_px))))


def weights(residual: Float, huber_px: float) -> Float:
    """Return Huber's weights (M,) of residuals; 0 out of the model's reach."""
    length = np.hypot(residual[:, 0], residual[:, 1])
    return np.nan_to_num(huber_px / np.maximum(length, huber_px), nan=0.0)


def linearise(estimate: Estimate, corners: Corners, free: Free, huber_px: float) -> NormalEquations:
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
    return NormalEquations(
        blocks[:, :f, :f].sum(0), blocks[:, :f, pose], blocks[:, pose, pose] + 1e-12 * np.eye(POSE),
        blocks[:, :f, -1], blocks[:, pose, -1],
    )  # fmt: skip


def covariance(estimate: Estimate, corners: Corners, free: Free, huber_px: float) -> tuple[Float, float]:
    """Return the covariance (F, F) of the shared parameters and the 1 σ of a corner coordinate, px.

    The residuals of one picture tend to err together (a board that bends, a pattern that the model cannot
    follow), so that a picture tells less than its corners' number says. The covariance is scaled up by the
    factor by which the pictures' gradients scatter more than independent corners would make them.
    """
    residual = estimate.residuals(corners)
    weight = weights(residual, huber_px)
    squares = float(np.nansum(weight * np.sum(residual**2, -1)))
    freedom = 2 * int(np.count_nonzero(weight)) - free.count - POSE * corners.views
    variance = squares / max(freedom, 1)
    system = linearise(estimate, corners, free, huber_px)
    inverse = _inverse_scaled(system.shared_information())
    return variance * _togetherness(system, inverse, variance) * inverse, float(np.sqrt(variance))


def _togetherness(system: NormalEquations, inverse: Float, variance: float) -> float:
    """Return the mean scatter of the pictures' gradients against that of independent corners, at least 1."""
    views, count = system.shared_gradients.shape
    if views < 2 or count == 0 or variance == 0:
        return 1.0
    solved = np.linalg.solve(system.pose, system.pose_gradient[..., None])[..., 0]
    gradients = system.shared_gradients - np.einsum("vfp,vp->vf", system.coupling, solved)
    scatter = float(np.einsum("vf,fg,vg->", gradients, inverse, gradients)) / variance / count
    return float(max(scatter * views / (views - 1), 1.0))


def _sag(xyz_b: Float) -> Float:
    """Return x², xy and y² about the board's centre, 1 at its half diagonal."""
    xy = xyz_b[:, :2] - (xyz_b[:, :2].min(0) + xyz_b[:, :2].max(0)) / 2
    x, y = (xy / max(float(np.linalg.norm(xy, axis=1).max()), 1e-12)).T
    return np.stack([x * x, x * y, y * y], -1)


def _gram(rows: Float) -> Float:
    flat = rows.reshape(-1, rows.shape[-1])
    return np.asarray(flat.T @ flat)


def _diagonals(blocks: Float) -> Float:
    return np.asarray(np.eye(blocks.shape[-1]) * np.diagonal(blocks, axis1=-2, axis2=-1)[..., None, :])


def _solve_scaled(matrix: Float, vector: Float) -> Float:
    """Solve with unit diagonal: the parameters' scales differ by ten powers of ten and more."""
    scale = 1 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    scaled = matrix * scale * scale[:, None]
    return np.asarray(scale * np.linalg.lstsq(scaled, scale * vector, rcond=1e-15)[0])


def _inverse_scaled(matrix: Float) -> Float:
    scale = 1 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    return np.asarray(
        np.linalg.pinv(matrix * scale * scale[:, None], hermitian=True) * scale * scale[:, None]
    )
