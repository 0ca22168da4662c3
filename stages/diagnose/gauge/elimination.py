"""Elimination of poses and other unknowns of one recording from its linearised measurements.

What is left is the evidence over the shared columns. B. Triggs et al., "Bundle adjustment: a modern
synthesis", 2000, § 6. Scores err alike in cells of wall and in frames: `pipeline.adjustment.robust`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from itertools import pairwise

import numpy as np

from pipeline.adjustment.bordered import Rows
from pipeline.adjustment.elimination import Sums, add_rows
from pipeline.adjustment.normal_equations import BandedCholesky, Marginal, marginalised
from pipeline.adjustment.robust import cluster_variance, degrees_of, two_way_variance
from pipeline.arrays import Bool, Float, Int
from stages.diagnose.gauge.near import beyond_cells

POSE = 6
RING, EDGE, ENCODER = 0, 1, 2
_REACH = 4
# Information, relative to that of the best determined pose, that keeps an undetermined pose in its place.
_HOLD = 1e-10
# The most by which errors are taken to be larger than what is left of them: where a frame has few cells, how
# many unknowns it has tells it roughly. Debt: data/debts.md.
_MOST_LOST = 4.0


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
    wall_mm : (M, 2)
        Where on the wall a ring's points lie, along and around; NaN for other kinds.
    """

    frame: Int
    by_pose: Float
    by_global: Float
    residual: Float
    weight: Float
    cell: Int
    kind: Int
    wall_mm: Float

    def of(self, part: Part) -> Equations:
        """Return the measurements of a part of the run."""
        use = part.frames[self.frame] & np.isin(self.kind, part.kinds)
        return self.at(np.flatnonzero(use))

    def at(self, rows: slice | Int) -> Equations:
        """Return the measurements at these rows."""
        return Equations(*(getattr(self, f.name)[rows] for f in fields(self)))


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
    taken : (N,)
        How many numbers of each pose its own measurements determine, its neighbours being known.
    """

    information: Float
    right: Float
    misfit: float
    pose_by_global: Float
    pose_step: Float
    taken: Float


def eliminate_poses(equations: Equations, motion: Rows, frames: int) -> Reduced:
    """Return the normal equations over the globals at the best poses.

    ``motion`` are equations of the poses alone, with 6 numbers a frame.
    """
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
        for k, (own, of_frame) in enumerate(_by_frame(part, frames)):
            if len(of_frame):
                blocks[k] += by_pose[own].T @ by_pose[own]
                mixed[k][:, used] += by_pose[own].T @ wide[own]
    band, pull = _band(blocks, motion)
    mixed[:, :, -1] += pull
    flat = mixed.reshape(-1, size + 1)
    solved = BandedCholesky.of_band(band).solve(flat)
    corner = corner - flat.T @ solved
    by_global = solved.reshape(frames, POSE, size + 1)
    misfit = float(corner[-1, -1] + motion.weight @ motion.residual**2)
    return Reduced(
        (corner[:-1, :-1] + corner[:-1, :-1].T) / 2, -corner[:-1, -1], misfit,
        by_global[..., :-1], -by_global[..., -1],
        np.trace(np.linalg.solve(band[:, 0], blocks), axis1=1, axis2=2),
    )  # fmt: skip


def _band(blocks: Float, motion: Rows) -> tuple[Float, Float]:
    """Return the poses' information as the block band of `BandedCholesky`, and the prior's pull (N, 6)."""
    sums = Sums.empty(len(blocks), 0, _REACH, POSE)
    add_rows(motion.frame, motion.by_frame, motion.by_border, motion.residual, motion.weight, *sums.arrays)
    sums.band[:, 0] += blocks
    largest = np.einsum("nii->ni", sums.band[:, 0]).max(axis=0, initial=0.0)
    sums.band[:, 0] += np.diag(_HOLD * (1 + largest))
    return sums.band, -sums.right.reshape(-1, POSE)


@dataclass(frozen=True)
class OwnUnknowns:
    """Globals that belong to the recording alone.

    Attributes
    ----------
    out : (O,) int
        Their places.
    prior, pull, value : (O,)
        Information of their prior, its product with their present value, and this value.
    """

    out: Int
    prior: Float
    pull: Float
    value: Float


def eliminate_globals(reduced: Reduced, own: OwnUnknowns) -> tuple[Marginal, float]:
    """Return what is left without the recording's own globals, and its misfit."""
    information, right = reduced.information.copy(), reduced.right.copy()
    information[own.out, own.out] += own.prior
    right[own.out] -= own.pull
    left = marginalised(information, right, own.out)
    return left, reduced.misfit + float(own.value @ own.pull) - left.gain


