"""Cuts meshes at a plane and joins two that end there, without a gap.

Both borders follow the same wall, a few hundredths of a millimetre apart. The course of the first border is
kept. The vertices of the second are moved onto it, and each border takes over the vertices of the other.
"""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

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
        Vertices that the neighbouring piece has too, with identical coordinates.
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


_SAME_MM = 0.02  # vertices closer than this along a border become one
# A border that runs once around a closed course travels one length of it. Whether it goes around once or not
# is decided half way between.
_CLOSED = 0.5


@dataclass(frozen=True)
class Course:
    """A closed border as a curve.

    Attributes
    ----------
    xyz_p : (N, 3)
        Its vertices.
    at_mm : (N + 1,)
        Length from the first vertex to each, and the whole length last.
    """

    xyz_p: Float
    at_mm: Float

    @property
    def length_mm(self) -> float:
        """Length once around."""
        return float(self.at_mm[-1])

    def points(self, at_mm: Float) -> Float:
        """Return the points (M, 3) at lengths (M,)."""
        closed = np.concatenate([self.xyz_p, self.xyz_p[:1]])
        return np.stack([np.interp(at_mm, self.at_mm, c) for c in closed.T], -1)

    def nearest(self, xyz_p: Float) -> tuple[Float, Float]:
        """Return length and distance (M,) of the nearest places to points (M, 3)."""
        closed = np.concatenate([self.xyz_p, self.xyz_p[:1]])
        vertex = np.asarray(cKDTree(self.xyz_p).query(xyz_p)[1], np.int64)
        sides = [self._on_side(closed, (vertex + k) % len(self.xyz_p), xyz_p) for k in (-1, 0)]
        (at_before, far_before), (at_after, far_after) = sides
        before = far_before < far_after
        return np.where(before, at_before, at_after), np.where(before, far_before, far_after)

    def _on_side(self, closed: Float, side: Index, xyz_p: Float) -> tuple[Float, Float]:
        start, along = closed[side], closed[side + 1] - closed[side]
        share = np.einsum("mi,mi->m", xyz_p - start, along) / np.maximum((along**2).sum(1), 1e-30)
        share = np.clip(share, 0, 1)
        far = np.linalg.norm(start + share[:, None] * along - xyz_p, axis=1)
        return self.at_mm[side] + share * (self.at_mm[side + 1] - self.at_mm[side]), far


def course_of(mesh: OpenMesh, vertices: Index) -> Course:
    """Return the curve through the vertices of a closed border."""
    xyz = mesh.vertex_p[vertices]
    steps = np.linalg.norm(np.roll(xyz, -1, axis=0) - xyz, axis=1)
    return Course(xyz, np.concatenate([[0.0], np.cumsum(steps)]))


def join(
    first: OpenMesh, first_cut: Cut, second: OpenMesh, second_cut: Cut, apart_mm: float
) -> tuple[OpenMesh, OpenMesh, int]:
    """Return both meshes with shared borders, and the number of borders unmatched within ``apart_mm``."""
    theirs = {k: loop for k, loop in enumerate(second_cut.loops())}
    open_borders = 0
    for mine in first_cut.loops():
        course = course_of(first, first_cut.start[mine])
        found = next(
            (k for k, loop in theirs.items() if _belongs(course, second, second_cut, loop, apart_mm)), None
        )
        if found is None:
            open_borders += 1
            continue
        first, second = _zipped(course, (first, first_cut, mine), (second, second_cut, theirs.pop(found)))
    return first, second, open_borders + len(theirs)


def _belongs(course: Course, mesh: OpenMesh, cut: Cut, loop: Index, apart_mm: float) -> bool:
    """Return whether a border runs along a course, once around and against its direction."""
    at, far = course.nearest(mesh.vertex_p[cut.start[loop]])
    return float(np.median(far)) <= apart_mm and abs(_travelled(at, course) / course.length_mm + 1) < _CLOSED


