"""Decimation by quadric edge collapse, its largest error measured and kept below the bound."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pymeshlab
from numpy.typing import NDArray

from pipeline.native import open3d
from stages.mesh.surface import Face, Float, Surface

_WORTHWHILE = 0.9


@dataclass(frozen=True)
class Decimated:
    """A decimated surface and what it costs: largest and mean square distance of the original's vertices."""

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
    """Return the surface with about ``goal`` faces; faces at locked vertices stay.

    Every parameter is stated, as pymeshlab takes those left out from its previous call.
    """
    free = ~surface.locked[surface.face].any(axis=1)
    mesh = pymeshlab.Mesh(surface.vertex_p, surface.face, f_scalar_array=free.astype(float)[:, None])
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(mesh)
    meshes.compute_selection_by_condition_per_face(condselect="fq > 0.5")
    meshes.meshing_decimation_quadric_edge_collapse(
        targetfacenum=goal,
        targetperc=0.0,
        qualitythr=0.3,
        preserveboundary=True,
        boundaryweight=1.0,
        preservenormal=True,
        preservetopology=True,
        optimalplacement=True,
        planarquadric=True,
        planarweight=0.001,
        qualityweight=False,
        autoclean=False,
        selected=True,
    )
    return _surface_of(meshes.current_mesh(), surface)


def _surface_of(mesh: pymeshlab.Mesh, before: Surface) -> Surface:
    """Return pymeshlab's mesh; locked vertices are found again as those of faces that were not free."""
    vertex: Float = mesh.vertex_matrix()
    face: Face = mesh.face_matrix().astype(np.int32)
    kept: NDArray[np.bool_] = mesh.face_scalar_array() < 0.5
    locked = np.zeros(len(vertex), bool)
    if kept.any():
        before_locked = {tuple(v) for v in before.vertex_p[before.locked]}
        corners = np.unique(face[kept])
        locked[corners] = [tuple(v) in before_locked for v in vertex[corners]]
    return Surface(vertex, face, np.zeros(len(vertex)), locked)
