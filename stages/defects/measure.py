"""Measure the depth of a region, without the rings that their neighbours contradict."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pipeline.arrays import Bool, Float
from stages.defects.all_round import bore_beside, goes_round, measure_all_round
from stages.defects.clean import CleanWall
from stages.defects.depth import Depth, is_small, measure_depth
from stages.defects.neighbours import MEAN_MM, RingsAtPeak, rings_at_peak
from stages.defects.parameters import DefectParameters
from stages.defects.segment import Region
from stages.defects.surface import MeasuredWall, Surface, cells_of

# At most so many rings with a glint on them are left out when a region is measured (chosen), besides those on
# which a spot of the wall shines beside the line.
_MOST_LEFT_OUT = 4


def is_measured(surface: Surface, region: Region) -> bool:
    """Return whether any cell of a region has a surface: between rings far apart some have none."""
    shown = region.cut(surface.all_mm if region.all_round else surface.local_mm)
    return bool(np.isfinite(shown[region.mask]).any())


@dataclass(frozen=True)
class Measured:
    """A region's ``depth`` from a ``surface``; ``here`` is the region with rows counted from it."""

    here: Region
    surface: Surface
    depth: Depth

    @cached_property
    def rings(self) -> RingsAtPeak:
        """What each ring shows about the region's peak."""
        return rings_at_peak(self.depth, self.here, self.surface)

    @property
    def contradicted_frame(self) -> int | None:
        """The next frame to be left out, None where there is none."""
        return None if self.here.all_round else self.rings.contradicted_frame(self.depth)

    def best(self, score: Float) -> float:
        """Return the largest ``score`` (H, W) of the region's window, away from rings that were left out."""
        away = self.here.mask & ~self._marred()[:, None]
        return float(score[away if away.any() else self.here.mask].max())

    def _marred(self) -> Bool:
        """Return which rows (H,) of the region are within 1 mm of a ring that was left out."""
        near, relief = self.surface.near, self.surface.relief
        row, _, inside = cells_of(near, relief, self.here)
        at = row[inside & np.isin(near.frame, self.surface.left_out)] - self.here.row
        rows = np.arange(len(self.here.mask))[:, None]
        return np.asarray((np.abs(rows - at) * relief.cell_mm[0] <= MEAN_MM).any(1))

    @cached_property
    def allowed(self) -> Depth:
        """The depth that the rings beside the deepest one allow; what goes all round needs no such limit."""
        if self.here.all_round:
            return self.depth
        return self.rings.allow(self.depth, is_small(self.surface.relief, self.here, self.surface.points))


@dataclass(frozen=True)
class Measurer:
    """Measures the regions of a wall."""

    wall: MeasuredWall
    clean: CleanWall
    parameters: DefectParameters
    random: np.random.Generator

    def measured(self, region: Region, every_point: bool, without: tuple[int, ...] = ()) -> Measured | None:
        """Return a region measured with points of usual σ, or with ``every_point``, ``without`` some frames.

        None where no cell of it has a surface, as between rings that are far apart.
        """
        surface, here = self.wall.surface_about(region, every_point, without)
        if not is_measured(surface, here):
            return None
        return Measured(here, surface, self._depth(region, here, surface))

    def without_contradicted(self, region: Region, every_point: bool, whole: Measured) -> Measured:
        """Return a region measured without the rings that their neighbours contradict, removed one by one.

        Only where the region has a depth without them: rings on both sides show it there, or it is known
        elsewhere, as that of corrosion with a glint at its end. What one ring alone shows keeps its depth.
        """
        kept = whole
        for _ in range(_MOST_LEFT_OUT):
            if (frame := kept.contradicted_frame) is None:
                break
            left = self.measured(region, every_point, (*kept.surface.left_out, frame))
            if left is None or not (kept.rings.shown_beside or left.allowed.is_known):
                break
            kept = left
        return kept

    def chance_of_bead(self, region: Region) -> float:
        """Return the probability that a region is not a step of the bore's diameter."""
        radius_map = self.wall.relief.radius_map
        if not goes_round(region, radius_map):
            return 1.0
        bore = bore_beside(region, radius_map, self.wall.rings_mm)
        return bore.chance_of_bead(self.parameters.min_depth_mm)

    def _depth(self, region: Region, here: Region, surface: Surface) -> Depth:
        if region.all_round:
            bore = bore_beside(region, self.wall.relief.radius_map, self.wall.rings_mm)
            return measure_all_round(here, surface, self.clean, bore)
        return measure_depth(here, surface, self.clean, self.parameters.draws, self.random)
