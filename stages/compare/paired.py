"""Two registered walls on one grid, and their difference, as numbers and as palette levels.

Differences of single rings in mean, centre and ovality are removed: they are motion and calibration, not
growth.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from pipeline.adjustment.robust import basis_of, independent_count, ring_harmonics
from pipeline.arrays import Byte, Float
from pipeline.artefacts.comparison import RegisteredWalls, Registration, Value
from pipeline.artefacts.wall_map import WallMap
from pipeline.machine.stage import Progress

# A bound on memory alone.
_ROWS_AT_ONCE = 512
# Rows in the middle of the common wall from which the difference's typical σ is estimated: a bound on time
# alone.
_SAMPLED_ROWS = 2000
# The colour scale ends at so many typical σ of the difference, so that noise has the palette's middle
# colours.
_ENDS = 8.0


@dataclass(frozen=True)
class Stretch:
    """Rows of both walls on the later run's grid.

    Attributes
    ----------
    distance_mm : (R,)
    now_mm, before_mm : (R, A)
        Radii. The earlier one is corrected to the mean, centre and ovality of the later rings, so that
        neither motion nor calibration shows as growth. NaN where not seen.
    sigma_mm : (R, A)
        Random 1 σ of their difference.
    diameter_mm : (R,)
        Later mean diameter minus the earlier one; NaN where too little was seen.
    """

    distance_mm: Float
    now_mm: Float
    before_mm: Float
    sigma_mm: Float
    diameter_mm: Float

    @property
    def difference_mm(self) -> Float:
        """(R, A) later minus earlier radius, mm, positive where wall was lost."""
        return self.now_mm - self.before_mm


@dataclass(frozen=True)
class PairedWalls:
    """An earlier and a later wall and their registration."""

    earlier: WallMap
    now: WallMap
    registration: Registration

    @cached_property
    def radius_mm(self) -> float:
        """Median radius of both walls, mm, so that it is known even if the later one was hardly seen."""
        rows = [self._thinned(wall.radius_mm) for wall in (self.now, self.earlier)]
        return float(np.nanmedian(np.concatenate([r.ravel() for r in rows])))

    @property
    def calibration_mm(self) -> float:
        """Median of the later radius' 1 σ from calibration."""
        return float(np.sqrt(np.nanmedian(self.now.common_variance(self._some(len(self.now.distance_mm))))))

    def stretches(self) -> Iterator[tuple[slice, Stretch]]:
        """Yield all rows of the later wall, some hundred at a time."""
        for first in range(0, len(self.now.distance_mm), _ROWS_AT_ONCE):
            rows = slice(first, min(first + _ROWS_AT_ONCE, len(self.now.distance_mm)))
            yield rows, self.stretch(rows.start, rows.stop)

    def stretch(self, first: int, last: int) -> Stretch:
        """Return the later wall's rows from ``first`` to before ``last``."""
        rows = slice(max(first, 0), max(last, 0))
        s = self.now.distance_mm[rows]
        now = np.asarray(self.now.radius_mm[rows], float)
        before, sigma = self._before(s)
        basis = basis_of(self.now.azimuth_rad)
        rings = ring_harmonics(now - before, basis)
        apart = np.hypot(_apart(self.now, rows), sigma)
        return Stretch(s, now, before + rings @ basis.T, apart, 2 * rings[:, 0])

    def _thinned(self, values: NDArray[Any]) -> Float:
        """Return about two hundred rows of values, evenly: enough for a median of a long wall."""
        return np.asarray(values[self._some(len(values))], float)

    @staticmethod
    def _some(rows: int) -> slice:
        return slice(None, None, max(rows // 200, 1))

    def _before(self, s: Float) -> tuple[Float, Float]:
        """Return the earlier wall's radius and `_apart` at the later grid's rows (R,) and all azimuths."""
        wall = self.earlier
        at, psi = self.registration.to_earlier(s[:, None], self.now.azimuth_rad[None])
        row = (at - wall.distance_mm[0]) / wall.step_mm
        first = int(np.clip(np.floor(row.min()) - 2, 0, len(wall.distance_mm) - 1))
        last = int(np.clip(np.ceil(row.max()) + 3, first + 1, len(wall.distance_mm)))
        column = np.mod((psi - wall.azimuth_rad[0]) / wall.step_rad, len(wall.azimuth_rad))
        row = np.broadcast_to(row - first, column.shape)
        radius, sigma = np.asarray(wall.radius_mm[first:last], float), _apart(wall, slice(first, last))
        return _between(radius, row, column), _between(sigma, row, column)


def _apart(wall: WallMap, rows: slice) -> Float:
    """Return the 1 σ (R, A), mm, of cells that they do not have in common with all others of their wall."""
    random, local = np.asarray(wall.sigma_random_mm[rows], float), wall.displaced_in(rows)
    return np.asarray(np.hypot(random, local[:, None]))


def _between(values: Float, row: Float, column: Float) -> Float:
    """Return values at fractional rows and columns, linear; NaN next to unseen cells."""
    wide = np.concatenate([values, values[:, :1]], 1)
    return np.asarray(map_coordinates(wide, [row, column], order=1, mode="constant", cval=np.nan))


def ring_values(rows: Float, azimuth_rad: Float) -> Float:
    """Return the smooth shape (R, A) of rings; NaN for rows seen to less than a half."""
    basis = basis_of(azimuth_rad)
    return np.asarray(ring_harmonics(rows, basis) @ basis.T)


def registered_walls(pair: PairedWalls, is_one_calibration: bool, progress: Progress) -> RegisteredWalls:
    """Return the walls' difference after registration, without mean, centre and ovality of single rings."""
    limit = _ENDS * _typical_sigma(pair)
    levels = np.zeros((2, *pair.now.radius_mm.shape), np.uint8)
    grown = np.full(len(pair.now.distance_mm), np.nan)
    for rows, stretch in pair.stretches():
        progress(rows.start, len(grown))
        sigma = np.where(np.isfinite(stretch.difference_mm), stretch.sigma_mm, np.nan)
        levels[0, rows] = _levels(stretch.difference_mm, -limit, limit)
        levels[1, rows] = _levels(sigma, 0.0, limit / 2)
        grown[rows] = stretch.diameter_mm
    diameter = _diameter(grown, pair, is_one_calibration)
    return RegisteredWalls(pair.registration, diameter, limit, levels[0], levels[1])


def _diameter(grown_mm: Float, pair: PairedWalls, is_one_calibration: bool) -> Value:
    """Return the growth of the mean diameter; its σ includes both calibrations if there are two."""
    known = grown_mm[np.isfinite(grown_mm)]
    wander = float(known.std()) * np.sqrt(np.pi / 2 / independent_count(known))  # π/2: of a median
    systematic = 0.0 if is_one_calibration else 2 * np.sqrt(2) * pair.calibration_mm
    return Value(float(np.median(known)), float(np.hypot(wander, systematic)))


def _typical_sigma(pair: PairedWalls) -> float:
    """Return the median σ of the difference in the middle of the wall that both runs saw."""
    middle = pair.now.row(float(np.mean(pair.registration.overlap_mm)))
    part = pair.stretch(middle - _SAMPLED_ROWS // 2, middle + _SAMPLED_ROWS // 2)
    return float(np.nanmedian(part.sigma_mm))


def _levels(values_mm: Float, low_mm: float, high_mm: float) -> Byte:
    """Return palette levels 1 to 255 of values, 0 where there is none."""
    at = np.clip((values_mm - low_mm) / (high_mm - low_mm), 0, 1)
    return np.asarray(np.where(np.isfinite(at), 1 + np.rint(254 * np.nan_to_num(at)), 0), np.uint8)
