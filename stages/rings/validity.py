"""Rejects samples that contradict their neighbours."""

from __future__ import annotations

from dataclasses import replace

import numba
import numpy as np
from scipy.ndimage import uniform_filter1d

from pipeline.adjustment.robust import MAD_TO_SIGMA, robust_spreads
from pipeline.arrays import Bool, Byte, Float32, Int
from pipeline.artefacts.measured import RingSamples, RingValidity
from stages.rings.glints import WALL_RINGS, lone_runs
from stages.rings.kernels import median, take_finite
from stages.rings.search import BAND_WIDTHS
from stages.rings.turning import turned, turns

_NEIGHBOURS = 9
_OUTLIER_SIGMAS = 6.0
_MAJORITY = 0.5


def contradicted(rings: RingSamples) -> tuple[Byte, Float32]:
    """Return validity and σ (F, A), px, of rings after every sample was compared with its neighbours.

    Where something turns from ring to ring, neighbours may confirm a sample at its azimuth or turned: it may
    be the probe that rolls, or a spiral seam in front of a probe that does not.
    """
    validity, sigma = _compared(rings)
    by = turns(np.where(rings.valid, rings.radius_px, np.float32(np.nan)))
    if not by.any():
        return validity, sigma
    aligned = _compared(_turned(rings, -by))
    other, its = turned(aligned[0], by), turned(aligned[1], by)
    own = (validity == RingValidity.VALID) & ((other != RingValidity.VALID) | (sigma <= its))
    return np.where(own, validity, other), np.where(own, sigma, its)


def off_laser_alone(rings: RingSamples, alone: Bool) -> Bool:
    """Return which samples (F, A) of pictures with lit wall lie off the ring that the laser alone shows.

    ``alone`` (F,) are the rings of pictures that the laser alone lights. A ring lies within the band in which
    the next picture is searched; where the wall is lit and clips, the edge of another light is found instead,
    and as these are half of the rings, no comparison of neighbours rejects it.
    """
    off = np.zeros(rings.radius_px.shape, bool)
    seen = np.flatnonzero(alone & (rings.valid.mean(1) > _MAJORITY))
    if not len(seen) or alone.all():
        return off
    course = _running_median(_bridged(rings.radius_px[seen], rings.valid[seen]), _NEIGHBOURS)
    band_px = BAND_WIDTHS * float(np.median(rings.width_px[seen][rings.valid[seen]]))
    for row in np.flatnonzero(~alone):
        near = np.abs(seen - row) <= WALL_RINGS
        if near.any():
            off[row] = (np.abs(rings.radius_px[row] - course[near]) > band_px).all(0) & rings.valid[row]
    return off


def _compared(rings: RingSamples) -> tuple[Byte, Float32]:
    """Return the same for rings that show the wall at the same azimuths."""
    validity = mark_outliers(rings.radius_px, rings.sigma_px, rings.validity)
    radius = np.where(validity == RingValidity.VALID, rings.radius_px, np.float32(np.nan))
    glint, sigma = lone_runs(radius, rings.sigma_px, rings.width_px, rings.amplitude)
    validity[glint] = RingValidity.GLINT
    return validity, sigma


def _turned(rings: RingSamples, by: Int) -> RingSamples:
    """Return rings whose samples are turned by so many sectors (F,)."""
    names = ("radius_px", "sigma_px", "width_px", "amplitude", "validity")
    return replace(rings, **{name: turned(getattr(rings, name), by) for name in names})


def mark_outliers(radius_px: Float32, sigma_px: Float32, validity: Byte) -> Byte:
    """Return ``validity`` (F, A) with those samples marked that leave the curve of their neighbours.

    The running median over nine sectors follows a step and any dent or pit at least five sectors wide;
    narrower ones are kept if the ring before or after shows them at the same place. Where most neighbours are
    rejected, the others are rejected too.
    """
    valid = validity == RingValidity.VALID
    filled = _bridged(radius_px, valid)
    away = filled - _running_median(filled, _NEIGHBOURS)
    limit = _OUTLIER_SIGMAS * np.hypot(_local_spread(away), np.where(valid, sigma_px, 0))
    off = np.where(np.abs(away) > limit, np.sign(away), 0.0)
    confirmed = np.zeros_like(valid)
    confirmed[1:] |= (off[1:] == off[:-1]) & valid[:-1]
    confirmed[:-1] |= (off[:-1] == off[1:]) & valid[1:]
    kept = valid & ((off == 0) | confirmed)
    alone = uniform_filter1d(kept.astype(float), _NEIGHBOURS, axis=1, mode="wrap") < _MAJORITY
    out = validity.copy()
    out[valid & (~kept | alone)] = RingValidity.OUTLIER
    return out


@numba.njit(cache=True, nogil=True)
def middle_and_spread(values):  # type: ignore[no-untyped-def]
    """Median, and 1 σ about it as `spread_about_median`, of the finite ``values`` (N,); 0, 0 without any."""
    finite = take_finite(values, np.empty(values.size))
    if finite.size == 0:
        return 0.0, 0.0
    middle = median(finite)
    for k in range(finite.size):
        finite[k] = abs(finite[k] - middle)
    return middle, MAD_TO_SIGMA * median(finite)


def _local_spread(away: Float32) -> Float32:
    """Robust 1 σ (F, A) of ``away`` in the neighbourhood, values limited to three of the whole frame's."""
    frame = robust_spreads(away, axis=1)[:, None]
    limited = np.minimum(np.abs(away), 3 * frame)
    return np.asarray(
        np.sqrt(np.pi / 2) * uniform_filter1d(limited, 8 * _NEIGHBOURS + 1, axis=1, mode="wrap")
    )


@numba.njit(cache=True, nogil=True)
def _running_median(values, sectors):  # type: ignore[no-untyped-def]
    """Median over ``sectors`` neighbours (odd) around the circle, of values (F, A)."""
    rows, columns = values.shape
    half = sectors // 2
    out = np.empty_like(values)
    window = np.empty(sectors, values.dtype)
    for row in range(rows):
        for column in range(columns):
            for k in range(sectors):
                v = values[row, (column + k - half) % columns]
                at = k
                while at > 0 and window[at - 1] > v:
                    window[at] = window[at - 1]
                    at -= 1
                window[at] = v
            out[row, column] = window[half]
    return out


def _bridged(radius_px: Float32, valid: Bool) -> Float32:
    """Return ``radius_px`` (F, A) with gaps bridged around the circle; 0 in frames without a sample."""
    out = radius_px.copy()
    sectors = np.arange(radius_px.shape[1])
    for row, good in zip(out, valid, strict=True):
        if good.any() and not good.all():
            row[~good] = np.interp(sectors[~good], sectors[good], row[good], period=len(sectors))
    out[~valid.any(1)] = 0
    return out
