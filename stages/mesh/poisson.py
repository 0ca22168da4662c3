"""Screened Poisson surface of a cloud, for walls that are not a function of distance and azimuth.

M. Kazhdan, H. Hoppe, "Screened Poisson surface reconstruction", ACM TOG 2013, by open3d.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pipeline.artefacts import PointCloud
from pipeline.native import open3d
from stages.mesh.surface import Face, Float, Surface

_NEIGHBOURS = 20
_OUTLIER_SIGMA = 3.0
_LARGEST_DEPTH = 10
_AT_ONCE = 1 << 20


def folded_cells(cloud: PointCloud, cell_mm: float, fold: float) -> int:
    """Return in how many cells of the unrolled wall the radius takes several values.

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


def poisson_surface(
    xyz_p: Float, normal_p: Float, cell_mm: float, reach_mm: float, allowance_mm: float
) -> Surface:
    """Return the screened Poisson surface of points (N, 3) with normals (N, 3) toward the inside.

    Statistical outliers are left out first. Triangles further than ``reach_mm`` from every point are left
    out last, so that what was not seen stays a hole.
    """
    o3d = open3d()
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(xyz_p))
    cloud.normals = o3d.utility.Vector3dVector(normal_p)
    cloud, _ = cloud.remove_statistical_outlier(_NEIGHBOURS, _OUTLIER_SIGMA)
    points = np.asarray(cloud.points)
    depth = int(np.clip(np.ceil(np.log2(1.1 * np.ptp(points, axis=0).max() / cell_mm)), 5, _LARGEST_DEPTH))
    # One thread: with several the result depends on their timing.
    mesh, _ = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(cloud, depth=depth, n_threads=1)
    gap = cKDTree(points).query(np.asarray(mesh.vertices), distance_upper_bound=reach_mm)[0]
    near = np.asarray(gap) <= reach_mm
    return _part(np.asarray(mesh.vertices), np.asarray(mesh.triangles), near, allowance_mm)


def _part(vertex: Float, face: Face, near: NDArray[np.bool_], allowance_mm: float) -> Surface:
    """Return the faces whose corners are all near, vertices renumbered."""
    used, compact = np.unique(face[near[face].all(1)], return_inverse=True)
    count = len(used)
    corner = compact.reshape(-1, 3).astype(np.int32)
    return Surface(vertex[used], corner, np.full(count, allowance_mm), np.zeros(count, bool))
