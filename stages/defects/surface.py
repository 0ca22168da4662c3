"""Some rows of the wall with their points, from which depths are read.

The 1 mm mean is computed from the points themselves, so that the smoothing of the map does not flatten peaks.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np

from pipeline.adjustment.robust import robust_spread
from pipeline.arrays import Bool, Float, Int
from pipeline.artefacts.cloud_along import CloudAlong
from pipeline.artefacts.measured import PointCloud
from pipeline.system.parallel import side_by_side
from stages.defects.along import Stretch, widened
from stages.defects.grow import millimetre_mean
from stages.defects.local_quadratic import regress
from stages.defects.relief import Relief, WallRelief
from stages.defects.segment import Region

_MARGIN_MM, _MARGIN_IN_RINGS = 10.0, 3.0
# A sample that only one ring shows has a σ of 0.3 to 0.7 of its distance from the wall. From about ten σ on
# such a sample is recognised by this limit; a nearer one moves a depth by no more than its noise.
_UNSURE = 3.0
_AROUND_MM = 0.45  # 1 σ of the kernel around the pipe, where a ring's samples lie close together
# 1 σ of the wall's curvature along the pipe (of the factor of s²) before it is measured: that of a pit 1 mm
# deep and 3 mm across. Between two oblique rings, as in a bend, only noise would tell it, and it moved the
# wall by up to 1.4 mm where rings had .05.
_CURVED_PER_MM = 1 / 1.5**2
_LEAST = 12  # points, for a local quadratic of 6 coefficients


@dataclass(frozen=True)
class DeviationPoints:
    """The cloud's points relative to the pipe's smooth shape, sorted by cell of the map.

    Attributes
    ----------
    first : (S A + 1,) int
        Index of each cell's first point.
    row, column, deviation_mm : (M,)
        Fractional place in the map, and radius minus the smooth shape of ``Relief.all_mm``.
    weight : (M,)
        Median variance of the points over the point's own, at most 1.
    spacing_mm : float
        Median distance between neighbouring rings.
    """

    first: Int
    row: Float
    column: Float
    deviation_mm: Float
    weight: Float
    spacing_mm: float

    @property
    def kernel_mm(self) -> tuple[float, float]:
        """1 σ of the regression's kernel along and around the pipe: as narrow as the ring spacing allows."""
        return max(0.4, 0.55 * self.spacing_mm), _AROUND_MM


