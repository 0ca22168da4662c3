"""Decimation by quadric edge collapse, its largest error measured and kept below the bound."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyfqmr

from pipeline.arrays import Bool, Float
from pipeline.system.native import open3d
from stages.mesh.surface import Surface

# Decimation that removes less than a tenth of the triangles is not worth its time.
_WORTHWHILE = 0.9
_AGGRESSIVENESS = 5.0  # growth of the allowed collapse error: 7 errs 7 % more, 3 does not reach its goal


@dataclass(frozen=True)
class Decimated:
    """A decimated surface and its error: largest and mean square distance of the original's vertices."""

    surface: Surface
    original_faces: int
    original_vertices: int
    largest_error_mm: float
    mean_square_mm2: float


def decimate(original: Surface, target_faces: int) -> Decimated:
    """Return ``original`` with about ``target_faces`` triangles, or more where its allowance asks for it.

    The distance of every original vertex from the new surface is measured (one-sided Hausdorff distance), and
    that of the new vertices from the original, as a collapse on a flat wall may throw a vertex far along it.
    Where one is larger than its vertex' allowance, the original is decimated again, half as much; if nothing
    is left to take away, the original itself is returned.
    """
    goal = target_faces
    while goal < _WORTHWHILE * len(original.face):
        found = _collapse(original, goal)
        distance = distance_to_surface(original.vertex_p, found)
        back = distance_to_surface(found.vertex_p, original)
        if np.all(distance <= original.allowance_mm) and np.all(back <= original.allowance_mm.max()):
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
    """Return the surface with about ``goal`` faces; vertices at its borders stay where they are.

    M. Garland, P. Heckbert, "Surface simplification using quadric error metrics", 1997, by pyfqmr. It keeps
    its mesh in variables of the process: one call at a time.
    """
    simplifier = pyfqmr.Simplify()
    simplifier.setMesh(surface.vertex_p, surface.face)
    simplifier.simplify_mesh(
        target_count=goal, aggressiveness=_AGGRESSIVENESS, preserve_border=True, verbose=False
    )
    vertex, face, _ = simplifier.getMesh()
    return Surface(vertex, face, np.zeros(len(vertex)), _those_of(vertex, surface.vertex_p[surface.locked]))


def _those_of(vertex_p: Float, locked_p: Float) -> Bool:
    """Return which vertices (V,) are among the locked ones (L, 3): they have not moved at all."""
    locked = {tuple(v) for v in locked_p}
    return np.array([tuple(v) in locked for v in vertex_p], bool)
