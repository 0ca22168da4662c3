"""What only neighbours tell: samples off the ring, and how much the line wanders beyond its noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter, uniform_filter1d

from pipeline.artefacts import Byte, Float, Float32, RingValidity

_NEIGHBOURS = 9
_OUTLIER_SIGMAS = 6.0
_MAJORITY = 0.5
_LAG = 4


def mark_outliers(radius_px: Float32, sigma_px: Float32, validity: Byte) -> Byte:
    """Return ``validity`` (F, A) with samples marked that leave the run of their neighbours.

    The running median over nine sectors follows a step and any dent or pit at least five sectors wide; what
    is narrower is kept when the ring before or after shows it at the same place. Where most neighbours are
    rejected, the rest is not trusted either.
    """
    valid = validity == RingValidity.VALID
    filled = _bridged(radius_px, valid)
    away = filled - _running_median(filled, _NEIGHBOURS)
    local = 1.4826 * _running_median(np.abs(away), 8 * _NEIGHBOURS + 1)
    limit = _OUTLIER_SIGMAS * np.hypot(local, np.where(valid, sigma_px, 0))
    off = np.where(np.abs(away) > limit, np.sign(away), 0.0)
    confirmed = np.zeros_like(valid)
    confirmed[1:] |= (off[1:] == off[:-1]) & valid[:-1]
    confirmed[:-1] |= (off[:-1] == off[1:]) & valid[1:]
    out = validity.copy()
    kept = valid & ((off == 0) | confirmed)
    alone = _running_share(kept, _NEIGHBOURS) < _MAJORITY
    out[valid & (~kept | alone)] = RingValidity.OUTLIER
    return out


def wander_px(radius_px: Float32, sigma_px: Float32, validity: Byte) -> float:
    """Return the 1 σ, px, by which the line wanders beyond ``sigma_px``: speckle, texture, compression.

    From second differences over ``_LAG`` sectors, far enough apart to share neither pixels nor speckle and
    near enough for the wall to be straight; medians keep true edges out of it.
    """
    radius = np.where(validity == RingValidity.VALID, radius_px, np.nan).astype(float)
    bend = np.roll(radius, _LAG, 1) - 2 * radius + np.roll(radius, -_LAG, 1)
    known = np.isfinite(bend)
    if not known.any():
        return 0.0
    variance = np.where(known, sigma_px, 0.0).astype(float) ** 2
    expected = (np.roll(variance, _LAG, 1) + 4 * variance + np.roll(variance, -_LAG, 1))[known]
    total = (1.4826 * np.median(np.abs(bend[known]))) ** 2
    return float(np.sqrt(max(total - np.median(expected), 0.0) / 6))


def _running_share(where: NDArray[np.bool_], sectors: int) -> Float:
    """Share of true among ``sectors`` neighbours (odd) around the circle, of (F, A)."""
    return np.asarray(uniform_filter1d(where.astype(float), sectors, axis=1, mode="wrap"))


def _running_median(values: Float32, sectors: int) -> Float32:
    """Median over ``sectors`` neighbours (odd) around the circle, of values (F, A)."""
    half = sectors // 2
    wide = np.pad(values, ((0, 0), (half, half)), mode="wrap")
    return np.asarray(median_filter(wide, size=(1, sectors))[:, half:-half])


def _bridged(radius_px: Float32, valid: NDArray[np.bool_]) -> Float32:
    out = radius_px.copy()
    sectors = np.arange(radius_px.shape[1])
    for row, good in zip(out, valid, strict=True):
        if good.any() and not good.all():
            row[~good] = np.interp(sectors[~good], sectors[good], row[good], period=len(sectors))
    out[~valid.any(1)] = 0
    return out
