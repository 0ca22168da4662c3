"""Elimination of poses, landmarks, pipe and matching's errors: evidence over the shared columns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from threadpoolctl import threadpool_limits

from pipeline.adjustment.bordered import BorderedSystem, Factor, Rows
from pipeline.adjustment.sums import BLOCK
from pipeline.arrays import Float, Int
from stages.diagnose.evidence import Evidence
from stages.diagnose.field.system import FieldSystem

_LEAST_REACH = 4


@dataclass(frozen=True)
class Reduced:
    """A field system reduced to its named columns.

    Attributes
    ----------
    factor : Factor
    information, right : (K, K), (K,)
        Over the named columns.
    follow : (B, K)
        How all columns of the border follow the named ones.
    step : (B,)
        Of the recording's own columns, the named ones staying.
    landmark_inverse, landmark_right : (L, 3, 3), (L, 3)
    """

    factor: Factor
    information: Float
    right: Float
    follow: Float
    step: Float
    landmark_inverse: Float
    landmark_right: Float


def reduced(system: FieldSystem, frames: int) -> Reduced:
    """Eliminate all unknowns but the named columns.

    Raises
    ------
    numpy.linalg.LinAlgError
        When some unknown is not determined.
    """
    with threadpool_limits(1):
        bordered = BorderedSystem(frames, system.border, max(system.texture.reach, _LEAST_REACH))
        for row in system.rows:
            bordered.add(row)
        inverse, right_point = bordered.add_landmarks(system.texture)
        factor = bordered.factor()
        direct = factor.band.solve(factor.right[:, None])[:, 0]
        corner = _corner(factor)
        right = factor.right_border - factor.border.T @ direct
    own, size = system.border - len(system.names), len(system.names)
    held = cho_factor(corner[:own, :own])
    response = cho_solve(held, corner[:own, own:])
    best = cho_solve(held, right[:own])
    information = corner[own:, own:] - corner[own:, :own] @ response - np.diag(system.held)
    follow, step = np.zeros((system.border, size)), np.zeros(system.border)
    follow[:own], follow[own:], step[:own] = -response, np.eye(size), best
    return Reduced(
        factor, (information + information.T) / 2, right[own:] - response.T @ right[:own], follow, step,
        inverse, right_point,
    )  # fmt: skip


def evidence_of(system: FieldSystem, found: Reduced, ring_cell: Int, landmark_cell: Int) -> Evidence:
    """Return the evidence; rings and landmarks of one cell (M,), (L,) err alike."""
    scores, squares, misfit = _ring_scores(system, found)
    texture, more, rest = _texture_scores(system, found)
    cells = np.concatenate([ring_cell, landmark_cell + int(ring_cell.max(initial=0)) + 1])
    place = np.unique(cells, return_inverse=True)[1]
    total = np.zeros((int(place.max(initial=-1)) + 1, scores.shape[1]))
    np.add.at(total, place, np.concatenate([scores, texture]))
    robust, plain = np.sum(total**2, 0), squares + more
    inflation = np.sqrt(np.maximum(robust / np.maximum(plain, 1e-300), 1.0))
    inflation[plain < 1e-12 * np.maximum(np.diag(found.information), 1e-300)] = 1.0
    right = found.right + found.information @ system.value
    covariance = found.information * np.outer(inflation, inflation)
    return Evidence(system.names, found.information, right, covariance, misfit + rest, float(len(total)))


def rings_after(rows: Rows, found: Reduced, named: Float) -> Float:
    """Return the rings' residuals (M,) after a step ``named`` (K,), all other unknowns at their best."""
    return np.asarray(rows.residual + _after_step(rows, found) + _by_named(rows, found) @ named)


def _corner(factor: Factor) -> Float:
    """Return the border's information with the frames eliminated."""
    upper, lower = factor.corner
    triangle = np.tril(upper) if lower else np.triu(upper)
    return np.asarray(triangle @ triangle.T if lower else triangle.T @ triangle)


def _ring_scores(system: FieldSystem, found: Reduced) -> tuple[Float, Float, float]:
    rows = system.rows[0]
    change = _by_named(rows, found)
    residual = rows.residual + _after_step(rows, found)
    weight = rows.weight
    return change * (weight * residual)[:, None], weight @ change**2, float(np.sum(weight * residual**2))


def _by_named(rows: Rows, found: Reduced) -> Float:
    """Return (M, K) how residuals follow the named columns when frames and own columns do."""
    poses = (-found.factor.solved_border @ found.follow).reshape(-1, BLOCK, found.follow.shape[1])
    by_poses = np.einsum("mb,mbk->mk", rows.by_frame[:, 0], poses[rows.frame[:, 0]])
    return np.asarray(rows.by_border @ found.follow + by_poses)


def _pose_step(found: Reduced) -> Float:
    """Return the step (N, 7) of the frames with the named columns staying."""
    direct = found.factor.band.solve(found.factor.right[:, None])[:, 0]
    return np.asarray((direct - found.factor.solved_border @ found.step).reshape(-1, BLOCK))


def _after_step(rows: Rows, found: Reduced) -> Float:
    moved = np.einsum("mb,mb->m", rows.by_frame[:, 0], _pose_step(found)[rows.frame[:, 0]])
    return np.asarray(moved + rows.by_border @ found.step)


def _texture_scores(system: FieldSystem, found: Reduced) -> tuple[Float, Float, float]:
    """Return each landmark's score (L, K), the plain sum of squares (K,), and the misfit."""
    rows, size = system.texture, len(system.names)
    poses = (-found.factor.solved_border @ found.follow).reshape(-1, BLOCK, size)
    step = _pose_step(found)
    weight, relief_weight = rows.weight, rows.surface_weight
    first = system.border - rows.by_instrument.shape[2]
    landmarks = len(rows.start) - 1
    scores, squares, misfit = np.zeros((landmarks, size)), np.zeros(size), 0.0
    for k in range(landmarks):
        own = slice(rows.start[k], rows.start[k + 1])
        frame, w = rows.frame[own], weight[own][:, None]
        change = np.einsum("mij,mjk->mik", rows.by_pose[own], poses[frame, :6])
        change += rows.by_instrument[own] @ found.follow[first:]
        residual = rows.residual[own] + np.einsum("mij,mj->mi", rows.by_pose[own], step[frame, :6])
        residual += rows.by_instrument[own] @ found.step[first:]
        relief_change = rows.surface_by_border[k] @ found.follow
        relief = rows.surface_residual[k] + rows.surface_by_border[k] @ found.step
        by_point = rows.by_point[own].reshape(-1, 3)
        both = np.repeat(w, 2)
        flat, wide = residual.reshape(-1), change.reshape(-1, size)
        normal, ws = rows.surface_by_point[k], relief_weight[k]
        pull = by_point.T @ (both * flat) + ws * relief * normal
        pulls = by_point.T @ (both[:, None] * wide) + ws * np.outer(normal, relief_change)
        inverse = found.landmark_inverse[k]
        flat, relief = flat - by_point @ (inverse @ pull), relief - normal @ (inverse @ pull)
        wide, relief_change = wide - by_point @ (inverse @ pulls), relief_change - normal @ (inverse @ pulls)
        scores[k] = wide.T @ (both * flat) + ws * relief * relief_change
        squares += both @ wide**2 + ws * relief_change**2
        misfit += float(both @ flat**2 + ws * relief**2)
    return scores, squares, misfit
