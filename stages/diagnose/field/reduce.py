"""Eliminate poses, landmarks, pipe and matching errors: the result is evidence over the shared columns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from pipeline.adjustment.bordered import BorderedSystem, Factor
from pipeline.adjustment.normal_equations import marginalised
from pipeline.adjustment.robust import cluster_variance
from pipeline.adjustment.rows import LandmarkRows, Rows
from pipeline.arrays import Float, Int
from stages.diagnose.field.system import FieldSystem
from stages.diagnose.inference import Evidence

_LEAST_REACH = 4


@dataclass(frozen=True)
class Reduced:
    """A field system reduced to its named columns.

    Attributes
    ----------
    information, right : (K, K), (K,)
        Normal equations over the named columns.
    follow : (B, K)
        Response of all border columns to the named ones.
    step : (B,)
        Step of the recording's own columns with the named ones fixed.
    landmark_inverse : (L, 3, 3)
    """

    factor: Factor
    information: Float
    right: Float
    follow: Float
    step: Float
    landmark_inverse: Float


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
        inverse, _ = bordered.add_landmarks(system.texture)
        factor = bordered.factor()
        own = np.arange(system.border - len(system.names))
        left = marginalised(factor.border_information(), factor.border_right, own)
    information = left.information - np.diag(system.held)
    return Reduced(factor, information, left.right, left.follow, left.step, inverse)


def evidence_of(system: FieldSystem, found: Reduced, ring_cell: Int, landmark_cell: Int) -> Evidence:
    """Return the evidence; rings (M,) and landmarks (L,) of one cell have correlated errors."""
    scores, squares, misfit = _ring_scores(system, found)
    texture, more, rest = _texture_scores(system, found)
    cells = np.concatenate([ring_cell, landmark_cell + int(ring_cell.max(initial=0)) + 1])
    robust, plain = cluster_variance(np.concatenate([scores, texture]), cells), squares + more
    inflation = np.sqrt(np.maximum(robust / np.maximum(plain, 1e-300), 1.0))
    inflation[plain < 1e-12 * np.maximum(np.diag(found.information), 1e-300)] = 1.0
    right = found.right + found.information @ system.value
    covariance = found.information * np.outer(inflation, inflation)
    return Evidence(
        system.names, found.information, right, covariance, misfit + rest, np.full(len(right), np.inf)
    )


def rings_after(rows: Rows, found: Reduced, named: Float) -> Float:
    """Return the rings' residuals (M,) after a step ``named`` (K,), all other unknowns at their optimum."""
    return np.asarray(rows.residual + _after_step(rows, found) + _by_named(rows, found) @ named)


def _ring_scores(system: FieldSystem, found: Reduced) -> tuple[Float, Float, float]:
    rows = system.rows[0]
    change = _by_named(rows, found)
    residual = rows.residual + _after_step(rows, found)
    weight = rows.weight
    return change * (weight * residual)[:, None], weight @ change**2, float(np.sum(weight * residual**2))


def _by_named(rows: Rows, found: Reduced) -> Float:
    """Return the residuals' derivatives (M, K) by the named columns, frames and own columns following."""
    return np.asarray(found.factor.border_rows(rows) @ found.follow)


def _after_step(rows: Rows, found: Reduced) -> Float:
    moved = np.einsum(
        "mb,mb->m", rows.by_frame[:, 0], found.factor.frames_after(found.step)[rows.frame[:, 0]]
    )
    return np.asarray(moved + rows.by_border @ found.step)


def _texture_scores(system: FieldSystem, found: Reduced) -> tuple[Float, Float, float]:
    """Return each landmark's score (L, K), the sum of squares (K,), and the misfit."""
    rows, size = system.texture, len(system.names)
    poses = found.factor.frames_follow(found.follow)
    step = found.factor.frames_after(found.step)
    weight, relief_weight = rows.weight, rows.surface_weight
    scores, squares, misfit = np.zeros((len(rows.start) - 1, size)), np.zeros(size), 0.0
    for k in range(len(scores)):
        flat, wide, relief, relief_change = _followed(rows, found, poses, step, k)
        by_point = rows.by_point[rows.start[k] : rows.start[k + 1]].reshape(-1, 3)
        both = np.repeat(weight[rows.start[k] : rows.start[k + 1]][:, None], 2)
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


def _followed(
    rows: LandmarkRows, found: Reduced, poses: Float, step: Float, k: int
) -> tuple[Float, Float, Float, Float]:
    """Return residuals (2 M,) of a landmark, their derivatives (2 M, K), its relief, and that one's (K,).

    The derivatives are by the named columns; poses and own columns follow, the landmark does not.
    """
    own = slice(rows.start[k], rows.start[k + 1])
    first, frame = len(found.step) - rows.by_instrument.shape[2], rows.frame[own]
    change = np.einsum("mij,mjk->mik", rows.by_pose[own], poses[frame, :6])
    change += rows.by_instrument[own] @ found.follow[first:]
    residual = rows.residual[own] + np.einsum("mij,mj->mi", rows.by_pose[own], step[frame, :6])
    residual += rows.by_instrument[own] @ found.step[first:]
    relief = rows.surface_residual[k] + rows.surface_by_border[k] @ found.step
    relief_change = rows.surface_by_border[k] @ found.follow
    return residual.reshape(-1), change.reshape(-1, change.shape[-1]), relief, relief_change
