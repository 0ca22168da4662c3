"""Eliminate poses and other unknowns of one recording from its linearised measurements.

The result is the evidence over the shared columns. B. Triggs et al., "Bundle adjustment: a modern synthesis",
2000, § 6.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numba
import numpy as np
from scipy.sparse import csr_array

from pipeline.adjustment.elimination import Sums, add_rows
from pipeline.adjustment.normal_equations import BandedCholesky, Marginal, marginalised
from pipeline.adjustment.rows import Rows
from pipeline.arrays import Float, Int
from stages.diagnose.gauge.equations import Equations, InCourses, Part, by_kind

POSE = 6
_REACH = 4
# Information, relative to that of the best determined pose, that holds an undetermined pose in place.
_HOLD = 1e-10


@dataclass(frozen=True)
class Reduced:
    """Normal equations over the globals, with the poses eliminated.

    Attributes
    ----------
    information, right, misfit
        Over all G globals, without any prior on them.
    pose_by_global : (N, 6, G)
        Response of poses to the globals: δpose = δpose₀ − pose_by_global · δglobal.
    pose_step : (N, 6)
    taken : (N,)
        Number of parameters of each pose that its own measurements determine, given its neighbours.
    """

    information: Float
    right: Float
    misfit: float
    pose_by_global: Float
    pose_step: Float
    taken: Float


@dataclass(frozen=True)
class OfKind:
    """Sums of the weighted measurements of one kind over each of F frames.

    Attributes
    ----------
    frame : (F,) int
    used : (U,) int
        The columns of `Equations.by_global` that they depend on; the residual follows them in what is below.
    products, by_pose, pose : (F, U + 1, U + 1), (F, 6, U + 1), (F, 6, 6)
    """

    kind: int
    frame: Int
    used: Int
    products: Float
    by_pose: Float
    pose: Float

    @staticmethod
    def of(kind: int, part: Equations, used: Int) -> OfKind:
        """Return the sums of measurements of one kind."""
        order = np.argsort(part.frame, kind="stable")
        root = np.sqrt(part.weight[order])[:, None]
        wide = np.concatenate([part.by_global[np.ix_(order, used)], part.residual[order, None]], 1) * root
        pose = part.by_pose[order] * root
        frame, first = np.unique(part.frame[order], return_index=True)
        products = np.zeros((len(frame), wide.shape[1], wide.shape[1]))
        by_pose, of_pose = np.zeros((len(frame), POSE, wide.shape[1])), np.zeros((len(frame), POSE, POSE))
        for k, (begin, end) in enumerate(pairwise([*first, len(order)])):
            own, turned = wide[begin:end], pose[begin:end].T
            products[k], by_pose[k], of_pose[k] = own.T @ own, turned @ own, turned @ pose[begin:end]
        return OfKind(kind, frame, used, products, by_pose, of_pose)

    def add(self, part: Part, courses: InCourses, place: Int, corner: Float, mixed: Float) -> None:
        """Add the sums over a part of the run to the normal equations of the globals and poses.

        ``place`` (C,) are the indices of the columns among the globals; the residual is the last.
        """
        here = np.flatnonzero(part.frames[self.frame] & (self.kind in part.kinds))
        shown = np.flatnonzero(np.isin(courses.law, self.used))
        law = np.append(np.searchsorted(self.used, courses.law[shown]), len(self.used))
        at = np.append(place[shown], len(corner) - 1)
        factor = np.ones((len(here), len(at)))
        factor[:, :-1] = courses.factor[self.kind][np.ix_(self.frame[here], shown)]
        total = np.zeros((len(at), len(at)))
        _spread(self.products[here], factor, law, total)
        corner[np.ix_(at, at)] += total
        by_pose = self.by_pose[here][:, :, law] * factor[:, None]
        mixed[np.ix_(self.frame[here], np.arange(POSE), at)] += by_pose


@numba.njit(cache=True, nogil=True)
def _spread(products, factor, law, out):  # type: ignore[no-untyped-def]
    """Add to ``out`` (C, C) the products (F, U, U) of C courses' laws (C,) times their factors (F, C)."""
    for k in range(len(products)):
        for i in range(len(law)):
            for j in range(len(law)):
                out[i, j] += products[k, law[i], law[j]] * factor[k, i] * factor[k, j]


