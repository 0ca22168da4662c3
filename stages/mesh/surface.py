"""Triangle surfaces: joined, with normals, and decimated with the largest error measured."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pyfqmr
from numpy.typing import NDArray

from pipeline.arrays import Bool, Float
from pipeline.system.native import open3d

Face = NDArray[np.int32]
Index = NDArray[np.int64]
# Decimation that removes less than a tenth of the triangles is not worth its time.
_WORTHWHILE = 0.9
_AGGRESSIVENESS = 5.0  # growth of the allowed collapse error: 7 errs 7 % more, 3 does not reach its goal


@dataclass(frozen=True)
class Surface:
    """Triangles in P.

    Attributes
    ----------
    vertex_p : (V, 3)
        mm.
    face : (T, 3) int32
        Counter-clockwise seen from inside the pipe.
    locked : (V,) bool
        Vertices that decimation must keep, because the neighbouring piece has them too.
    """

    vertex_p: Float
    face: Face
    locked: Bool


def weld(pieces: Sequence[Surface]) -> Surface:
    """Return the pieces as one surface, the border vertices they share merged, unused vertices dropped."""
    starts = np.cumsum([0, *(len(p.vertex_p) for p in pieces)])
    vertex = np.concatenate([p.vertex_p for p in pieces])
    face = np.concatenate([p.face + s for p, s in zip(pieces, starts, strict=False)])
    border = np.flatnonzero(np.concatenate([p.locked for p in pieces]))
    _, first, same = np.unique(vertex[border], axis=0, return_index=True, return_inverse=True)
    target = np.arange(len(vertex))
    target[border] = border[first[same.ravel()]]
    used, compact = np.unique(target[face], return_inverse=True)
    face = compact.reshape(-1, 3).astype(np.int32)
    return Surface(vertex[used], face, np.zeros(len(used), bool))


def vertex_normals(surface: Surface) -> Float:
    """Return unit normals (V, 3) of the vertices, toward the inside of the pipe: by the triangles' areas.

    To import open3d for these alone would take ten times as long.
    """
    a, b, c = surface.vertex_p[surface.face.T]
    twice_the_area = np.cross(b - a, c - a)
    corner, count = surface.face.ravel(), len(surface.vertex_p)
    total = np.stack([np.bincount(corner, np.repeat(n, 3), count) for n in twice_the_area.T], -1)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.asarray(total / np.maximum(length, np.finfo(float).tiny))


def with_normals(pieces: Iterable[Surface]) -> Iterator[tuple[Surface, Float]]:
    """Yield pieces with their vertices' normals (V, 3), which are smooth from piece to piece.

    Unused vertices and pieces without triangles are dropped. Pieces must be given in order; three are held in
    memory at a time.
    """
    before: Surface | None = None
    this: Surface | None = None
    for after in pieces:
        if this is not None:
            yield from _with_neighbours(before, this, after)
            before = this
        this = after
    if this is not None:
        yield from _with_neighbours(before, this, None)


def _with_neighbours(
    before: Surface | None, this: Surface, after: Surface | None
) -> Iterator[tuple[Surface, Float]]:
    own = _compact(this)
    if len(own.face):
        # Its own vertices come first and keep their order.
        both = weld([own, *(_at_border(p) for p in (before, after) if p is not None)])
        yield own, vertex_normals(both)[: len(own.vertex_p)]


def _compact(surface: Surface) -> Surface:
    """Return the surface without the vertices that no triangle uses."""
    used, face = np.unique(surface.face, return_inverse=True)
    corner = face.reshape(-1, 3).astype(np.int32)
    return Surface(surface.vertex_p[used], corner, surface.locked[used])


def _at_border(piece: Surface) -> Surface:
    """Return the triangles of a piece that touch its neighbours."""
    touching = piece.locked[piece.face].any(axis=1)
    return replace(piece, face=piece.face[touching])


@dataclass(frozen=True)
class Decimated:
    """A surface of fewer triangles, the original's size, and the distance of its vertices from the new one.

    ``largest_error_mm`` and ``mean_square_mm2`` are the largest and the mean square distance.
    """

    surface: Surface
    original_faces: int
    original_vertices: int
    largest_error_mm: float
    mean_square_mm2: float


def decimate(original: Surface, target_faces: int, allowance_mm: float) -> Decimated:
    """Return ``original`` with about ``target_faces`` triangles, or more if the allowance requires it.

    The distance of every original vertex from the new surface is measured (one-sided Hausdorff distance), and
    that of the new vertices from the original, as a collapse on a flat wall may move a vertex far along it.
    If one exceeds the allowance, the original is decimated again to twice as many triangles; if that removes
    less than a tenth of them, the original itself is returned.
    """
    goal = target_faces
    while goal < _WORTHWHILE * len(original.face):
        found = _collapse(original, goal)
        distance = distance_to_surface(original.vertex_p, found)
        back = distance_to_surface(found.vertex_p, original)
        if max(distance.max(), back.max()) <= allowance_mm:
            return _decimated(original, found, distance)
        goal *= 2
    return _decimated(original, original, np.zeros(len(original.vertex_p)))


def distance_to_surface(xyz_p: Float, surface: Surface) -> Float:
    """Return the distance (N,), mm, of points (N, 3) from the nearest point of a surface."""
    centre = surface.vertex_p.mean(axis=0)
    scene = open3d().t.geometry.RaycastingScene()
    scene.add_triangles((surface.vertex_p - centre).astype(np.float32), surface.face.astype(np.uint32))
    return np.asarray(scene.compute_distance((xyz_p - centre).astype(np.float32)).numpy().astype(float))


def _decimated(original: Surface, found: Surface, distance: Float) -> Decimated:
    return Decimated(
        found,
        len(original.face),
        len(original.vertex_p),
        float(distance.max(initial=0.0)),
        float(np.mean(distance**2)) if len(distance) else 0.0,
    )


def _collapse(surface: Surface, goal: int) -> Surface:
    """Return the surface with about ``goal`` faces; vertices at its borders are not moved.

    M. Garland, P. Heckbert, "Surface simplification using quadric error metrics", 1997, by pyfqmr. It keeps
    its mesh in variables of the process: one call at a time.
    """
    simplifier = pyfqmr.Simplify()
    simplifier.setMesh(surface.vertex_p, surface.face)
    simplifier.simplify_mesh(
        target_count=goal, aggressiveness=_AGGRESSIVENESS, preserve_border=True, verbose=False
    )
    vertex, face, _ = simplifier.getMesh()
    return Surface(vertex, face, _those_of(vertex, surface.vertex_p[surface.locked]))


def _those_of(vertex_p: Float, locked_p: Float) -> Bool:
    """Return which vertices (V,) are among the locked ones (L, 3): they have not moved at all."""
    locked = {tuple(v) for v in locked_p}
    return np.array([tuple(v) in locked for v in vertex_p], bool)
