"""Meshing against screened Poisson reconstruction by open3d and by pymeshlab, from the same points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pymeshlab

from pipeline.artefacts.model import TexturedMesh
from pipeline.geometry.axis import frames_at
from pipeline.system.native import open3d
from tests.benchmarks.page.charts import bars
from tests.benchmarks.page.inputs import Inputs
from tests.benchmarks.page.section import TIMES, Method, Quantity, Section, clocked
from tests.truth_comparison import wall_error

_CELL_MM, _SPARSE = 0.5, 0.01
_SETUP = (
    "All methods get the same points and normals: boresight's wall cloud. Poisson cells are about 0.5 mm "
    "(octree depth by the cloud's extent); open3d's sparsest 1 % of vertices are cut off, as its "
    "documentation shows, pymeshlab's surface is taken as it comes.",
    "Rays go from the axis outward through the cells of the radius map that the laser saw. A ray that meets "
    "no triangle within 5 mm of the true wall is a hole; the others' error is against the true wall. "
    "Boresight's time is that of its stage mesh, which also makes texture atlases and bakes photo and error "
    "colours; its triangles are after decimation, the others' as reconstructed.",
)
_QUANTITIES = (
    Quantity("rms_um", "error against the true wall, rms", "µm"),
    Quantity("p95_um", "95 % below", "µm"),
    Quantity("holes_percent", "holes", "%"),
    Quantity("triangles", "triangles"),
    *TIMES,
)
_HOLE_MM, _EVERY = 5.0, 3


@dataclass(frozen=True)
class _Rays:
    """Where rays go, and which error a hit at a radius has."""

    distance_mm: np.ndarray
    azimuth_rad: np.ndarray
    origin_p: np.ndarray
    direction_p: np.ndarray


def section(inputs: Inputs) -> Section:
    """Return the comparison."""
    rays, error = _rays(inputs), wall_error(inputs.wall.radius_map, inputs.folder)
    own = _own(inputs.results[TexturedMesh])
    methods = [Method("boresight", _figures(own, rays, error) | {"wall_s": inputs.stage_seconds["mesh"]})]
    for name, reconstruct in (
        ("open3d, screened Poisson", _by_open3d),
        ("pymeshlab, screened Poisson", _by_pymeshlab),
    ):
        with clocked() as spent:
            surface = reconstruct(inputs)
        methods.append(Method(name, _figures(surface, rays, error) | spent.figures))
    return Section("mesh", "Meshing", _SETUP, _QUANTITIES, tuple(methods), _charts(methods))


def _rays(inputs: Inputs) -> _Rays:
    radius_map = inputs.wall.radius_map
    row, column = (i[::_EVERY] for i in np.nonzero(np.isfinite(radius_map.radius_mm)))
    s, psi = radius_map.distance_mm[row], radius_map.azimuth_rad[column]
    origin, frame = frames_at(inputs.wall.axis, s)
    direction = frame[:, :, 0] * np.cos(psi)[:, None] + frame[:, :, 1] * np.sin(psi)[:, None]
    return _Rays(s, psi, origin, direction)


def _figures(surface, rays: _Rays, error) -> dict[str, float | None]:
    vertex, face = surface
    o3d = open3d()
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(vertex.astype(np.float32), face.astype(np.uint32))
    beam = np.concatenate([rays.origin_p, rays.direction_p], 1).astype(np.float32)
    radius = scene.cast_rays(beam)["t_hit"].numpy().astype(float)
    off = error(rays.distance_mm, rays.azimuth_rad, np.where(np.isfinite(radius), radius, 0.0))
    hole = ~np.isfinite(radius) | (np.abs(off) > _HOLE_MM)
    return {
        "rms_um": 1000 * float(np.sqrt(np.mean(off[~hole] ** 2))),
        "p95_um": 1000 * float(np.percentile(np.abs(off[~hole]), 95)),
        "holes_percent": 100 * float(hole.mean()),
        "triangles": float(len(face)),
    }


def _own(mesh: TexturedMesh):
    starts = np.cumsum([0, *(len(t.vertex_p) for t in mesh.tiles)])
    face = np.concatenate([t.face + s for t, s in zip(mesh.tiles, starts, strict=False)])
    return np.concatenate([t.vertex_p for t in mesh.tiles]), face


def _depth(inputs: Inputs) -> int:
    extent = np.ptp(inputs.cloud.xyz_p, axis=0).max()
    return int(np.ceil(np.log2(1.1 * extent / _CELL_MM)))


def _by_open3d(inputs: Inputs):
    o3d = open3d()
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(inputs.cloud.xyz_p.astype(float)))
    cloud.normals = o3d.utility.Vector3dVector(inputs.cloud.normal_p.astype(float))
    mesh, density = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(cloud, depth=_depth(inputs))
    density = np.asarray(density)
    mesh.remove_vertices_by_mask(density < np.quantile(density, _SPARSE))
    return np.asarray(mesh.vertices), np.asarray(mesh.triangles)


def _by_pymeshlab(inputs: Inputs):
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(
        pymeshlab.Mesh(inputs.cloud.xyz_p.astype(float), v_normals_matrix=inputs.cloud.normal_p.astype(float))
    )
    meshes.generate_surface_reconstruction_screened_poisson(depth=_depth(inputs))
    mesh = meshes.current_mesh()
    return mesh.vertex_matrix(), mesh.face_matrix()


def _charts(methods: list[Method]) -> tuple[str, ...]:
    return (
        bars({m.name: m.figures["rms_um"] for m in methods}, "Error against the true wall", "rms, µm"),
        bars({m.name: m.figures["wall_s"] for m in methods}, "Time", "s"),
    )