@dataclass(frozen=True)
class FrameSums:
    """Measurements summed over each frame: whatever whole frames and kinds are asked about later."""

    equations: Equations
    kinds: tuple[OfKind, ...]

    @staticmethod
    def of(equations: Equations) -> FrameSums:
        """Return the sums of all measurements."""
        each = ((equations.at(rows), used) for rows, used in by_kind(equations))
        return FrameSums(equations, tuple(OfKind.of(int(part.kind[0]), part, used) for part, used in each))

    @cached_property
    def courses(self) -> InCourses:
        """The columns; where there are no courses, each as it is."""
        columns, frames = self.equations.by_global.shape[1], int(self.equations.frame.max(initial=0)) + 1
        return self.equations.courses or InCourses.plain(np.arange(columns), frames)

    def reduced(self, motion: Rows, part: Part) -> Reduced:
        """Return the normal equations over the globals of a part of the run, with its poses at the optimum.

        ``motion`` are equations of the poses alone, 6 parameters per frame.
        """
        frames = len(part.frames)
        size, place = self.equations.size, self.equations.place
        corner, mixed = np.zeros((size + 1, size + 1)), np.zeros((frames, POSE, size + 1))
        blocks = np.zeros((frames, POSE, POSE))
        for one in self.kinds:
            one.add(part, self.courses, place, corner, mixed)
            here = part.frames[one.frame] & (one.kind in part.kinds)
            blocks[one.frame[here]] += one.pose[here]
        _add_edges(self._of_edges(part), corner, mixed)
        return _without_poses(corner, mixed, blocks, motion)

    def _of_edges(self, part: Part) -> Equations:
        """Return the measurements of fiducials' edges in a part of the run."""
        use = (self.equations.edge >= 0) & part.frames[self.equations.frame]
        use &= np.isin(self.equations.kind, part.kinds)
        return self.equations.at(np.flatnonzero(use)).in_full()


def eliminate_poses(equations: Equations, motion: Rows, frames: int) -> Reduced:
    """Return `FrameSums.reduced` of all measurements."""
    return FrameSums.of(equations).reduced(motion, Part(np.ones(frames, bool)))


def _without_poses(corner: Float, mixed: Float, blocks: Float, motion: Rows) -> Reduced:
    """Return the equations of the globals; ``blocks`` (N, 6, 6) and ``mixed`` are those of the poses."""
    frames, _, size = mixed.shape
    band, pull = _band(blocks, motion)
    mixed[:, :, -1] += pull
    flat = mixed.reshape(-1, size)
    solved = BandedCholesky.of_band(band).solve(flat)
    corner = corner - flat.T @ solved
    by_global = solved.reshape(frames, POSE, size)
    misfit = float(corner[-1, -1] + motion.weight @ motion.residual**2)
    return Reduced(
        (corner[:-1, :-1] + corner[:-1, :-1].T) / 2, -corner[:-1, -1], misfit,
        by_global[..., :-1], -by_global[..., -1],
        np.trace(np.linalg.solve(band[:, 0], blocks), axis1=1, axis2=2),
    )  # fmt: skip


def _add_edges(equations: Equations, corner: Float, mixed: Float) -> None:
    """Add the edges' shifts to the normal equations of the globals, and to those with the poses."""
    at, place, count = equations.edges, np.append(equations.place, equations.size), len(mixed)
    rows = np.flatnonzero(equations.edge >= 0)
    edge, frame = equations.edge[rows] - at.start, equations.frame[rows]
    number, edges = np.arange(len(rows)), at.stop - at.start
    weighted = equations.by_edge[rows] * equations.weight[rows]
    wide = np.concatenate([equations.by_global[rows], equations.residual[rows, None]], 1)
    by_rest = csr_array((weighted, (edge, number)), (edges, len(rows))) @ wide
    corner[at, place] += by_rest
    corner[place, at] += by_rest.T
    corner[at, at] += np.diag(np.bincount(edge, weighted * equations.by_edge[rows], edges))
    by_pose = csr_array((weighted, (frame * edges + edge, number)), (count * edges, len(rows)))
    of_frames = (by_pose @ equations.by_pose[rows]).reshape(count, edges, POSE)
    mixed[:, :, at] += np.swapaxes(of_frames, 1, 2)


def _band(blocks: Float, motion: Rows) -> tuple[Float, Float]:
    """Return the poses' information as a band for `BandedCholesky`, and the prior's right side (N, 6)."""
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
        Their indices.
    prior, pull, value : (O,)
        Information of their prior, its product with the present value, and that value.
    """

    out: Int
    prior: Float
    pull: Float
    value: Float


def eliminate_globals(reduced: Reduced, own: OwnUnknowns) -> tuple[Marginal, float]:
    """Return the evidence without the recording's own globals, and its misfit."""
    information, right = reduced.information.copy(), reduced.right.copy()
    information[own.out, own.out] += own.prior
    right[own.out] -= own.pull
    left = marginalised(information, right, own.out)
    return left, reduced.misfit + float(own.value @ own.pull) - left.gain
