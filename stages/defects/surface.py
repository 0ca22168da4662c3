"""Some rows of the wall with the points on them: what depths are read from."""

from __future__ import annotations

from dataclasses import dataclass

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
        The same points against the smooth shape.
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

    def surface(self, rows: slice, wanted: Bool) -> Surface:
        """Return the surface of some rows; where not ``wanted`` (rows, A), the map's own mean stands in."""
        relief = self.relief.rows(rows)
        half = relief.cell_mm[0] / 2
        near = self.cloud.between(relief.distance_mm[0] - half, relief.distance_mm[-1] + half)
        points = deviation_points(relief, near, self.spacing_mm)
        coarse = millimetre_mean(relief.all_mm, relief.cell_mm)
        everything = fine_surface(relief, points, wanted, coarse)
        local = everything + relief.local_mm - relief.all_mm
        return Surface(relief, local, everything, coarse, near, points)

    def surface_about(self, region: Region) -> tuple[Surface, Region]:
        """Return the surface about a region, and the region with its rows counted from the first there."""
        part = self.with_margin(slice(region.row, region.row + region.mask.shape[0]))
        here = region.counted_from(part.wide.start)
        columns = self.relief.shape[1]
        wanted = np.zeros((part.wide.stop - part.wide.start, columns), bool)
        i, j = np.nonzero(region.mask)
        wanted[here.row + i, (region.column + j) % columns] = True
        return self.surface(part.wide, wanted), here
