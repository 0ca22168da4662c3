"""The walls' difference as a layer of the flat view, and its uncertainty."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Byte, Float
from pipeline.artefacts.model import Overlay, Overlays
from pipeline.review.comparison.paired import PairedWalls

_ROWS_AT_ONCE = 512
_SAMPLED_ROWS = 2000
# The colours end at so many median σ of the difference.
_ENDS = 8.0


@dataclass(frozen=True)
class DifferenceLayers:
    """Overlays on the later run's grid: later less earlier radius, and its 1 σ."""

    difference: Overlay
    sigma: Overlay


def difference_layers(pair: PairedWalls, overlays: Overlays) -> DifferenceLayers:
    """Return the difference after registration and without what single rings do, in the run's own colours."""
    count = len(pair.now.distance_mm)
    limit = _ENDS * _typical_sigma(pair)
    shape = pair.now.radius_mm.shape
    levels = np.zeros((2, *shape), np.uint8)
    for first in range(0, count, _ROWS_AT_ONCE):
        rows = slice(first, min(first + _ROWS_AT_ONCE, count))
        stretch = pair.stretch(rows.start, rows.stop)
        sigma = np.where(np.isfinite(stretch.difference_mm), stretch.sigma_mm, np.nan)
        levels[0, rows] = _levels(stretch.difference_mm, -limit, limit)
        levels[1, rows] = _levels(sigma, 0.0, limit / 2)
    return DifferenceLayers(
        _overlay(overlays.deviation, "difference", "Later less earlier radius", -limit, limit, levels[0]),
        _overlay(
            overlays.uncertainty, "difference_sigma", "1 σ of the difference", 0.0, limit / 2, levels[1]
        ),
    )


def _typical_sigma(pair: PairedWalls) -> float:
    """Return the median σ of the difference about the middle of what both runs saw."""
    middle = pair.now.row(float(np.mean(pair.registration.overlap_mm)))
    part = pair.stretch(middle - _SAMPLED_ROWS // 2, middle + _SAMPLED_ROWS // 2)
    return float(np.nanmedian(part.sigma_mm))


def _levels(values_mm: Float, low_mm: float, high_mm: float) -> Byte:
    """Return palette levels 1 to 255 of values, 0 where there is none."""
    at = np.clip((values_mm - low_mm) / (high_mm - low_mm), 0, 1)
    return np.asarray(np.where(np.isfinite(at), 1 + np.rint(254 * np.nan_to_num(at)), 0), np.uint8)


def _overlay(like: Overlay, name: str, title: str, low_mm: float, high_mm: float, level: Byte) -> Overlay:
    beyond = float(np.isin(level, [1, 255]).sum() / max((level > 0).sum(), 1))
    return Overlay(name, title, like.colour_map, low_mm, high_mm, beyond, like.palette_bgr, level)
