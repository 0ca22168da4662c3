"""A short drawn pipe for tests of the model: oval, with a pit, straight or bent, with or without a hole."""

from __future__ import annotations

import numpy as np

from pipeline.artefacts.measured import PointCloud, RadiusMap, Wall, WallTexture
from pipeline.geometry.axis import PipeAxis, axis_through, from_pipe, straight_axis, to_pipe

RADIUS = 25.0
PIT = (22.0, 1.0, 1.2, 2.0)  # distance mm, azimuth rad, depth mm, 1 σ mm


def bent_axis(curvature_per_mm: float) -> PipeAxis:
    """Return an arc in the x-z plane from distance −40 to 120 mm."""
    s = np.arange(-40.0, 121.0, 2.0)
    angle = s * curvature_per_mm
    origin = np.stack([(1 - np.cos(angle)) / curvature_per_mm, 0 * s, np.sin(angle) / curvature_per_mm], -1)
    return axis_through(origin, np.array([1.0, 0.0, 0.0]), -40.0)


def drawn_radius(distance_mm: np.ndarray, azimuth_rad: np.ndarray) -> np.ndarray:
    """Return the radius of the wall: an oval with one Gaussian pit."""
    at, around, depth, width = PIT
    turn = (azimuth_rad - around + np.pi) % (2 * np.pi) - np.pi
    far2 = (distance_mm - at) ** 2 + (RADIUS * turn) ** 2
    return RADIUS + 0.3 * np.cos(2 * (azimuth_rad - 0.4)) + depth * np.exp(-far2 / (2 * width**2))


def small_wall(
    *,
    axis: PipeAxis | None = None,
    noise_mm: float = 0.0,
    length_mm: float = 50.0,
    hole: tuple[slice, slice] | None = None,
    columns: int = 360,
) -> Wall:
    """Return a wall with a row each 0.5 mm; rows and columns ``hole`` are unmeasured."""
    axis = axis or straight_axis(-40.0, 120.0)
    distance = np.arange(0.0, length_mm + 0.25, 0.5)
    azimuth = -np.pi + np.arange(columns) * 2 * np.pi / columns
    radius = drawn_radius(distance[:, None], azimuth)
    radius = radius + noise_mm * np.random.default_rng(1).standard_normal(radius.shape)
    if hole is not None:
        radius[hole] = np.nan
    sigma = np.where(np.isfinite(radius), noise_mm, np.nan).astype(np.float32)
    total = np.where(np.isfinite(radius), 0.05, np.nan).astype(np.float32)
    misalignment = np.where(np.isfinite(radius), 0.2 * np.cos(azimuth), np.nan).astype(np.float32)
    count = np.isfinite(radius).astype(np.int64)
    radius_map = RadiusMap(distance, azimuth, radius.astype(np.float32), total, sigma, count, misalignment)
    return Wall(cloud_of(axis, radius_map), radius_map, axis)


def cloud_of(axis: PipeAxis, radius_map: RadiusMap) -> PointCloud:
    """Return a point for each measured cell."""
    row, column = np.nonzero(np.isfinite(radius_map.radius_mm))
    s, psi, r = radius_map.distance_mm[row], radius_map.azimuth_rad[column], radius_map.radius_mm[row, column]
    xyz = from_pipe(axis, s, psi, r.astype(float))
    normal = from_pipe(axis, s, psi, r.astype(float) - 1) - xyz
    sigma, frame = np.full(len(s), 0.02, np.float32), row.astype(np.int64)
    columns = (xyz, normal, sigma, r, s, psi)
    return PointCloud(*(c.astype(np.float32) for c in columns), frame)


def smooth_photo(distance_from_mm: float = -2.0, length_mm: float = 60.0) -> WallTexture:
    """Return a photo whose blue follows distance and whose green and red follow azimuth, smooth at ±π."""
    rows, columns = round(length_mm / 0.2), 800
    s = distance_from_mm + 0.2 * np.arange(rows)
    psi = -np.pi + (np.arange(columns) + 0.5) * 2 * np.pi / columns
    bgra = np.empty((rows, columns, 4), np.uint8)
    bgra[..., 0] = np.rint(60 + 2 * (s - distance_from_mm))[:, None]
    bgra[..., 1], bgra[..., 2] = np.rint(128 + 90 * np.cos(psi)), np.rint(128 + 90 * np.sin(psi))
    bgra[..., 3] = 255
    return WallTexture(bgra, distance_from_mm, 0.2, float(psi[0]), 2 * np.pi / columns)


def tee(points: int = 24000, length_mm: float = 50.0, noise_mm: float = 0.0) -> tuple[PointCloud, PipeAxis]:
    """Cloud of a pipe of radius 25 mm with a branch of radius 12 mm toward +x in its middle."""
    random = np.random.default_rng(0)
    psi, z = random.uniform(-np.pi, np.pi, points), random.uniform(0, length_mm, points)
    middle = length_mm / 2
    run = np.stack([25 * np.cos(psi), 25 * np.sin(psi), z], -1)
    mouth = (np.hypot(run[:, 1], z - middle) < 12) & (run[:, 0] > 0)
    t, x = random.uniform(-np.pi, np.pi, points // 4), random.uniform(20, 42, points // 4)
    branch = np.stack([x, 12 * np.sin(t), middle + 12 * np.cos(t)], -1)
    beyond = np.hypot(branch[:, 0], branch[:, 1]) >= 25
    xyz = np.concatenate([run[~mouth], branch[beyond]])
    inward = [-run[~mouth] / 25 * [1, 1, 0], (np.stack([0 * t, -np.sin(t), -np.cos(t)], -1))[beyond]]
    xyz = xyz + noise_mm * random.standard_normal(xyz.shape)
    axis = straight_axis(-40.0, length_mm + 70.0)
    s, azimuth, r = to_pipe(axis, xyz)
    sigma, frame = np.full(len(s), 0.02), np.zeros(len(s), np.int64)
    columns = (xyz, np.concatenate(inward), sigma, r, s, azimuth)
    return PointCloud(*(c.astype(np.float32) for c in columns), frame), axis
