"""Accumulation: ring points and trajectory to a cloud and the wall's radius over distance and azimuth."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from pipeline.artefacts import PointCloud, RadiusMap, RingPoints, RingSamples, Trajectory, Wall
from pipeline.errors import UnusableError
from pipeline.instrument.probe import Probe
from pipeline.stage import Context, Parameters, Stage
from stages.accumulate.calibration import calibration_sigma
from stages.accumulate.centring import centred
from stages.accumulate.grid import gridded, map_grid, rings_on_columns
from stages.accumulate.samples import WallSamples, wall_samples

__all__ = ["ACCUMULATE", "AccumulateParameters", "accumulate_wall"]

Float = NDArray[np.float64]


class AccumulateParameters(Parameters):
    """Parameters of the accumulate stage."""

    distance_step_mm: float = Field(0.5, ge=0.05, le=10, description="row spacing, mm, of the radius map")
    azimuth_samples: int = Field(720, ge=90, le=5760, description="columns of the radius map")
    smoothing_mm: float = Field(
        0.3,
        gt=0,
        le=10,
        description="smallest 1 σ, mm, of the kernel along distance; wider where rings are sparse",
    )
    largest_gap_mm: float = Field(
        3.0, gt=0, le=50, description="largest distance, mm, between rings that is bridged"
    )


def accumulate_wall(
    probe: Probe,
    rings: RingSamples,
    points: RingPoints,
    trajectory: Trajectory,
    parameters: AccumulateParameters,
    context: Context,
) -> Wall:
    """Bring every ring into the pipe and estimate the wall's radius about the pipe's own axis.

    Raises
    ------
    UnusableError
        When no ring sample lies on the wall.
    """
    found = probe.as_found_in(trajectory)
    samples = centred(wall_samples(found, rings, points, trajectory))
    if not samples.valid.any():
        hint = "see the rejected samples of stage rings"
        raise UnusableError("accumulate", "no valid ring sample", hint=hint)
    grid = map_grid(samples, parameters.distance_step_mm, parameters.azimuth_samples)
    columns = rings_on_columns(samples, grid)
    radius, random, count, misalignment = gridded(
        columns, grid, parameters.smoothing_mm, parameters.largest_gap_mm, context.progress
    )
    calibration = calibration_sigma(found, rings, trajectory, grid)
    total = np.hypot(random, calibration).astype(np.float32)
    total[~np.isfinite(radius)] = np.nan
    radius_map = RadiusMap(grid.distance_mm, grid.azimuth_rad, radius, total, random, count, misalignment)
    cloud = _cloud(samples, radius_map)
    _report(context, radius_map, samples, calibration)
    return Wall(cloud, radius_map, trajectory.axis)


def _cloud(samples: WallSamples, radius_map: RadiusMap) -> PointCloud:
    """Return the valid samples as points with inward normals of the smoothed wall and total 1 σ."""
    ok = samples.valid
    row, column = _nearest(samples, radius_map, ok)
    normal = _normals(radius_map, row, column, samples.section[ok])
    total = radius_map.sigma_mm[row, column]
    random = radius_map.sigma_random_mm[row, column]
    systematic2 = np.nan_to_num(total) ** 2 - np.nan_to_num(random) ** 2
    sigma = np.sqrt(samples.sigma_mm[ok] ** 2 + np.maximum(systematic2, 0))
    single = np.float32
    frame = np.broadcast_to(samples.frame[:, None], ok.shape)[ok]
    return PointCloud(
        samples.xyz_p[ok].astype(single), normal.astype(single), sigma.astype(single),
        samples.radius_mm[ok].astype(single), samples.distance_mm[ok].astype(single),
        samples.azimuth_rad[ok].astype(single), frame.astype(np.int64),
    )  # fmt: skip


def _nearest(
    samples: WallSamples, radius_map: RadiusMap, ok: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    s, a = radius_map.distance_mm, radius_map.azimuth_rad
    row = np.clip(np.rint((samples.distance_mm[ok] - s[0]) / (s[1] - s[0])), 0, len(s) - 1).astype(np.int64)
    column = np.rint((samples.azimuth_rad[ok] - a[0]) / (a[1] - a[0])).astype(np.int64) % len(a)
    return row, column


def _normals(
    radius_map: RadiusMap, row: NDArray[np.int64], column: NDArray[np.int64], section: Float
) -> Float:
    """Return unit normals (M, 3) in P, toward the axis, from the map's slopes."""
    r = radius_map.radius_mm.astype(float)
    by_s = np.gradient(r, radius_map.distance_mm, axis=0)
    step = radius_map.azimuth_rad[1] - radius_map.azimuth_rad[0]
    by_psi = (np.roll(r, -1, 1) - np.roll(r, 1, 1)) / (2 * step)
    slope_s = np.nan_to_num(by_s[row, column])
    slope_around = np.nan_to_num(by_psi[row, column] / r[row, column])
    psi = radius_map.azimuth_rad[column]
    outward = np.stack([np.cos(psi), np.sin(psi), 0 * psi], -1)
    around = np.stack([-np.sin(psi), np.cos(psi), 0 * psi], -1)
    local = -outward + slope_around[:, None] * around + slope_s[:, None] * np.array([0, 0, 1.0])
    normal = np.einsum("mij,mj->mi", section, local)
    return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True))


def _report(context: Context, radius_map: RadiusMap, samples: WallSamples, calibration: Float) -> None:
    seen = np.isfinite(radius_map.radius_mm)
    context.report("wall points", int(samples.valid.sum()), "")
    context.report("coverage", float(100 * seen.mean()), "%")
    context.report("length of wall measured", float(np.ptp(radius_map.distance_mm)), "mm")
    context.report("mean radius", float(np.nanmean(radius_map.radius_mm)), "mm")
    context.report("1 σ of the radius, random, median", float(np.nanmedian(radius_map.sigma_random_mm)), "mm")
    context.report("1 σ of the radius, calibration, median", float(np.median(calibration)), "mm")


ACCUMULATE = Stage(
    "accumulate",
    "1",
    AccumulateParameters,
    accumulate_wall,
    "point cloud and radius map about the pipe's own axis, with σ",
)
