"""Triangles of a regular grid by longest-edge bisection: as few as noise allows, and no gap between them.

A block of squares is two triangles; each is cut from its right angle to the middle of its longest side,
repeatedly, down to halves of single squares. The cuts that are worth their triangles are chosen as in the
pruning of regression trees (R. Willett, R. Nowak, "Platelets", 2003); cuts that a neighbour needs follow
(P. Lindstrom, V. Pascucci, "Visualization of large terrains made easy", 2001).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from pipeline.arrays import Bool, Float, Int, Int32

# A block spans at most 1/32 of the way around, 11°: its points are then a function over its own plane.
_LEAST_BLOCKS_AROUND = 32
_SQUARES_AT_ONCE = 1 << 19  # to limit memory
_MOMENTS = np.triu_indices(4)  # 1, x, y, z by pairs


@dataclass(frozen=True)
class Lattice:
    """Blocks of 2^``depth`` squares each way over a grid of ``rows`` × ``columns`` nodes, closed around.

    Level 0 are the two triangles of every block; each level has twice as many, the children of triangle t
    being 2t and 2t + 1. Nodes are numbered row by row; the last block may have rows that the grid has not.
    """

    rows: int
    columns: int

    @cached_property
    def depth(self) -> int:
        """Halvings of a block. 0 for an odd number of columns: every square is then two triangles."""
        even = (self.columns & -self.columns).bit_length() - 1
        return min(even, max(self.columns // _LEAST_BLOCKS_AROUND, 1).bit_length() - 1)

    @property
    def block(self) -> int:
        """Width and length of a block in squares."""
        return 1 << self.depth

    @property
    def finest(self) -> int:
        """Number of the last level."""
        return 2 * self.depth

    @property
    def blocks(self) -> tuple[int, int]:
        """Numbers of blocks along and around."""
        return max(1, -(-(self.rows - 1) // self.block)), self.columns // self.block

    @property
    def nodes(self) -> int:
        """Number of nodes, with those of rows that the grid has not."""
        return (self.blocks[0] * self.block + 1) * self.columns

    @cached_property
    def corner(self) -> list[Int32]:
        """Row and column in the block (T, 3, 2) of the corners of each level: right angle, then both ends."""
        n = self.block
        levels = [np.array([[[0, n], [0, 0], [n, n]], [[n, 0], [n, n], [0, 0]]], np.int32)]
        for _ in range(self.finest):
            apex, a, b = np.moveaxis(levels[-1], 1, 0)
            middle = (a + b) // 2
            halves = np.stack([np.stack([middle, b, apex], 1), np.stack([middle, apex, a], 1)], 1)
            levels.append(halves.reshape(-1, 3, 2))
        return levels

    def origin(self, along: slice) -> tuple[Int, Int]:
        """Return row and column (N,) of the first node of the blocks of some rows of blocks."""
        first, count = self.block * np.arange(self.blocks[0])[along], self.blocks[1]
        return np.repeat(first, count), np.tile(self.block * np.arange(count), len(first))

    def number(self, place: Int32, along: slice) -> Int:
        """Return the numbers (..., N) of nodes at rows and columns (..., 2) of blocks."""
        row, column = self.origin(along)
        found = (row * self.columns + column) + (place[..., :1] * self.columns + place[..., 1:])
        around = self.blocks[1]
        found[place[..., 1] == self.block, around - 1 :: around] -= self.columns
        return np.asarray(found)

    def of_blocks(self, along: slice) -> slice:
        """Return the blocks of some rows of blocks."""
        return slice(along.start * self.blocks[1], along.stop * self.blocks[1])

    def of_rows(self, along: slice) -> slice:
        """Return the nodes of some rows of blocks, the row that ends them among them."""
        first, last = along.start * self.block, along.stop * self.block + 1
        return slice(first * self.columns, last * self.columns)

    def slabs(self) -> list[slice]:
        """Return slices of some rows of blocks each."""
        at_once = max(1, _SQUARES_AT_ONCE // (self.columns * self.block))
        cut = [*range(0, self.blocks[0], at_once), self.blocks[0]]
        return [slice(a, b) for a, b in pairwise(cut)]


@dataclass(frozen=True)
class Cuts:
    """Which triangles of each level (T, N) are cut, and which cover measured squares only."""

    cut: list[Bool]
    whole: list[Bool]

    def leaves(self, level: int, blocks: slice) -> Bool:
        """Return which triangles (T, n) of a level make up the surface."""
        leaf = self.whole[level][:, blocks] & ~self.cut[level][:, blocks]
        return leaf & np.repeat(self.cut[level - 1][:, blocks], 2, axis=0) if level else leaf


def worthwhile(lattice: Lattice, xyz: Float, weight: Float, triangle_cost: float) -> Cuts:
    """Return the cuts of some blocks that reduce χ² by more than their triangles cost.

    ``xyz`` (n, n, N, 3) are the nodes of N blocks, x and y along the block's plane, and ``weight`` (n, n, N)
    their 1/σ², 0 where nothing was measured. χ² is that of a triangle's best plane.
    """
    count, corner = weight.shape[-1], lattice.corner[lattice.finest] @ np.array([lattice.block + 1, 1])
    whole = [(weight > 0).reshape(-1, count)[corner].all(1)]
    empty, cost, cut = ~whole[0], triangle_cost * whole[0], [np.zeros_like(whole[0])]
    moments = _moments(corner.reshape(-1, 6), xyz, weight)
    for _ in range(lattice.finest):
        whole.append(_pairs(whole[-1]).all(1))
        empty = _pairs(empty).all(1)
        own = np.where(whole[-1], _misfit(moments) + triangle_cost, np.inf)
        children = _pairs(cost).sum(1)
        cut.append((children < own) & ~empty)
        cost = np.where(empty, 0.0, np.minimum(children, own))
        moments = moments.reshape(len(moments), -1, 2, count).sum(2)
    return Cuts(cut[::-1], whole[::-1])


def without_gaps(lattice: Lattice, wanted: Cuts, vertex: Bool) -> Cuts:
    """Return the wanted cuts, those that they need elsewhere, and those at the nodes ``vertex`` (nodes,)."""
    vertex = vertex.copy()
    cut = [np.zeros_like(wanted.cut[-1])]
    for level in range(lattice.finest - 1, -1, -1):
        wish = wanted.cut[level] | _pairs(cut[-1]).any(1)
        middle = lattice.corner[level][:, 1:].sum(1) // 2
        for along in lattice.slabs():
            vertex[lattice.number(middle, along)[wish[:, lattice.of_blocks(along)]]] = True
        # The triangle on the other side of the longest side is cut at the same vertex.
        cut.append(np.concatenate([vertex[lattice.number(middle, s)] for s in lattice.slabs()], axis=1))
    return Cuts(cut[::-1], wanted.whole)


def triangles(lattice: Lattice, cuts: Cuts, measured: Bool, along: slice) -> Int:
    """Return the triangles (T, 3) of some rows of blocks as numbers of nodes, those beside holes included."""
    blocks = lattice.of_blocks(along)
    found = [
        np.moveaxis(lattice.number(corner, along), 1, 2)[cuts.leaves(level, blocks)]
        for level, corner in enumerate(lattice.corner)
    ]
    return np.concatenate([*found, beside_holes(lattice, measured, along)])


def beside_holes(lattice: Lattice, measured: Bool, along: slice) -> Int:
    """Return the remaining triangle (T, 3) of each square in which one end of the diagonal is a hole."""
    apex, a, b = np.moveaxis(lattice.corner[lattice.finest], 1, 0)
    once = (apex[:, 0] < (a + b - apex)[:, 0])[:, None]  # of the square's two triangles
    numbers = [lattice.number(place, along) for place in (apex, a, a + b - apex, b)]
    known = [measured[n] for n in numbers]
    ends = known[0] & known[2] & once
    without_a, without_b = ends & ~known[1] & known[3], ends & known[1] & ~known[3]
    return np.concatenate([
        np.stack([numbers[k][lacking] for k in kept], -1)
        for lacking, kept in ((without_a, (0, 2, 3)), (without_b, (0, 1, 2)))
    ])  # fmt: skip


def _pairs(level: NDArray[Any]) -> NDArray[Any]:
    """Return a level's values (T, N) as those of each parent's two children (T/2, 2, N)."""
    return level.reshape(-1, 2, level.shape[-1])


def _moments(corner: Int32, xyz: Float, weight: Float) -> Float:
    """Return the weighted sums (10, T, N) of 1, x, y, z by pairs over triangles with ``corner`` (T, 6) nodes.

    A node counts by a sixth in each of the six half squares that meet there, hence once inside a wall.
    """
    count = weight.shape[-1]
    share = csr_matrix(
        (np.full(corner.size, 1 / 6), corner.ravel(), np.arange(0, corner.size + 1, 6)),
        (len(corner), weight.size // count),
    )
    terms = [np.ones(weight.shape), *np.moveaxis(xyz, -1, 0)]
    of_nodes = [(weight * terms[i] * terms[j]).reshape(-1, count) for i, j in zip(*_MOMENTS, strict=True)]
    return np.asarray(np.stack([share @ m for m in of_nodes]))


def _misfit(moments: Float) -> Float:
    """Return the weighted sum of squares (T, N) of z about its best plane over x and y."""
    n, x, y, z, xx, xy, xz, yy, yz, zz = moments
    n = np.where(n > 0, n, 1.0)
    cxx, cxy, cyy = xx - x * x / n, xy - x * y / n, yy - y * y / n
    cxz, cyz, czz = xz - x * z / n, yz - y * z / n, zz - z * z / n
    determinant = cxx * cyy - cxy * cxy
    plane = (cyy * cxz**2 - 2 * cxy * cxz * cyz + cxx * cyz**2) / np.where(determinant > 0, determinant, 1.0)
    return np.asarray(np.maximum(czz - plane, 0.0))
