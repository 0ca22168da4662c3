"""The difference of two registered walls: over the whole wall as palette levels, and of the mean diameter."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Byte, Float
from pipeline.artefacts.comparison import RegisteredWalls, Value
from pipeline.machine.stage import Progress
from stages.compare.paired import PairedWalls

# Rows in the middle of what both saw from which the difference's typical σ is taken: a bound on time alone.
_SAMPLED_ROWS = 2000
# Colours end at so many typical σ of the difference, so that noise shows as the palette's middle only.
_ENDS = 8.0
# Mean diameters of rings nearer than this were measured from one stretch of the motion and count as one:
# chosen, a fifth of a 4 inch bore's radius; the correlation was not measured.
_CORRELATED_MM = 10.0


def registered_walls(pair: PairedWalls, is_one_calibration: bool, progress: Progress) -> RegisteredWalls:
    """Return the walls' difference after registration, without what single rings do."""
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
    """Return growth of the mean diameter; both calibrations count where they are two."""
    known = grown_mm[np.isfinite(grown_mm)]
    independent = max(len(known) * pair.now.step_mm / _CORRELATED_MM, 1.0)
    wander = float(known.std()) / np.sqrt(independent)
    systematic = 0.0 if is_one_calibration else 2 * np.sqrt(2) * pair.calibration_mm
    return Value(float(np.median(known)), float(np.hypot(wander, systematic)))


def _typical_sigma(pair: PairedWalls) -> float:
    """Return the median σ of the difference about the middle of what both runs saw."""
    middle = pair.now.row(float(np.mean(pair.registration.overlap_mm)))
    part = pair.stretch(middle - _SAMPLED_ROWS // 2, middle + _SAMPLED_ROWS // 2)
    return float(np.nanmedian(part.sigma_mm))


def _levels(values_mm: Float, low_mm: float, high_mm: float) -> Byte:
    """Return palette levels 1 to 255 of values, 0 where there is none."""
    at = np.clip((values_mm - low_mm) / (high_mm - low_mm), 0, 1)
    return np.asarray(np.where(np.isfinite(at), 1 + np.rint(254 * np.nan_to_num(at)), 0), np.uint8)
