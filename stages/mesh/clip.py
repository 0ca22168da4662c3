"""A triangle mesh clipped by a plane, and the borders that the clip leaves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Bool, Float
from stages.mesh.surface import Index

Face = NDArray[np.int64]


@dataclass(frozen=True)
class OpenMesh:
    """Triangles whose borders are about to be joined.

    Attributes
    ----------
    vertex_p : (V, 3)
        mm.
    gap_mm : (V,)
        Distance of each vertex from the nearest measured point.
    face : (T, 3) int
        Counter-clockwise seen from inside the pipe.
    joined : (V,) bool
        Vertices that the neighbouring piece has too, to the bit.
    """

    vertex_p: Float
    gap_mm: Float
    face: Face
    joined: Bool


@dataclass(frozen=True)
class Cut:
    """The border that a clip left.

    Attributes
    ----------
    start, end : (E,) int
        Vertices of its edges, in the direction in which their triangles have them.
    apex : (E,) int
        Third vertex of the triangle at each edge.
    face : (E,) int
        Number of that triangle.
    """

    start: Index
    end: Index
    apex: Index
    face: Index

    def loops(self) -> list[Index]:
        """Return the closed borders, each as the numbers of its edges in order; open ones are left out."""
        follower = {int(v): k for k, v in enumerate(self.start)}
        left, loops = set(range(len(self.start))), []
        while left:
            first = min(left)
            loop = [first]
            left.discard(first)
            edge = follower.get(int(self.end[first]))
            while edge is not None and edge in left:
                loop.append(edge)
                left.discard(edge)
                edge = follower.get(int(self.end[edge]))
            if edge == first and len(loop) > 2:
                loops.append(np.array(loop))
        return loops


def clip(mesh: OpenMesh, origin_p: Float, normal: Float) -> tuple[OpenMesh, Cut]:
    """Return the part of a mesh on the side of a plane to which its normal points, and the border there."""
    height = (mesh.vertex_p - origin_p) @ normal
    inside = height[mesh.face] >= 0
    count = inside.sum(1)
    tips = _turned(mesh.face[count == 1], inside[count == 1])
    stumps = _turned(mesh.face[count == 2], ~inside[count == 2])
    sides = np.concatenate([tips[:, [0, 1]], tips[:, [0, 2]], stumps[:, [0, 1]], stumps[:, [0, 2]]])
    edges, which = np.unique(np.sort(sides, axis=1), axis=0, return_inverse=True)
    number = len(mesh.vertex_p) + which.ravel()
    tip_b, tip_c = number[: len(tips)], number[len(tips) : 2 * len(tips)]
    stump_b, stump_c = np.split(number[2 * len(tips) :], 2)
    whole = mesh.face[count == 3]
    face = np.concatenate([
        whole, np.stack([tips[:, 0], tip_b, tip_c], -1),
        np.stack([stump_b, stumps[:, 2], stump_c], -1), np.stack([stump_b, stumps[:, 1], stumps[:, 2]], -1),
    ])  # fmt: skip
    cut = Cut(
        np.concatenate([tip_b, stump_c]), np.concatenate([tip_c, stump_b]),
        np.concatenate([tips[:, 0], stumps[:, 2]]), len(whole) + np.arange(len(tips) + len(stumps)),
    )  # fmt: skip
    share = (height[edges[:, 0]] / (height[edges[:, 0]] - height[edges[:, 1]]))[:, None]
    vertex = (1 - share) * mesh.vertex_p[edges[:, 0]] + share * mesh.vertex_p[edges[:, 1]]
    gap = (1 - share[:, 0]) * mesh.gap_mm[edges[:, 0]] + share[:, 0] * mesh.gap_mm[edges[:, 1]]
    clipped = OpenMesh(
        np.concatenate([mesh.vertex_p, vertex]), np.concatenate([mesh.gap_mm, gap]), face,
        np.concatenate([mesh.joined, np.zeros(len(edges), bool)]),
    )  # fmt: skip
    return clipped, cut


def _turned(face: Face, chosen: Bool) -> Face:
    """Return triangles (T, 3) turned so that the corner that is ``chosen``, one of each, comes first."""
    first = np.argmax(chosen, axis=1)
    return np.asarray(np.take_along_axis(face, (first[:, None] + np.arange(3)) % 3, axis=1))


NOTHING = OpenMesh(np.empty((0, 3)), np.empty(0), np.empty((0, 3), np.int64), np.empty(0, bool))
NO_CUT = Cut(*(np.empty(0, np.int64) for _ in range(4)))
