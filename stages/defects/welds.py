"""All-round beads: rows of the wall where the whole ring stands off, for no longer than a weld is."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.ndimage import find_objects, gaussian_filter1d, label

from pipeline.adjustment.robust import robust_spread
from pipeline.arrays import Bool, Float
from stages.defects.parameters import DefectParameters


def weld_rows(
    deviation: Callable[[slice], Float], mean_mm: Float, step: float, parameters: DefectParameters
) -> tuple[slice, ...]:
    """Return the rows of all beads.

    ``deviation`` gives some rows (rows, A) of the wall's deviation from its slow shape, ``mean_mm`` (S,) is
    the mean of every row of it.
    """
    mean = gaussian_filter1d(np.nan_to_num(mean_mm), 0.5 / step)
    limit = max(parameters.min_depth_mm / 2, 6 * robust_spread(mean))
    longest = int(parameters.max_weld_mm / step)
    out: list[slice] = []
    for sign in (-1.0, 1.0):
        height = sign * mean
        for rows in _runs(height > limit):
            peak = rows.start + int(np.argmax(height[rows]))
            bead = _run_around(height, peak, max(limit / 2, 0.15 * height[peak]), longest)
            if bead is None or bead in out:
                continue
            if _all_round(sign * deviation(bead), height[peak]):
                out.append(bead)
    return tuple(sorted(out, key=lambda r: r.start))


def _run_around(height: Float, peak: int, level: float, longest: int) -> slice | None:
    """Return the rows about ``peak`` that are above ``level``, None where they are more than ``longest``."""
    first = max(0, peak - longest - 1)
    near = height[first : peak + longest + 2] > level
    bead = next(r for r in _runs(near) if r.start <= peak - first < r.stop)
    return slice(bead.start + first, bead.stop + first) if bead.stop - bead.start <= longest else None


def _runs(mask: Bool) -> list[slice]:
    labels, _ = label(mask)
    return [rows for (rows,) in find_objects(labels)]


def _all_round(height: Float, peak: float) -> bool:
    """Tell whether a bead (rows, A) reaches a third of its peak in nine of ten sectors that were seen."""
    seen = np.isfinite(height)
    sectors = [
        (np.where(s, h, 0.0).sum(1) / np.maximum(s.sum(1), 1)).max()
        for h, s in zip(np.array_split(height, 24, axis=1), np.array_split(seen, 24, axis=1), strict=True)
        if s.mean() > 0.5
    ]
    return len(sectors) >= 12 and float(np.mean(np.array(sectors) > peak / 3)) >= 0.9
