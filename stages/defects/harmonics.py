"""Along the pipe: the harmonics of its rings as smooth curves, the pipe's own shape."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import BSpline, make_lsq_spline
from scipy.ndimage import median_filter

from pipeline.adjustment.robust import TUKEY, robust_spread
from pipeline.arrays import Float


def slow_along(distance_mm: Float, coefficients: Float, smooth_mm: float) -> Float:
    """Return (S, 5) coefficients as robust cubic splines with knots ``smooth_mm`` apart."""
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