def fine_surface(relief: Relief, points: DeviationPoints, wanted: Bool, coarse_mm: Float) -> Float:
    """Return the 1 mm mean (S, A) of ``relief.all_mm``, mm, by local quadratic regression on the points.

    Samples of a dim line, as on rust or at the bottom of a pit, have less weight. A local quadratic has no
    bias from a peak's curvature (Fan & Gijbels, Local polynomial modelling and its applications, 1996, §
    3.2). Where too few points are near, and where it is not ``wanted`` (S, A), the map's own mean
    ``coarse_mm`` (S, A) is used.
    """
    out = np.full(relief.local_mm.shape, np.nan)
    place = (points.first, points.row, points.column, points.deviation_mm, points.weight)

    def fill(cells: Int) -> None:
        regress(*place, *relief.cell_mm, *points.kernel_mm, stiff, _LEAST, cells, out)

    stiff = (relief.typical.noise_mm / _CURVED_PER_MM) ** 2
    cells = np.argwhere(wanted & relief.seen)
    side_by_side(fill, (cells[: len(cells) // 2], cells[len(cells) // 2 :]))
    return np.where(np.isfinite(out), out, coarse_mm)


def deviation_points(relief: Relief, points: PointCloud, spacing_mm: float) -> DeviationPoints:
    """Return the points on the rows of a relief, relative to its smooth shape."""
    rows, columns = relief.local_mm.shape
    step = float(relief.azimuth_rad[1] - relief.azimuth_rad[0])
    i = (points.distance_mm.astype(float) - relief.distance_mm[0]) / relief.cell_mm[0]
    j = np.mod((points.azimuth_rad.astype(float) - relief.azimuth_rad[0]) / step, columns)
    weight = _weight(points.sigma_mm.astype(float))
    within = (i > -0.5) & (i < rows - 0.5)
    i, j, radius, weight = (x[within] for x in (i, j, points.radius_mm.astype(float), weight))
    cell = np.rint(i).astype(np.int64) * columns + np.rint(j).astype(np.int64) % columns
    order = np.argsort(cell, kind="stable")
    first = np.searchsorted(cell[order], np.arange(rows * columns + 1))
    deviation = radius - relief.shape_at(i, j)
    return DeviationPoints(first, i[order], j[order], deviation[order], weight[order], spacing_mm)


def _weight(sigma_mm: Float) -> Float:
    """Return the median variance of points over their own (M,)."""
    usual = float(np.median(sigma_mm)) if sigma_mm.size else 1.0
    return np.asarray((usual / np.maximum(sigma_mm, usual)) ** 2)


@dataclass(frozen=True)
class Surface:
    """The wall's 1 mm mean over some rows.

    Attributes
    ----------
    relief : Relief
        Of these rows.
    local_mm, all_mm : (S, A)
        1 mm means from the points; as in `Relief`.
    coarse_mm : (S, A)
        1 mm mean of the map's ``all_mm``, which smoothing has flattened.
    near : PointCloud
        All points on these rows.
    points : DeviationPoints
        Those of them from which the surface was computed, relative to the smooth shape.
    left_out : tuple of int
        Frames whose points were not used.
    """

    relief: Relief
    local_mm: Float
    all_mm: Float
    coarse_mm: Float
    near: PointCloud
    points: DeviationPoints
    left_out: tuple[int, ...] = ()


@dataclass(frozen=True)
class MeasuredWall:
    """A whole wall: its relief, its points, and the median distance between neighbouring rings, mm."""

    relief: WallRelief
    cloud: CloudAlong
    spacing_mm: float

    @cached_property
    def ways_mm(self) -> Float:
        """How far the probe moved to each frame's ring (F,) since the ring before, mm."""
        return self.cloud.ways_mm()

    @cached_property
    def rings_mm(self) -> float:
        """1 σ of single rings' median radii on sampled rows, mm, by second differences; 0 if unknown."""
        s = self.relief.radius_map.distance_mm
        parts = [_bends(self.cloud.between(float(s[r][0]), float(s[r][-1]))) for r in self.relief.sampled]
        bends = np.concatenate(parts) if parts else np.empty(0)
        return float(robust_spread(bends) / np.sqrt(6)) if bends.size else 0.0

    def with_margin(self, rows: slice) -> Stretch:
        """Return rows together with the neighbouring rows that influence their surface."""
        margin = self.relief.rows_in(max(_MARGIN_MM, _MARGIN_IN_RINGS * self.spacing_mm))
        return widened(rows, self.relief.shape[0], margin)

    def surface(
        self, rows: slice, wanted: Bool, every_point: bool = False, without: tuple[int, ...] = ()
    ) -> Surface:
        """Return the surface of some rows; where not ``wanted`` (rows, A), it is the map's own mean.

        It uses the points of usual σ, or ``every_point``, and leaves out the frames in ``without``.
        """
        relief = self.relief.rows(rows)
        half = relief.cell_mm[0] / 2
        near = self.cloud.between(relief.distance_mm[0] - half, relief.distance_mm[-1] + half)
        used = near if every_point else chosen(near, of_usual_sigma(near))
        used = chosen(used, ~np.isin(used.frame, without)) if without else used
        points = deviation_points(relief, used, self.spacing_mm)
        coarse = millimetre_mean(relief.all_mm, relief.cell_mm)
        # The map's own mean includes the frames that are left out, so it cannot be used then.
        stands_in = np.where(wanted, np.nan, coarse) if without else coarse
        everything = fine_surface(relief, points, wanted, stands_in)
        local = everything + relief.local_mm - relief.all_mm
        return Surface(relief, local, everything, coarse, near, points, without)

    def surface_about(
        self, region: Region, every_point: bool, without: tuple[int, ...] = ()
    ) -> tuple[Surface, Region]:
        """Return the `surface` about a region, and the region with rows counted from the surface's first."""
        part = self.with_margin(slice(region.row, region.row + region.mask.shape[0]))
        here = region.counted_from(part.wide.start)
        columns = self.relief.shape[1]
        wanted = np.zeros((part.wide.stop - part.wide.start, columns), bool)
        i, j = np.nonzero(region.mask)
        wanted[here.row + i, (region.column + j) % columns] = True
        return self.surface(part.wide, wanted, every_point, without), here


def _bends(points: PointCloud) -> Float:
    """Return second differences (n,) of the median radius of rings along the pipe, mm."""
    order = np.argsort(points.frame, kind="stable")
    first = np.unique(points.frame[order], return_index=True)[1][1:]
    at, radius = (np.split(x[order], first) for x in (points.distance_mm, points.radius_mm))
    rings = np.array([float(np.median(r)) for r in radius if len(r)])
    along = np.argsort([float(np.median(s)) for s in at if len(s)])
    return np.diff(rings[along], 2) if len(rings) > 2 else np.empty(0)


def of_usual_sigma(points: PointCloud) -> Bool:
    """Return which points (M,) have a σ of at most three times the median σ.

    A point of larger σ is one that its own ring alone shows.
    """
    return np.asarray(
        points.sigma_mm <= _UNSURE * np.median(points.sigma_mm) if len(points.frame) else [], bool
    )


def chosen(points: PointCloud, which: Bool) -> PointCloud:
    """Return some of the points."""
    return replace(points, **{f.name: getattr(points, f.name)[which] for f in fields(points)})


def cells_of(points: PointCloud, relief: Relief, region: Region) -> tuple[Float, Float, Bool]:
    """Return fractional rows and columns of points (M,) in the map, and which of them are in the region."""
    step = float(relief.azimuth_rad[1] - relief.azimuth_rad[0])
    row = (points.distance_mm.astype(float) - relief.distance_mm[0]) / relief.cell_mm[0]
    column = (points.azimuth_rad.astype(float) - relief.azimuth_rad[0]) / step
    i = np.rint(row).astype(np.int64) - region.row
    j = (np.rint(column).astype(np.int64) - region.column) % len(relief.azimuth_rad)
    inside = (i >= 0) & (i < region.mask.shape[0]) & (j < region.mask.shape[1])
    inside[inside] = region.mask[i[inside], j[inside]]
    return row, column, inside
