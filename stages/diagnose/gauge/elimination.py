"""Elimination of poses and other unknowns of one recording from its linearised measurements.

What is left is the evidence over the shared columns. B. Triggs et al., "Bundle adjustment: a modern
synthesis", 2000, § 6; the scores' true covariance after H. White, "Asymptotic theory for econometricians",
1984, ch. 6, over cells of wall and over frames (A. Cameron et al., "Robust inference with multiway
clustering", 2011).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from itertools import pairwise

import numpy as np
from scipy.linalg import cho_factor, cho_solve, cho_solve_banded, cholesky_banded
from scipy.sparse import csr_matrix

from pipeline.arrays import Bool, Float, Int

POSE = 6
RING, EDGE, ENCODER = 0, 1, 2
_REACH = 4
# Information, relative to that of the best determined pose, that keeps an undetermined pose in its place.
_HOLD = 1e-10


@dataclass(frozen=True)
class Part:
    """Some frames (N,) of a run, and some kinds of its measurements."""

    frames: Bool
    kinds: tuple[int, ...] = (RING, EDGE, ENCODER)


@dataclass(frozen=True)
class Equations:
    """Weighted scalar measurements, each of one frame.

    Attributes
    ----------
    frame : (M,) int
    by_pose : (M, 6)
    by_global : (M, G)
    residual, weight : (M,)
    cell : (M,) int
        Measurements of one cell err alike.
    kind : (M,) int
        `RING`, `EDGE` or `ENCODER`.
    """

    frame: Int
    by_pose: Float
    by_global: Float
    residual: Float
    weight: Float
    cell: Int
    kind: Int

    def of(self, part: Part) -> Equations:
        """Return the measurements of a part of the run."""
        use = part.frames[self.frame] & np.isin(self.kind, part.kinds)
        return self.at(np.flatnonzero(use))

    def at(self, rows: Int) -> Equations:
        """Return the measurements at these rows."""
        return Equations(*(getattr(self, f.name)[rows] for f in fields(self)))


@dataclass(frozen=True)
class MotionPrior:
    """Rows that tie four frames: ``frame`` (S, 4), ``by_pose`` (S, 4, 6), ``residual``, ``weight``."""

    frame: Int
    by_pose: Float
    residual: Float
    weight: Float


@dataclass(frozen=True)
class Reduced:
    """Poses eliminated: normal equations over the globals.

    Attributes
    ----------
    information, right, misfit
        Over all G globals, without any prior on them.
    pose_by_global : (N, 6, G)
        How poses follow the globals: δpose = δpose₀ − pose_by_global · δglobal.
    pose_step : (N, 6)
    """

    information: Float
    right: Float
    misfit: float
    pose_by_global: Float
    pose_step: Float


def eliminate_poses(equations: Equations, motion: MotionPrior, frames: int) -> Reduced:
    """Return the normal equations over the globals at the best poses."""
    size = equations.by_global.shape[1]
    corner = np.zeros((size + 1, size + 1))
    blocks, mixed = np.zeros((frames, POSE, POSE)), np.zeros((frames, POSE, size + 1))
    for rows, used in _by_kind(equations):
        part = equations.at(rows)
        root = np.sqrt(part.weight)[:, None]
        used = np.append(used, size)
        by_pose = part.by_pose * root
        wide = np.concatenate([part.by_global[:, used[:-1]], part.residual[:, None]], 1) * root
        corner[np.ix_(used, used)] += wide.T @ wide
        for k, (own, _) in enumerate(_by_frame(part, frames)):
            if len(own):
                blocks[k] += by_pose[own].T @ by_pose[own]
                mixed[k][:, used] += by_pose[own].T @ wide[own]
    band, pull, motion_misfit = _band(blocks, motion)
    mixed[:, :, -1] += pull
    factor = cholesky_banded(band, lower=True, check_finite=False)
    flat = mixed.reshape(-1, size + 1)
    solved = cho_solve_banded((factor, True), flat, check_finite=False)
    corner = corner - flat.T @ solved
    by_global = solved.reshape(frames, POSE, size + 1)
    return Reduced(
        (corner[:-1, :-1] + corner[:-1, :-1].T) / 2, -corner[:-1, -1], float(corner[-1, -1]) + motion_misfit,
        by_global[..., :-1], -by_global[..., -1],
    )  # fmt: skip


def _band(blocks: Float, motion: MotionPrior) -> tuple[Float, Float, float]:
    """Return the poses' information in lower banded form, the prior's pull (N, 6), and its sum of squares."""
    frames = len(blocks)
    full = np.zeros((frames, _REACH, POSE, POSE))
    full[:, 0] = blocks
    pull = np.zeros((frames, POSE))
    for i in range(_REACH):
        np.add.at(pull, motion.frame[:, i], motion.by_pose[:, i] * (motion.weight * motion.residual)[:, None])
        for j in range(i + 1):
            part = np.einsum("s,si,sj->sij", motion.weight, motion.by_pose[:, i], motion.by_pose[:, j])
            np.add.at(full[:, i - j], motion.frame[:, j], part)
    largest = np.einsum("nii->ni", full[:, 0]).max(axis=0, initial=0.0)
    full[:, 0] += np.diag(_HOLD * (1 + largest))
    band = np.zeros((POSE * _REACH, POSE * frames))
    row, column = np.meshgrid(np.arange(POSE), np.arange(POSE), indexing="ij")
    for gap in range(_REACH):
        below = POSE * gap + row - column
        use = below >= 0
        for k in range(frames - gap):
            band[below[use], POSE * k + column[use]] = full[k, gap][use]
    return band, pull, float(np.sum(motion.weight * motion.residual**2))


@dataclass(frozen=True)
class OwnUnknowns:
    """Globals that belong to the recording alone.

    Attributes
    ----------
    out, kept : (O,), (K,) int
        Places of these globals, and of all others.
    prior, pull, value : (O,)
        Information of their prior, its product with their present value, and this value.
    """

    out: Int
    kept: Int
    prior: Float
    pull: Float
    value: Float


@dataclass(frozen=True)
class Left:
    """What is left after elimination.

    Attributes
    ----------
    information, right : (K, K), (K,)
    misfit : float
    follow : (G, K)
        How all globals follow those kept.
    step : (G,)
        Step of those eliminated, the others staying.
    """

    information: Float
    right: Float
    misfit: float
    follow: Float
    step: Float


def eliminate_globals(reduced: Reduced, own: OwnUnknowns) -> Left:
    """Eliminate the recording's own globals."""
    information, right = reduced.information, reduced.right
    factor = cho_factor(information[np.ix_(own.out, own.out)] + np.diag(own.prior))
    response = cho_solve(factor, information[np.ix_(own.out, own.kept)])
    pulled = right[own.out] - own.pull
    best = cho_solve(factor, pulled)
    follow, step = np.zeros((len(right), len(own.kept))), np.zeros(len(right))
    follow[own.kept, np.arange(len(own.kept))] = 1
    follow[own.out], step[own.out] = -response, best
    left = information[np.ix_(own.kept, own.kept)] - information[np.ix_(own.kept, own.out)] @ response
    misfit = reduced.misfit + float(own.value @ own.pull - pulled @ best)
    return Left((left + left.T) / 2, right[own.kept] - response.T @ pulled, misfit, follow, step)


