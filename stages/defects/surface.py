"""Some rows of the wall with the points on them: what depths are read from."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from pipeline.arrays import Bool, Float
from pipeline.artefacts.cloud_along import CloudAlong
from pipeline.artefacts.measured import PointCloud
from stages.defects.fine import DeviationPoints, deviation_points, fine_surface
from stages.defects.grow import millimetre_mean
from stages.defects.relief import Relief, WallRelief
from stages.defects.segment import Region
from stages.defects.stretch import Stretch, widened

_MARGIN_MM, _MARGIN_IN_RINGS = 10.0, 3.0
# A sample that only one ring shows has a σ of 0.3 to 0.7 of its distance to the wall: from ten σ on this
# tells it, and below it moves a depth by no more than its noise.
_UNSURE = 3.0


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
    points : DeviationPoints
        Those of them that the surface goes by, against the smooth shape.
    """

    relief: Relief
    local_mm: Float
    all_mm: Float
    coarse_mm: Float
    near: PointCloud
    points: DeviationPoints


@dataclass(frozen=True)
class MeasuredWall:
    """A whole wall: its relief, its points, and the median distance between neighbouring rings."""

    relief: WallRelief
    cloud: CloudAlong
    spacing_mm: float

    def with_margin(self, rows: slice) -> Stretch:
        """Return rows with those about them that have a say in their surface."""
        margin = self.relief.rows_in(max(_MARGIN_MM, _MARGIN_IN_RINGS * self.spacing_mm))
        return widened(rows, self.relief.shape[0], margin)

    def surface(self, rows: slice, wanted: Bool, every_point: bool = False) -> Surface:
        """Return the surface of some rows; where not ``wanted`` (rows, A), the map's own mean stands in.

        It goes by the points that are sure of themselves, or by ``every_point``.
        """
        relief = self.relief.rows(rows)
        half = relief.cell_mm[0] / 2
        near = self.cloud.between(relief.distance_mm[0] - half, relief.distance_mm[-1] + half)
        used = near if every_point else _chosen(near, sure_of_themselves(near))
        points = deviation_points(relief, used, self.spacing_mm)
        coarse = millimetre_mean(relief.all_mm, relief.cell_mm)
        everything = fine_surface(relief, points, wanted, coarse)
        local = everything + relief.local_mm - relief.all_mm
        return Surface(relief, local, everything, coarse, near, points)

    def surface_about(self, region: Region, every_point: bool) -> tuple[Surface, Region]:
        """Return the surface about a region, and the region with its rows counted from the first there."""
        part = self.with_margin(slice(region.row, region.row + region.mask.shape[0]))
        here = region.counted_from(part.wide.start)
        columns = self.relief.shape[1]
        wanted = np.zeros((part.wide.stop - part.wide.start, columns), bool)
        i, j = np.nonzero(region.mask)
        wanted[here.row + i, (region.column + j) % columns] = True
        return self.surface(part.wide, wanted, every_point), here


def sure_of_themselves(points: PointCloud) -> Bool:
    """Return which points (M,) have no σ far above the others': nothing but itself speaks for such a one."""
    return np.asarray(
        points.sigma_mm <= _UNSURE * np.median(points.sigma_mm) if len(points.frame) else [], bool
    )


def _chosen(points: PointCloud, which: Bool) -> PointCloud:
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
