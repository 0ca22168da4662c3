"""Least squares over one camera and many board poses: Levenberg-Marquardt on the camera's Schur complement.

Each pose couples only to its own view and to the camera, so eliminating the 6 × 6 pose blocks leaves a dense
system of the camera's few parameters (W. Triggs et al., "Bundle adjustment - a modern synthesis", 2000, § 6).
Residuals are weighted after Huber by iterated reweighting.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.geometry.rigid import from_parts, rotation_from_vector, skew
from pipeline.instrument.camera.base import Camera
from pipeline.instrument.camera.calibration import BoardView

Float = NDArray[np.float64]
Int = NDArray[np.int64]

POSE = 6
_OUT_OF_MODEL_PX = 1e4
_MOST_STEPS = 300
_SMALLEST_GAIN = 1e-10
_STEADY_STEPS = 3
_LARGEST_DAMPING = 1e12


@dataclass(frozen=True)
class Corners:
    """All corners of all views: view (M,) ascending, board point ``xyz_b`` (M, 3), pixel ``uv`` (M, 2)."""

    view: Int
    xyz_b: Float
    uv: Float
    views: int

    @staticmethod
    def of(views: Sequence[BoardView]) -> Corners:
        """Return the corners of board views, one after another."""
        view = np.repeat(np.arange(len(views)), [len(v.uv) for v in views])
        return Corners(
            view, np.concatenate([v.xyz_b for v in views]), np.concatenate([v.uv for v in views]), len(views)
        )

    def slices(self) -> list[slice]:
        """Return the rows of each view."""
        edges = np.searchsorted(self.view, np.arange(self.views + 1))
        return [slice(int(a), int(b)) for a, b in zip(edges[:-1], edges[1:], strict=True)]


@dataclass(frozen=True)
class Estimate:
    """A camera and board poses ``T_cb`` (V, 4, 4)."""

    camera: Camera
    T_cb: Float

    def residuals(self, corners: Corners) -> Float:
        """Return projected minus observed (M, 2), px; NaN where the model does not reach."""
        return np.asarray(self.camera.project(self.points(corners)).uv - corners.uv)

    def points(self, corners: Corners) -> Float:
        """Return the corners (M, 3), mm, in C."""
        T = self.T_cb[corners.view]
        return np.asarray(np.einsum("mij,mj->mi", T[:, :3, :3], corners.xyz_b) + T[:, :3, 3])

    def moved(self, free: Int, camera_step: Float, pose_step: Float) -> Estimate:
        """Return the estimate after a step of the free camera parameters and of (V, 6) pose tangents."""
        parameters = self.camera.parameters
        parameters[free] += camera_step
        turn = rotation_from_vector(pose_step[:, :3])
        rotation = turn @ self.T_cb[:, :3, :3]
        T_cb = from_parts(rotation, self.T_cb[:, :3, 3] + pose_step[:, 3:])
        return replace(self, camera=self.camera.with_parameters(parameters), T_cb=T_cb)


@dataclass(frozen=True)
class NormalEquations:
    """Gauss-Newton system in blocks: camera (F, F), coupling (V, F, 6), poses (V, 6, 6), and gradients."""

    camera: Float
    coupling: Float
    pose: Float
    camera_gradient: Float
    pose_gradient: Float

    def step(self, damping: float) -> tuple[Float, Float]:
        """Return the damped step of the camera (F,) and of the poses (V, 6)."""
        pose = self.pose + damping * _diagonals(self.pose)
        camera = self.camera + damping * np.diag(np.diag(self.camera))
        solved = np.linalg.solve(pose, np.swapaxes(self.coupling, 1, 2))
        solved_gradient = np.linalg.solve(pose, self.pose_gradient[..., None])[..., 0]
        reduced = camera - np.einsum("vfp,vpg->fg", self.coupling, solved)
        gradient = self.camera_gradient - np.einsum("vfp,vp->f", self.coupling, solved_gradient)
        camera_step = -_solve_scaled(reduced, gradient)
        return camera_step, -solved_gradient - np.einsum("vpf,f->vp", solved, camera_step)

    def camera_information(self) -> Float:
        """Return the camera's information (F, F) with the poses marginalised."""
        solved = np.linalg.solve(self.pose, np.swapaxes(self.coupling, 1, 2))
        return np.asarray(self.camera - np.einsum("vfp,vpg->fg", self.coupling, solved))


def solve(start: Estimate, corners: Corners, free: Int, huber_px: float) -> Estimate:
    """Return the estimate of least robust cost reached from ``start``.

    Parameters
    ----------
    free
        Indices of the camera parameters to estimate; none leaves only the poses.
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


def linearise(estimate: Estimate, corners: Corners, free: Int, huber_px: float) -> NormalEquations:
    """Return the weighted normal equations at an estimate."""
    points = estimate.points(corners)
    residual = estimate.residuals(corners)
    root = np.sqrt(weights(residual, huber_px))[:, None, None]
    jacobian = estimate.camera.project_jacobian(points)
    arms = points - estimate.T_cb[corners.view][:, :3, 3]
    by_pose = jacobian.by_point @ np.concatenate(
        [-skew(arms), np.broadcast_to(np.eye(3), (len(arms), 3, 3))], -1
    )
    rows = np.concatenate([jacobian.by_parameters[..., free], by_pose, residual[..., None]], -1)
    rows = np.where(root > 0, rows, 0.0) * root
    blocks = np.stack([_gram(rows[part]) for part in corners.slices()])
    f = len(free)
    pose = slice(f, f + POSE)
    return NormalEquations(
        blocks[:, :f, :f].sum(0), blocks[:, :f, pose], blocks[:, pose, pose] + 1e-12 * np.eye(POSE),
        blocks[:, :f, -1].sum(0), blocks[:, pose, -1],
    )  # fmt: skip


def covariance(estimate: Estimate, corners: Corners, huber_px: float) -> tuple[Float, float]:
    """Return the camera's covariance (P, P) and the 1 σ of a corner coordinate, px."""
    free = np.arange(len(estimate.camera.parameters))
    residual = estimate.residuals(corners)
    weight = weights(residual, huber_px)
    squares = float(np.nansum(weight * np.sum(residual**2, -1)))
    freedom = 2 * int(np.count_nonzero(weight)) - len(free) - POSE * corners.views
    sigma = np.sqrt(squares / max(freedom, 1))
    information = linearise(estimate, corners, free, huber_px).camera_information()
    return sigma**2 * _inverse_scaled(information), float(sigma)


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