def score_inflation(equations: Equations, reduced: Reduced, left: Left, group: Int) -> Float:
    """Return (K,) by how much the scores' true 1 σ exceeds that of independent errors, at least 1.

    Columns of one ``group`` (K,) are one effect: what they explain together is no error of theirs, else a
    large effect would hide itself. −1 is none.
    """
    pose_by_kept = reduced.pose_by_global @ left.follow
    follow, step = np.zeros((len(equations.frame), left.follow.shape[1])), np.zeros(len(equations.frame))
    for rows, used in _by_kind(equations):
        by_used = equations.by_global[np.ix_(rows, used)]
        follow[rows], step[rows] = by_used @ left.follow[used], by_used @ left.step[used]
    for k, (own, by_pose) in enumerate(_by_frame(equations, len(pose_by_kept))):
        follow[own] -= by_pose @ pose_by_kept[k]
        step[own] += by_pose @ (reduced.pose_step[k] - reduced.pose_by_global[k] @ left.step)
    residual = equations.residual + step
    plain = equations.weight @ follow**2
    scores = follow * (equations.weight[:, None] * _unexplained(equations.weight, follow, residual, group))
    cells, frames = (np.unique(x, return_inverse=True)[1] for x in (equations.cell, equations.frame))
    both = np.unique(cells * (frames.max(initial=0) + 1) + frames, return_inverse=True)[1]
    robust = _clustered(scores, cells) + _clustered(scores, frames) - _clustered(scores, both)
    return np.asarray(np.sqrt(np.maximum(robust / np.maximum(plain, 1e-300), 1.0)))


def _unexplained(weight: Float, follow: Float, residual: Float, group: Int) -> Float:
    """Return (M, K) the residual that each column's own group leaves."""
    out = np.repeat(residual[:, None], follow.shape[1], axis=1)
    for own in (np.flatnonzero(group == g) for g in np.unique(group[group >= 0])):
        columns = follow[:, own]
        best = np.linalg.lstsq((columns.T * weight) @ columns, columns.T @ (weight * residual))[0]
        out[:, own] -= (columns @ best)[:, None]
    return out


def _by_kind(equations: Equations) -> Iterator[tuple[Int, Int]]:
    """Yield the rows of each kind and the globals that they depend on at all."""
    for kind in np.unique(equations.kind):
        rows = np.flatnonzero(equations.kind == kind)
        yield rows, np.flatnonzero(np.any(equations.by_global[rows] != 0, axis=0))


def _by_frame(equations: Equations, frames: int) -> Iterator[tuple[Int, Float]]:
    """Yield each frame's rows and their derivatives by its pose."""
    order = np.argsort(equations.frame, kind="stable")
    bounds = np.searchsorted(equations.frame[order], np.arange(frames + 1))
    for first, end in pairwise(bounds):
        yield order[first:end], equations.by_pose[order[first:end]]


def _clustered(scores: Float, place: Int) -> Float:
    count = int(place.max(initial=-1)) + 1
    member = csr_matrix((np.ones(len(place)), (place, np.arange(len(place)))), shape=(count, len(place)))
    summed = np.asarray(member @ scores)
    return np.asarray(np.square(summed).sum(0) * count / max(count - 1, 1))