def score_inflation(
    equations: Equations, reduced: Reduced, left: Marginal, out: Int, group: Int, known: Float
) -> tuple[Float, Float]:
    """Return (K,) by how much the scores' true 1 σ exceeds that of independent errors, at least 1.

    The second, (K,), is how many degrees of freedom that has; infinite where it is 1.

    ``out`` (O,) are the globals that were eliminated, ``left`` what is left without them.
    Columns of one ``group`` (K,) are one effect: what they explain together is no error of theirs, else a
    large effect would hide itself. −1 is the instrument's, which follows effects as far as its information
    ``known`` (I, I) lets it: an effect's score is that of what the instrument cannot take up.
    """
    pose_by_kept = reduced.pose_by_global @ left.follow
    # An effect's column is gone through again and again, so that it lies in one piece.
    follow, step = np.zeros((left.follow.shape[1], len(equations.frame))), np.zeros(len(equations.frame))
    kept = np.setdiff1d(np.arange(len(left.step)), out)
    for rows, used in _by_kind(equations):
        gone = np.intersect1d(used, out)
        by_gone = equations.by_global[rows][:, gone]
        # What is kept follows itself alone.
        follow[:, rows] = (equations.by_global[rows][:, kept] + by_gone @ left.follow[gone]).T
        step[rows] = by_gone @ left.step[gone]
    for k, (own, by_pose) in enumerate(_by_frame(equations, len(pose_by_kept))):
        follow[:, own] -= (by_pose @ pose_by_kept[k]).T
        step[own] += by_pose @ (reduced.pose_step[k] - reduced.pose_by_global[k] @ left.step)
    free, asked = np.flatnonzero(group < 0), np.flatnonzero(group >= 0)
    taken_up = left.information[np.ix_(free, free)] + known
    follow[asked] -= np.linalg.solve(taken_up, left.information[np.ix_(free, asked)]).T @ follow[free]
    residual = equations.residual + step
    plain = follow**2 @ equations.weight
    left_over = _unexplained(equations.weight, follow, residual, group)
    by_row = np.ascontiguousarray((follow * equations.weight * left_over).T)
    lost = _lost(equations, reduced.taken)
    # What is independent from point to point loses next to nothing to the few unknowns of a frame.
    cells = cluster_variance(by_row * np.sqrt(lost)[:, None], equations.cell) - (lost - 1) @ by_row**2
    # Sums over frames lose nothing to poses, but a few frames may hold all of a score.
    robust = np.maximum(two_way_variance(by_row, equations.cell, equations.frame), cells)
    ring = np.flatnonzero((equations.kind == RING) & (equations.weight > 0))
    robust += beyond_cells(
        follow[:, ring], equations.weight[ring], left_over[:, ring], equations.wall_mm[ring]
    )
    ratio = robust / np.maximum(plain, 1e-300)
    return np.sqrt(np.maximum(ratio, 1.0)), np.where(ratio > 1, degrees_of(by_row, equations.cell), np.inf)


def _lost(equations: Equations, taken: Float) -> Float:
    """Return (M,) by how much errors that cells share have a larger variance than what a frame's fit leaves.

    A pose and the places of fiducials' edges follow what is alike in a cell: of n cells of a frame they take
    up as many as they have unknowns (J. MacKinnon, H. White, "Some heteroskedasticity-consistent covariance
    matrix estimators", 1985). Each edge's place is shared by the frames that see it.
    """
    used = (equations.weight > 0) & (equations.kind != ENCODER)
    pair, first = np.unique(np.stack([equations.frame, equations.cell])[:, used], axis=1, return_index=True)
    kind = equations.kind[used][first]
    seen, visits = np.unique(pair[1], return_counts=True)
    shared = np.where(kind == EDGE, 1 / visits[np.searchsorted(seen, pair[1])], 0.0)
    cells = np.maximum(np.bincount(pair[0], minlength=len(taken)), 1.0)
    gone = taken + np.bincount(pair[0], shared, minlength=len(taken))
    factor = cells / np.maximum(cells - gone, cells / _MOST_LOST)
    return np.where(equations.kind == ENCODER, 1.0, factor[equations.frame])


def _unexplained(weight: Float, follow: Float, residual: Float, group: Int) -> Float:
    """Return (K, M) the residual that each column's own group leaves; ``follow`` is (K, M) too."""
    out = np.tile(residual, (len(follow), 1))
    for own in (np.flatnonzero(group == g) for g in np.unique(group[group >= 0])):
        columns = follow[own]
        weighted = columns * weight
        out[own] -= np.linalg.lstsq(weighted @ columns.T, weighted @ residual)[0] @ columns
    return out


def _by_kind(equations: Equations) -> Iterator[tuple[slice | Int, Int]]:
    """Yield the rows of each kind and the globals that they depend on at all."""
    for kind in np.unique(equations.kind):
        rows = _without_copy(np.flatnonzero(equations.kind == kind))
        yield rows, np.flatnonzero(equations.by_global[rows].any(axis=0))


def _by_frame(equations: Equations, frames: int) -> Iterator[tuple[slice | Int, Float]]:
    """Yield each frame's rows and their derivatives by its pose."""
    order = np.argsort(equations.frame, kind="stable")
    bounds = np.searchsorted(equations.frame[order], np.arange(frames + 1))
    for first, end in pairwise(bounds):
        rows = _without_copy(order[first:end])
        yield rows, equations.by_pose[rows]


def _without_copy(rows: Int) -> slice | Int:
    """Return rows that follow one another as a slice, which copies nothing."""
    if len(rows) and rows[-1] - rows[0] == len(rows) - 1 and np.all(np.diff(rows) == 1):
        return slice(int(rows[0]), int(rows[-1]) + 1)
    return rows
