"""Ring by ring and along the pipe: the harmonics of which the pipe's own smooth shape is made."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import BSpline, make_lsq_spline
from scipy.ndimage import median_filter

from pipeline.adjustment.robust import MAD_TO_SIGMA, robust_spread
from pipeline.arrays import Float

_HARMONICS = 2
_TUKEY = 4.685
_SECTORS = 240


def basis_of(azimuth_rad: Float) -> Float:
    """Return (A, 5): 1, cos ψ, sin ψ, cos 2ψ, sin 2ψ."""
    waves = [f(m * azimuth_rad) for m in range(1, _HARMONICS + 1) for f in (np.cos, np.sin)]
    return np.stack([np.ones_like(azimuth_rad), *waves], -1)


def ring_harmonics(radius: Float, basis: Float) -> Float:
    """Return (S, 5) harmonics of every row by a redescending fit; NaN for rows seen to less than a half."""
    radius, basis = _sectors(radius), _sectors(basis.T).T
    seen = np.isfinite(radius)
    usable = seen.mean(1) >= 0.5
    out = np.full((len(radius), basis.shape[1]), np.nan)
    values, weight = np.where(seen, radius, 0.0)[usable], seen[usable]
    found = np.zeros((len(values), basis.shape[1]))
    found[:, 0] = row_median(radius[usable])
    products = (basis[:, :, None] * basis[:, None, :]).reshape(len(basis), -1)
    for _ in range(12):
        residual = np.where(weight, values - found @ basis.T, np.nan)
        scale = MAD_TO_SIGMA * row_median(np.abs(residual))
        u = np.nan_to_num(residual / (_TUKEY * np.maximum(scale, 1e-6))[:, None], nan=2.0)
        w = np.where(np.abs(u) < 1, (1 - u * u) ** 2, 0.0)
        normal = (w @ products).reshape(-1, basis.shape[1], basis.shape[1])
        normal += 1e-6 * np.eye(basis.shape[1])
        found = np.linalg.solve(normal, ((w * values) @ basis)[..., None])[..., 0]
    out[usable] = found
    return out


def _sectors(rows: Float) -> Float:
    """Return the means (S, A / k) of k neighbouring columns; NaN where half of them or more was not seen."""
    width = next(k for k in range(max(1, rows.shape[1] // _SECTORS), 0, -1) if rows.shape[1] % k == 0)
    blocks = rows.reshape(len(rows), -1, width)
    count = np.isfinite(blocks).sum(2)
    total = np.nan_to_num(blocks).sum(2)
    return np.asarray(np.where(2 * count > width, total / np.maximum(count, 1), np.nan))


def row_median(rows: Float) -> Float:
    """Return the median (S,) of every row's seen values; faster than NumPy's where values are missing."""
    ordered = np.sort(rows, 1)
    count = np.isfinite(ordered).sum(1)
    low, high = np.maximum(count - 1, 0) // 2, count // 2
    pair = np.take_along_axis(ordered, np.stack([low, np.minimum(high, rows.shape[1] - 1)], -1), 1)
    return np.asarray(pair.mean(1))


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
        u = residual / (_TUKEY * scale)
        weight = np.where(np.abs(u) < 1, 1 - u * u, 0.0) + 1e-4
        spline = make_lsq_spline(s, value, knots, k=3, w=weight)
        fitted = spline(s)
    return spline
