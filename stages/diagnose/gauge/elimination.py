"""Eliminate poses and other unknowns of one recording from its linearised measurements.

The result is the evidence over the shared columns. B. Triggs et al., "Bundle adjustment: a modern synthesis",
2000, § 6.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from itertools import pairwise

import numpy as np
from scipy.sparse import csr_array

from pipeline.adjustment.elimination import Sums, add_rows
from pipeline.adjustment.normal_equations import BandedCholesky, Marginal, marginalised
from pipeline.adjustment.rows import Rows
from pipeline.arrays import Bool, Float, Int

POSE = 6
RING, EDGE, ENCODER = 0, 1, 2
_REACH = 4
# Information, relative to that of the best determined pose, that holds an undetermined pose in place.
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
    by_global : (M, G − E)
        Derivatives by the globals that any measurement may depend on.
    residual, weight : (M,)
        Of rings and edges in px, of the encoder in mm.
    cell : (M,) int
        Measurements of one cell have correlated errors.
    kind : (M,) int
        `RING`, `EDGE` or `ENCODER`.
    wall_mm : (M, 2)
        Place of a ring's point on the wall, along and around; NaN for other kinds.
    edge : (M,) int
        Index, among all globals, of the measured edge of a fiducial; −1 where there is none.
    by_edge : (M,)
        Derivative by the shift of that edge.
    edges : slice
        Indices of the E shifts of edges among all G globals.
    """

    frame: Int
    by_pose: Float
    by_global: Float
    residual: Float
    weight: Float
    cell: Int
    kind: Int
    wall_mm: Float
    edge: Int
    by_edge: Float
    edges: slice

    @property
    def size(self) -> int:
        """Number of globals."""
        return int(self.by_global.shape[1] + self.edges.stop - self.edges.start)

    @property
    def place(self) -> Int:
        """Indices (G − E,) of the columns of ``by_global`` among all globals."""
        return np.setdiff1d(np.arange(self.size), np.arange(self.edges.start, self.edges.stop))

    def of(self, part: Part) -> Equations:
        """Return the measurements of a part of the run."""
        use = part.frames[self.frame] & np.isin(self.kind, part.kinds)
        return self.at(np.flatnonzero(use))

    def at(self, rows: slice | Int) -> Equations:
        """Return the measurements at these rows."""
        return replace(
            self, **{f.name: getattr(self, f.name)[rows] for f in fields(self) if f.name != "edges"}
        )


def of_no_edge(count: int) -> tuple[Int, Float, slice]:
    """Return the last fields of `Equations` for ``count`` measurements that are not of a fiducial's edge."""
    return np.full(count, -1), np.zeros(count), slice(0, 0)


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


def eliminate_poses(equations: Equations, motion: Rows, frames: int) -> Reduced:
    """Return the normal equations over the globals with the poses at their optimum.

    ``motion`` are equations of the poses alone, 6 parameters per frame.
    """
    size, place = equations.size, equations.place
    corner = np.zeros((size + 1, size + 1))
    blocks, mixed = np.zeros((frames, POSE, POSE)), np.zeros((frames, POSE, size + 1))
    for rows, used in by_kind(equations):
        part = equations.at(rows)
        root = np.sqrt(part.weight)[:, None]
        at = np.append(place[used], size)
        by_pose = part.by_pose * root
        wide = np.concatenate([part.by_global[:, used], part.residual[:, None]], 1) * root
        corner[np.ix_(at, at)] += wide.T @ wide
        for k, (own, of_frame) in enumerate(by_frame(part, frames)):
            if len(of_frame):
                blocks[k] += by_pose[own].T @ by_pose[own]
                mixed[k][:, at] += by_pose[own].T @ wide[own]
    _add_edges(equations, corner, mixed)
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


def by_kind(equations: Equations) -> Iterator[tuple[slice | Int, Int]]:
    """Yield the rows of each kind, and the globals that they depend on."""
    for kind in np.unique(equations.kind):
        rows = _without_copy(np.flatnonzero(equations.kind == kind))
        yield rows, np.flatnonzero(equations.by_global[rows].any(axis=0))


def by_frame(equations: Equations, frames: int) -> Iterator[tuple[slice | Int, Float]]:
    """Yield each frame's rows, and their derivatives by its pose."""
    order = np.argsort(equations.frame, kind="stable")
    bounds = np.searchsorted(equations.frame[order], np.arange(frames + 1))
    for first, end in pairwise(bounds):
        rows = _without_copy(order[first:end])
        yield rows, equations.by_pose[rows]


def _without_copy(rows: Int) -> slice | Int:
    """Return consecutive rows as a slice, which copies nothing."""
    if len(rows) and rows[-1] - rows[0] == len(rows) - 1 and np.all(np.diff(rows) == 1):
        return slice(int(rows[0]), int(rows[-1]) + 1)
    return rows
