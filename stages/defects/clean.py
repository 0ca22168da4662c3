"""The wall away from all defects, as a sample of its noise."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pipeline.adjustment.robust import robust_spread
from pipeline.arrays import Bool, Float, Int
from stages.defects.relief import Typical
from stages.defects.segment import Region
from stages.defects.surface import MeasuredWall

_TRIES = 40
_CLEAR_MM = 3.0


@dataclass(frozen=True)
class CleanWall:
    """Sampled rows of the wall, averaged over 1 mm.

    Attributes
    ----------
    local_mm : (S, A)
        Deviation from the smooth shape, as in `Surface`.
    clean : (S, A) bool
        True at least 3 mm away from all defects.
    scale : float
        Noise over total scatter of the clean wall (1 σ each); the rest is its natural roughness.
    """

    local_mm: Float
    clean: Bool
    scale: float

    @cached_property
    def noise_mm(self) -> float:
        """1 σ of the clean wall's noise, mm; 0 where no cell is clean."""
        return self.scale * robust_spread(self.local_mm[self.clean]) if self.clean.any() else 0.0

    def draw(self, shape: tuple[int, int], random: np.random.Generator) -> Float:
        """Return a patch (H, W) of noise, mm: the cleanest of up to 40 random patches, with a random sign."""
        rows, columns = self.local_mm.shape
        best, share = np.zeros(shape), -1.0
        for _ in range(_TRIES):
            i = np.arange(shape[0]) + int(random.integers(0, max(1, rows - shape[0] + 1)))
            j = np.arange(shape[1]) + int(random.integers(0, columns))
            at = np.ix_(_reflected(i, rows), j % columns)
            clean = self.clean[at]
            if clean.mean() > share:
                best, share = np.where(clean, self.local_mm[at], 0.0), float(clean.mean())
            # Clean enough: further tries gain little (chosen).
            if share > 0.98:
                break
        return np.asarray(best * self.scale * (1 if random.random() < 0.5 else -1))


def _reflected(i: Int, count: int) -> Int:
    period = max(1, 2 * count - 2)
    return np.asarray(np.minimum(i % period, period - i % period), np.int64)


def clean_wall(wall: MeasuredWall, regions: tuple[Region, ...]) -> CleanWall:
    """Return the wall's sampled rows, with all regions and a margin of 3 mm marked as not clean."""
    parts = [_sampled(wall, rows, regions) for rows in wall.relief.sampled]
    local, clean = (np.concatenate(p) for p in zip(*parts, strict=True))
    return CleanWall(local, clean, _noise_share(wall.relief.typical, local[clean]))


def _sampled(wall: MeasuredWall, rows: slice, regions: tuple[Region, ...]) -> tuple[Float, Bool]:
    part = wall.with_margin(rows)
    wanted = np.zeros((part.wide.stop - part.wide.start, wall.relief.shape[1]), bool)
    wanted[part.inner] = True
    local = wall.surface(part.wide, wanted).local_mm[part.inner]
    clean = np.isfinite(local)
    margin = [round(_CLEAR_MM / c) for c in wall.relief.cell_mm]
    for region in regions:
        height, width = region.mask.shape
        first_row = region.row - margin[0] - rows.start
        near = slice(max(0, first_row), max(0, first_row + height + 2 * margin[0]))
        first, last = region.column - margin[1], region.column + width + margin[1]
        clean[near, np.arange(first, last) % clean.shape[1]] = False
    return local, clean


def _noise_share(typical: Typical, clean_mm: Float) -> float:
    """Return noise over scatter of the clean wall, 1 σ each: the map's roughness is taken off the scatter."""
    roughness = typical.sigma_mm**2 - typical.noise_mm**2
    scatter = robust_spread(clean_mm) ** 2 if clean_mm.size else 0.0
    return float(np.sqrt(np.clip(1 - roughness / scatter, 0.1, 1.0))) if scatter > 0 else 1.0
