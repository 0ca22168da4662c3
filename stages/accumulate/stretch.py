"""Computes a long wall stretch by stretch, each from the rings that reach into it, to limit memory."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pipeline.adjustment.shared_light import HeldOver
from pipeline.arrays import Bool, Float, Int
from pipeline.artefacts.measured import PointCloud, RadiusMap, Wall
from pipeline.artefacts.wall_map import FixedToProbe
from pipeline.geometry.axis import PipeAxis
from pipeline.machine.scratch import Scratch
from stages.accumulate.grid import WIDTH_IN_RINGS, MapGrid, gridded, kernel_mm, rings_on_columns
from stages.accumulate.survey import RingsOnWall, RingSurvey, WallSamples, centred, some_at_a_time

# Rows of a stretch, to limit memory.
_ROWS = 1000
# A stretch is computed from the rings within so many reaches of it. In stretches of a tenth of the length
# 1 to 16 reaches change no radius of open-1 by more than 6 µm; its random σ is 20 µm.
_REACHES = 4.0
# Reach of the kernel in its σ, as in `grid`.
_WIDTHS = 3.0


@dataclass(frozen=True)
class Stretch:
    """Some rows of the map.

    Attributes
    ----------
    first, last : int
        Its own rows, ``last`` exclusive.
    from_row, to_row : int
        Computed rows: its own rings lie completely on them.
    near : (n,) int
        Rings that contribute to these rows.
    own : (m,) int
        Rings whose middle lies on its own rows.
    """

    first: int
    last: int
    from_row: int
    to_row: int
    near: Int
    own: Int


def cut_stretches(grid: MapGrid, survey: RingSurvey, smoothing_mm: float, gap_mm: float) -> list[Stretch]:
    """Return stretches that cover the map; a short wall is one."""
    s, rows = grid.distance_mm, len(grid.distance_mm)
    seen = survey.count > 0
    usual = float(np.median(np.abs(np.diff(survey.middle_mm[seen])))) if seen.sum() > 1 else 0.0
    reach = _REACHES * max(_WIDTHS * max(smoothing_mm, WIDTH_IN_RINGS * usual), gap_mm)
    row = np.clip(np.nan_to_num(np.rint((survey.middle_mm - s[0]) / (s[1] - s[0]))), 0, rows - 1)
    home = np.where(seen, row.astype(np.int64) // _ROWS, -1)
    return [_stretch(grid, survey, k, np.flatnonzero(home == k), reach) for k in range(-(-rows // _ROWS))]


def map_of(
    stretch: Stretch,
    rings: RingsOnWall,
    survey: RingSurvey,
    grid: MapGrid,
    systematic_mm: Float,
    smoothing_mm: float,
    gap_mm: float,
    held: HeldOver,
) -> RadiusMap:
    """Return the radius map of a stretch's computed rows; ``systematic_mm`` is the systematic part of σ."""
    part = grid.rows(stretch.from_row, stretch.to_row)
    samples = (s for _, s in _centred_samples(rings, survey, stretch.near))
    columns = rings_on_columns(samples, len(stretch.near), part)
    width = kernel_mm(columns, smoothing_mm)
    radius, random, count, misalignment = gridded(columns, part, width, gap_mm, held)
    total = np.hypot(random, systematic_mm).astype(np.float32)
    total[~np.isfinite(radius)] = np.nan
    return RadiusMap(
        part.distance_mm, part.azimuth_rad, radius, total, random, count, misalignment,
        kernel_mm=np.full(len(radius), width),
    )  # fmt: skip


def empty_wall(
    grid: MapGrid, survey: RingSurvey, axis: PipeAxis, fixed: FixedToProbe | None, scratch: Scratch
) -> Wall:
    """Return an empty wall of full size on scratch storage."""
    shape, points = (len(grid.distance_mm), len(grid.azimuth_rad)), int(survey.count.sum())
    single = np.float32
    radius, sigma, random, misalignment = (scratch.zeros(shape, single) for _ in range(4))
    counts = scratch.zeros(shape, np.int64)
    radius_map = RadiusMap(
        grid.distance_mm, grid.azimuth_rad, radius, sigma, random, counts, misalignment,
        kernel_mm=np.zeros(len(radius)),
    )  # fmt: skip
    xyz, normal = (scratch.zeros((points, 3), single) for _ in range(2))
    own_sigma, own_radius, distance, azimuth = (scratch.zeros((points,), single) for _ in range(4))
    frame = scratch.zeros((points,), np.int64)
    cloud = PointCloud(xyz, normal, own_sigma, own_radius, distance, azimuth, frame)
    return Wall(cloud, radius_map, axis, fixed)


def fill(wall: Wall, stretch: Stretch, radius_map: RadiusMap, rings: RingsOnWall, survey: RingSurvey) -> None:
    """Write a stretch's own rows and the points of its own rings."""
    mine = slice(stretch.first - stretch.from_row, stretch.last - stretch.from_row)
    for name in ("radius_mm", "sigma_mm", "sigma_random_mm", "count", "misalignment_mm", "kernel_mm"):
        getattr(wall.radius_map, name)[stretch.first : stretch.last] = getattr(radius_map, name)[mine]
    start = np.cumsum(survey.count) - survey.count
    for rows, samples in _centred_samples(rings, survey, stretch.own):
        cloud = _cloud(samples, radius_map)
        count = survey.count[rows]
        within = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        place = np.repeat(start[rows], count) + within
        for name in cloud.__dataclass_fields__:
            getattr(wall.cloud, name)[place] = getattr(cloud, name)


def _stretch(grid: MapGrid, survey: RingSurvey, number: int, own: Int, reach_mm: float) -> Stretch:
    s, rows = grid.distance_mm, len(grid.distance_mm)
    first, last = number * _ROWS, min((number + 1) * _ROWS, rows)
    near, far = survey.nearest_mm[own].min(initial=s[first]), survey.farthest_mm[own].max(initial=s[last - 1])
    from_row = int(np.clip(np.searchsorted(s, near) - 2, first - _ROWS, first))
    to_row = int(np.clip(np.searchsorted(s, far) + 2, last, last + _ROWS))
    from_row, to_row = max(from_row, 0), min(to_row, rows)
    ends = survey.near(s[from_row] - reach_mm, s[to_row - 1] + reach_mm)
    return Stretch(first, last, from_row, to_row, ends, own)


def _centred_samples(rings: RingsOnWall, survey: RingSurvey, rows: Int) -> Iterator[tuple[Int, WallSamples]]:
    for some in some_at_a_time(rows):
        yield some, centred(rings.samples(some), survey.shift_mm[some])


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


def _nearest(samples: WallSamples, radius_map: RadiusMap, ok: Bool) -> tuple[Int, Int]:
    s, a = radius_map.distance_mm, radius_map.azimuth_rad
    row = np.clip(np.rint((samples.distance_mm[ok] - s[0]) / (s[1] - s[0])), 0, len(s) - 1).astype(np.int64)
    column = np.rint((samples.azimuth_rad[ok] - a[0]) / (a[1] - a[0])).astype(np.int64) % len(a)
    return row, column


def _normals(radius_map: RadiusMap, row: Int, column: Int, section: Float) -> Float:
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
