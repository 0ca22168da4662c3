"""Screened Poisson surface of a cloud, for walls that are not a function of distance and azimuth.

M. Kazhdan, H. Hoppe, "Screened Poisson surface reconstruction", ACM TOG 2013, by pymeshlab.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from pipeline.arrays import Float, Int
from pipeline.artefacts.cloud_along import CloudAlong
from pipeline.artefacts.measured import PointCloud
from pipeline.geometry.axis import PipeAxis, frames_at
from pipeline.system.native import open3d
from stages.mesh.join import NO_CUT, NOTHING, OpenMesh, clip, join
from stages.mesh.surface import Surface

# Neighbours and σ of open3d's statistical outlier filter, as its documentation proposes. Debt:
# data/debts.md.
_NEIGHBOURS = 20
_OUTLIER_SIGMA = 3.0
# See `piece_cuts`: a deeper octree would take more memory than a machine has.
_LARGEST_DEPTH = 10
_BOX = 1.1  # the solver's box over the points'
# Points are accurate to a small part of a cell: they get more weight than the usual 4.
_POINT_WEIGHT = 10.0
# Points processed at a time, to limit memory.
_AT_ONCE = 1 << 20
# Fewer points than this make no surface. Debt: data/debts.md.
_LEAST_POINTS = 100
_APART_MM = 1.0  # borders farther apart than this do not belong to one wall
# Overlap of pieces, so that the surface at a cut does not depend on the end of the points.
OVERLAP_MM = 25.0


def folded_cells(cloud: PointCloud, cell_mm: float, fold: float) -> int:
    """Return the number of cells of the unrolled wall in which the radius has several values.

    Such cells, ``cell_mm`` wide and long, hold points whose radii differ by more than ``fold`` times the
    median radius: a branch, say, or a lifted flap.
    """
    if len(cloud.radius_mm) == 0:
        return 0
    count = len(cloud.radius_mm)
    radius = float(np.median(cloud.radius_mm[:: max(count // _AT_ONCE, 1)]))
    columns = max(8, round(2 * np.pi * radius / cell_mm))
    start, end = float(cloud.distance_mm.min()), float(cloud.distance_mm.max())
    cells = (int((end - start) / cell_mm) + 1) * columns
    low, high = np.full(cells, np.inf, np.float32), np.full(cells, -np.inf, np.float32)
    for first in range(0, count, _AT_ONCE):
        part = slice(first, first + _AT_ONCE)
        row = np.floor((cloud.distance_mm[part] - start) / cell_mm).astype(np.int64)
        turn = (cloud.azimuth_rad[part] + np.pi) / (2 * np.pi)
        cell = row * columns + np.floor(turn * columns).astype(np.int64) % columns
        np.minimum.at(low, cell, cloud.radius_mm[part])
        np.maximum.at(high, cell, cloud.radius_mm[part])
    return int(np.count_nonzero(high - low > fold * radius))


def piece_cuts(first_mm: float, last_mm: float, tile_mm: float, cell_mm: float) -> Float:
    """Return the distances (n + 1,) at which a surface is cut: no piece exceeds the finest octree.

    A deeper one would take more memory than a machine has; a longer piece would get larger cells.
    """
    finest = 2**_LARGEST_DEPTH * cell_mm / _BOX
    longest = max(finest - 2 * OVERLAP_MM, tile_mm)
    return np.linspace(first_mm, last_mm, max(1, int(np.ceil((last_mm - first_mm) / longest))) + 1)


def joined_pieces(
    along: CloudAlong, axis: PipeAxis, cuts_mm: Float, reconstruct: Callable[[PointCloud], OpenMesh]
) -> Iterator[tuple[OpenMesh, int]]:
    """Yield the surface from each of ``cuts_mm`` (n + 1,) to the next, neighbours joined without a gap.

    With each piece comes the number of borders at its end that could not be joined to the next piece. Two
    pieces are held in memory at a time.
    """
    before, border, last = NOTHING, NO_CUT, len(cuts_mm) - 2
    for k, (start, end) in enumerate(pairwise(cuts_mm)):
        cloud = along.between(start - OVERLAP_MM, end + OVERLAP_MM)
        mesh = reconstruct(cloud) if len(cloud.frame) >= _LEAST_POINTS else NOTHING
        if k > 0:
            mesh, begin = clip(mesh, *_plane(axis, start, 1.0))
            before, mesh, unjoined = join(before, border, mesh, begin, _APART_MM)
            yield before, unjoined
        if k < last:
            mesh, border = clip(mesh, *_plane(axis, end, -1.0))
        before = mesh
    yield before, 0


def _plane(axis: PipeAxis, distance_mm: float, way: float) -> tuple[Float, Float]:
    """Return a point of the cross-section at a distance, and its normal along the pipe or against it."""
    origin, rotation = frames_at(axis, np.array(distance_mm))
    return origin, way * rotation[:, 2]


def poisson_surface(xyz_p: Float, normal_p: Float, cell_mm: float, reach_mm: float) -> OpenMesh:
    """Return the screened Poisson surface of points (N, 3) with normals (N, 3) toward the inside.

    Statistical outliers are left out first.
    """
    import pymeshlab  # slow to import, and most walls do not fold over

    kept = _without_outliers(xyz_p)
    points = xyz_p[kept]
    depth = int(np.clip(np.ceil(np.log2(_BOX * np.ptp(points, axis=0).max() / cell_mm)), 5, _LARGEST_DEPTH))
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(points, v_normals_matrix=normal_p[kept]))
    # One thread: with several the result depends on their timing.
    meshes.generate_surface_reconstruction_screened_poisson(
        depth=depth, scale=_BOX, pointweight=_POINT_WEIGHT, threads=1
    )
    mesh = meshes.current_mesh()
    vertex, far = mesh.vertex_matrix(), 2 * reach_mm
    gap = np.minimum(cKDTree(points).query(vertex, distance_upper_bound=far)[0], far)
    return OpenMesh(vertex, gap, mesh.face_matrix().astype(np.int64), np.zeros(len(vertex), bool))


def _without_outliers(xyz_p: Float) -> Int:
    o3d = open3d()
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(xyz_p))
    _, kept = cloud.remove_statistical_outlier(_NEIGHBOURS, _OUTLIER_SIGMA)
    return np.asarray(kept, np.int64)


def seen_part(mesh: OpenMesh, reach_mm: float) -> Surface:
    """Return the triangles within ``reach_mm`` of a measured point: unseen wall stays a hole."""
    corners = mesh.face
    whole = (np.roll(corners, 1, axis=1) != corners).all(1)
    used, compact = np.unique(corners[whole & (mesh.gap_mm <= reach_mm)[corners].all(1)], return_inverse=True)
    corner = compact.reshape(-1, 3).astype(np.int32)
    return Surface(mesh.vertex_p[used], corner, mesh.joined[used])
