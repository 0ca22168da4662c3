"""Meshing against screened Poisson reconstruction by open3d and by pymeshlab, from the same points."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import pymeshlab
from matplotlib.axes import Axes
from scipy.ndimage import minimum_filter

from pipeline.artefacts.measured import WallTexture
from pipeline.artefacts.model import Overlays
from pipeline.geometry.axis import frames_at
from pipeline.system.native import open3d
from stages.mesh import MeshParameters, make_mesh
from stages.mesh.fitted import cells_of, fitted_surface
from tests.benchmarks.page.charts import COLOURS, bars, chart
from tests.benchmarks.page.inputs import Inputs
from tests.benchmarks.page.section import TIMES, Method, Quantity, Section, clocked
from tests.quiet import quiet_context
from tests.truth_comparison import wall_error

_CELL_MM, _SPARSE = 0.5, 0.01
_THINNED = (200_000, 100_000, 50_000, 20_000, 10_000)
_COSTS = (1.0, 3.0, 10.0, 30.0)
_SETUP = (
    "All methods get the same points and normals: boresight's wall cloud. Poisson cells are about 0.5 mm "
    "(octree depth by the cloud's extent); open3d's sparsest 1 % of vertices are cut off, as its "
    "documentation shows, pymeshlab's surface is taken as it comes.",
    "Rays go from the axis outward through the cells of the radius map that the laser saw with all their "
    "neighbours. A ray that meets no triangle within 5 mm of the true wall is a hole; the others' error is "
    "against the true wall. Boresight's time is that of its stage mesh, which also makes texture atlases and "
    "bakes photo and error colours.",
    "The curve shows the same error with fewer triangles: the others' surfaces decimated by their own "
    "library's quadrics, boresight's at several values of mesh.triangle_cost. What all share is the cloud's "
    "bias; the second chart leaves each surface's mean error out.",
)
_QUANTITIES = (
    Quantity("rms_um", "error against the true wall, rms", "µm"),
    Quantity("equal_um", "with as many triangles as boresight", "µm"),
    Quantity("p95_um", "95 % below", "µm"),
    Quantity("holes_percent", "holes", "%"),
    Quantity("triangles", "triangles", better=None),
    *TIMES,
)
_HOLE_MM, _EVERY = 5.0, 3

_Surface = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class _Rays:
    """Test rays, and the error of a hit at a given radius on each."""

    distance_mm: np.ndarray
    azimuth_rad: np.ndarray
    origin_p: np.ndarray
    direction_p: np.ndarray


def section(inputs: Inputs) -> Section:
    """Return the comparison."""
    rays, error = _rays(inputs), wall_error(inputs.wall.radius_map, inputs.folder)
    methods, curves = [], {}
    for name, surfaces in (
        ("boresight", _by_boresight(inputs)),
        ("open3d, screened Poisson", _by_open3d(inputs)),
        ("pymeshlab, screened Poisson", _by_pymeshlab(inputs)),
    ):
        with clocked() as spent:
            surface = next(surfaces)
        figures = _figures(surface, rays, error)
        curves[name] = [figures, *(_figures(s, rays, error) for s in surfaces)]
        equal = _at(curves[name], float(curves["boresight"][0]["triangles"]))
        methods.append(Method(name, figures | {"equal_um": equal} | spent.figures))
    return Section("mesh", "Meshing", _SETUP, _QUANTITIES, tuple(methods), _charts(methods, curves))


def _at(curve: list[dict[str, float]], triangles: float) -> float:
    """Return a curve's error at a number of triangles, interpolated over its logarithm."""
    points = sorted((np.log(c["triangles"]), c["rms_um"]) for c in curve)
    return float(np.interp(np.log(triangles), *zip(*points, strict=True)))


def _rays(inputs: Inputs) -> _Rays:
    radius_map = inputs.wall.radius_map
    measured = np.isfinite(radius_map.radius_mm)
    inside = minimum_filter(measured, 3, mode=("constant", "wrap"), cval=0)
    row, column = (i[::_EVERY] for i in np.nonzero(inside))
    s, psi = radius_map.distance_mm[row], radius_map.azimuth_rad[column]
    origin, frame = frames_at(inputs.wall.axis, s)
    direction = frame[:, :, 0] * np.cos(psi)[:, None] + frame[:, :, 1] * np.sin(psi)[:, None]
    return _Rays(s, psi, origin, direction)