def _travelled(at_mm: Float, course: Course) -> float:
    return float(_steps(at_mm, course.length_mm).sum())


def _steps(at_mm: Float, length_mm: float) -> Float:
    """Return the shorter distance (N,) from each place on a closed course to the next, mm."""
    return np.asarray((np.roll(at_mm, -1) - at_mm + length_mm / 2) % length_mm - length_mm / 2)


_Border = tuple[OpenMesh, Cut, Index]


def _zipped(course: Course, first: _Border, second: _Border) -> tuple[OpenMesh, OpenMesh]:
    """Return both meshes with one sequence of vertices along the course."""
    mesh, cut, loop = second
    back = loop[::-1]  # it runs opposite to the course
    at = _onward(course, mesh.vertex_p[cut.start[back]])
    knots, theirs = _knots(course, at)
    mine = np.searchsorted(knots, course.at_mm[:-1])
    gap = first[0].gap_mm[first[1].start[first[2]]]
    gap = np.interp(knots, course.at_mm, np.append(gap, gap[0]))
    points = course.points(knots)
    return _refined(first, mine, points, gap, 1), _refined(second, theirs[::-1], points, gap, -1)


def _onward(course: Course, xyz_p: Float) -> Float:
    """Return the places on the course, mm, of points (M, 3), never decreasing from one to the next."""
    at, far = course.nearest(xyz_p)
    start = int(np.argmin(far))
    at = np.roll(at, -start)
    steps = _steps(at, course.length_mm)
    way = np.maximum.accumulate(at[0] + np.concatenate([[0.0], np.cumsum(steps[:-1])]))
    return np.roll(np.minimum(way, at[0] + course.length_mm) % course.length_mm, start)


def _knots(course: Course, at_mm: Float) -> tuple[Float, Index]:
    """Return the places on the course (K,) at which both borders get a vertex, and the indices of ``at_mm``.

    Places next to a vertex of the course, or to each other, are one.
    """
    knots = list(course.at_mm[:-1])
    for place in np.sort(at_mm):
        k = bisect_left(knots, place)
        behind, ahead = knots[k - 1], knots[k] if k < len(knots) else course.length_mm
        if min(place - behind, ahead - place) > _SAME_MM:
            knots.insert(k, float(place))
    found = np.array([*knots, course.length_mm])
    after = np.clip(np.searchsorted(found, at_mm), 1, len(found) - 1)
    nearer = np.where(at_mm - found[after - 1] <= found[after] - at_mm, after - 1, after)
    return found[:-1], nearer % len(knots)


def _refined(border: _Border, knot: Index, points: Float, gap_mm: Float, way: int) -> OpenMesh:
    """Return a mesh whose border runs through all ``points``; its vertices take the places ``knot``.

    ``way`` is +1 where the border's edges go from knot to higher knot, else −1.
    """
    mesh, cut, loop = border
    base, renumbered = len(mesh.vertex_p), np.arange(len(mesh.vertex_p))
    renumbered[cut.start[loop]] = base + knot
    face, more = renumbered[mesh.face], []
    for edge, first, last in zip(loop, knot, np.roll(knot, -1), strict=True):
        chain = (first + way * np.arange((way * (last - first)) % len(points) + 1)) % len(points)
        apex = np.full(max(len(chain) - 1, 0), cut.apex[edge])
        fan = np.stack([base + chain[:-1], base + chain[1:], apex], -1)
        face[cut.face[edge]] = fan[0] if len(fan) else cut.apex[edge]
        more.append(fan[1:])
    return replace(
        mesh, vertex_p=np.concatenate([mesh.vertex_p, points]), gap_mm=np.concatenate([mesh.gap_mm, gap_mm]),
        face=np.concatenate([face, *more]),
        joined=np.concatenate([mesh.joined, np.ones(len(points), bool)]),
    )  # fmt: skip
