"""Process a long map in stretches along the pipe: cut it, take sample rows, fit smooth splines along it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline, make_lsq_spline
from scipy.ndimage import median_filter

from pipeline.adjustment.robust import TUKEY, robust_spread
from pipeline.arrays import Bool, Float

_ROWS = 1000
_SAMPLED_ROWS, _BLOCKS = 2048, 16


@dataclass(frozen=True)
class Stretch:
    """Rows of a map to be computed (``own``), and these with the neighbours they depend on (``wide``)."""

    own: slice
    wide: slice

    @property
    def inner(self) -> slice:
        """The own rows, counted from the first of the wide ones."""
        return slice(self.own.start - self.wide.start, self.own.stop - self.wide.start)


def stretches(rows: int, overlap: int = 0) -> list[Stretch]:
    """Return stretches that cover a map of ``rows`` rows, each with ``overlap`` rows of its neighbours."""
    return [widened(slice(k, min(k + _ROWS, rows)), rows, overlap) for k in range(0, rows, _ROWS)]


def widened(own: slice, rows: int, overlap: int) -> Stretch:
    """Return the rows ``own`` of a map of ``rows`` rows, with ``overlap`` neighbours on either side."""
    return Stretch(own, slice(max(0, own.start - overlap), min(rows, own.stop + overlap)))


def sample(usable: Bool) -> tuple[slice, ...]:
    """Return rows for robust statistics: all of a short map, else blocks spread over ``usable`` rows (S,)."""
    rows, at = len(usable), np.flatnonzero(usable)
    size = _SAMPLED_ROWS // _BLOCKS
    if rows <= _SAMPLED_ROWS or not at.size:
        return (slice(0, rows),)
    spread = at[np.rint(np.linspace(0, len(at) - 1, _BLOCKS)).astype(int)]
    starts = np.unique(np.clip(spread - size // 2, 0, rows - size))
    return tuple(slice(int(first), int(first) + size) for first in starts)


def slow_along(distance_mm: Float, coefficients: Float, smooth_mm: float) -> Float:
    """Return harmonics (S, 5), mm, smoothed by robust cubic splines with knots ``smooth_mm`` apart.

    Rows without a finite value are interpolated; fewer than 8 finite rows give their median everywhere.
    """
    good = np.isfinite(coefficients[:, 0])
    if good.sum() < 8:
        return np.tile(np.nanmedian(coefficients, 0), (len(coefficients), 1))
    s = distance_mm[good]
    pieces = max(1, int((s[-1] - s[0]) // smooth_mm))
    inner = np.quantile(s, np.linspace(0, 1, pieces + 1)[1:-1])
    knots = np.concatenate([[s[0]] * 4, inner, [s[-1]] * 4])
    splines = [_robust_spline(s, c, knots, smooth_mm) for c in coefficients[good].T]
    return np.stack([b(np.clip(distance_mm, s[0], s[-1])) for b in splines], -1)


def _robust_spline(s: Float, value: Float, knots: Float, smooth_mm: float) -> BSpline:
    window = min(len(s), max(3, round(smooth_mm / max(1e-9, float(np.median(np.diff(s)))))))
    fitted = median_filter(value, window, mode="nearest")
    for _ in range(12):
        residual = value - fitted
        scale = max(robust_spread(residual), 1e-6)
        u = residual / (TUKEY * scale)
        weight = np.where(np.abs(u) < 1, 1 - u * u, 0.0) + 1e-4
        spline = make_lsq_spline(s, value, knots, k=3, w=weight)
        fitted = spline(s)
    return spline