def _figures(surface: _Surface, rays: _Rays, error: Callable[..., np.ndarray]) -> dict[str, float]:
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
        "spread_um": 1000 * float(np.std(off[~hole])),
        "p95_um": 1000 * float(np.percentile(np.abs(off[~hole]), 95)),
        "holes_percent": 100 * float(hole.mean()),
        "triangles": float(len(face)),
    }


def _by_boresight(inputs: Inputs) -> Iterator[_Surface]:
    """Yield the surface that the stage makes, then those for other costs of a triangle."""
    results, parameters = inputs.results, MeshParameters()
    made = make_mesh(inputs.wall, results[WallTexture], results[Overlays], parameters, quiet_context())
    yield _joined([(t.vertex_p, t.face) for t in made.tiles])
    cells = cells_of(inputs.wall, parameters.error_mm, parameters.noise_factor)
    for cost in _COSTS:
        (piece,) = fitted_surface(cells, inputs.wall.axis, 1, cost)
        yield piece.surface.vertex_p, piece.surface.face


def _joined(parts: list[_Surface]) -> _Surface:
    starts = np.cumsum([0, *(len(vertex) for vertex, _ in parts)])
    face = np.concatenate([f + s for (_, f), s in zip(parts, starts, strict=False)])
    return np.concatenate([vertex for vertex, _ in parts]), face


def _depth(inputs: Inputs) -> int:
    extent = np.ptp(inputs.cloud.xyz_p, axis=0).max()
    return int(np.ceil(np.log2(1.1 * extent / _CELL_MM)))


def _by_open3d(inputs: Inputs) -> Iterator[_Surface]:
    """Yield open3d's surface, then its simplifications to fewer triangles."""
    o3d = open3d()
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(inputs.cloud.xyz_p.astype(float)))
    cloud.normals = o3d.utility.Vector3dVector(inputs.cloud.normal_p.astype(float))
    mesh, density = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(cloud, depth=_depth(inputs))
    density = np.asarray(density)
    mesh.remove_vertices_by_mask(density < np.quantile(density, _SPARSE))
    yield np.asarray(mesh.vertices), np.asarray(mesh.triangles)
    for count in _THINNED:
        mesh = mesh.simplify_quadric_decimation(count)
        yield np.asarray(mesh.vertices), np.asarray(mesh.triangles)


def _by_pymeshlab(inputs: Inputs) -> Iterator[_Surface]:
    """Yield pymeshlab's surface, then its simplifications to fewer triangles."""
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(
        pymeshlab.Mesh(inputs.cloud.xyz_p.astype(float), v_normals_matrix=inputs.cloud.normal_p.astype(float))
    )
    # Its default of 16 threads takes minutes on two cores.
    cores = len(os.sched_getaffinity(0))
    meshes.generate_surface_reconstruction_screened_poisson(depth=_depth(inputs), threads=cores)
    yield meshes.current_mesh().vertex_matrix(), meshes.current_mesh().face_matrix()
    for count in _THINNED:
        meshes.meshing_decimation_quadric_edge_collapse(targetfacenum=count)
        yield meshes.current_mesh().vertex_matrix(), meshes.current_mesh().face_matrix()


def _charts(methods: list[Method], curves: dict[str, list[dict[str, float]]]) -> tuple[str, ...]:
    def draw(key: str) -> Callable[[Axes], None]:
        def on(axes: Axes) -> None:
            for colour, (name, curve) in zip(COLOURS, curves.items(), strict=False):
                points = sorted((c["triangles"], c[key]) for c in curve)
                axes.semilogx(*zip(*points, strict=True), "o-", color=colour, label=name)

        return on

    return (
        chart(draw("rms_um"), "Error against the true wall", "triangles", "rms, µm"),
        chart(draw("spread_um"), "The same, each surface's mean error left out", "triangles", "µm"),
        bars({m.name: m.figures["cpu_s"] for m in methods}, "Processor time", "s"),
    )
