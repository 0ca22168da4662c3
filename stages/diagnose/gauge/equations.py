"""Measurements of a gauge run as linear equations, by frame and kind."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from itertools import pairwise

import numpy as np

from pipeline.arrays import Bool, Float, Int

RING, EDGE, ENCODER = KINDS = 0, 1, 2


@dataclass(frozen=True)
class Part:
    """Some frames (N,) of a run, and some kinds of its measurements."""

    frames: Bool
    kinds: tuple[int, ...] = KINDS


@dataclass(frozen=True)
class InCourses:
    """Columns of the globals as laws times a factor of the frame: many courses share few laws.

    Attributes
    ----------
    law : (C,) int
        Column of the law in `Equations.by_global`.
    factor : (K, N, C)
        By kind of measurement and frame.
    """

    law: Int
    factor: Float

    @property
    def known(self) -> Bool:
        """Whether (K, N) all factors are known: a frame without a point in view has no distance."""
        return np.asarray(np.isfinite(self.factor).all(axis=-1))

    def where_known(self) -> InCourses:
        """Return the same columns, 0 in frames whose factors are not known."""
        return InCourses(self.law, np.where(self.known[..., None], self.factor, 0.0))

    @staticmethod
    def plain(law: Int, frames: int) -> InCourses:
        """Return laws (C,) as they are."""
        return InCourses(law, np.ones((len(KINDS), frames, len(law))))

    @staticmethod
    def joined(parts: Sequence[InCourses]) -> InCourses:
        """Return the columns of all parts, one after the other."""
        factor = np.concatenate([p.factor for p in parts], axis=-1)
        return InCourses(np.concatenate([p.law for p in parts]), factor)


@dataclass(frozen=True)
class Equations:
    """Weighted scalar measurements, each of one frame.

    Attributes
    ----------
    frame : (M,) int
    by_pose : (M, 6)
    by_global : (M, G − E)
        Derivatives by the globals that any measurement may depend on; of laws only, where there are courses.
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
    courses : InCourses or None
        The G − E columns, if they are not those of ``by_global`` as they are.
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
    courses: InCourses | None = None

    @property
    def size(self) -> int:
        """Number of globals."""
        columns = self.by_global.shape[1] if self.courses is None else len(self.courses.law)
        return int(columns + self.edges.stop - self.edges.start)

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
        return replace(self, **{name: getattr(self, name)[rows] for name in BY_ROW})

    def in_full(self) -> Equations:
        """Return the same equations with a column for each course of each law."""
        if self.courses is None:
            return self
        by_global = self.by_global[:, self.courses.law] * self.courses.factor[self.kind, self.frame]
        return replace(self, by_global=by_global, courses=None)


BY_ROW = frozenset(f.name for f in fields(Equations)) - {"edges", "courses"}


def of_no_edge(count: int) -> tuple[Int, Float, slice]:
    """Return the last fields of `Equations` for ``count`` measurements that are not of a fiducial's edge."""
    return np.full(count, -1), np.zeros(count), slice(0, 0)


def by_kind(equations: Equations) -> Iterator[tuple[slice | Int, Int]]:
    """Yield the rows of each kind, consecutive ones as a slice, and the globals that they depend on."""
    for kind in np.unique(equations.kind):
        own = np.flatnonzero(equations.kind == kind)
        consecutive = own[-1] - own[0] == len(own) - 1
        rows = slice(int(own[0]), int(own[-1]) + 1) if consecutive else own
        yield rows, np.flatnonzero(equations.by_global[rows].any(axis=0))


def by_frame(equations: Equations, frames: int) -> Iterator[tuple[Int, Float]]:
    """Yield each frame's rows, and their derivatives by its pose."""
    order = np.argsort(equations.frame, kind="stable")
    bounds = np.searchsorted(equations.frame[order], np.arange(frames + 1))
    for first, end in pairwise(bounds):
        yield order[first:end], equations.by_pose[order[first:end]]
