"""Matched fit of the line's profile in every azimuth sector, with the Cramér–Rao σ of its position.

The pixels of a sector near the ring are modelled as a Gaussian across the line on a linear background,

    m(ρ, δ) = A exp(−x² / 2w²) + b₀ + b₁ (ρ − r₀),  x = ρ − r − r′(ψ) δ,

fitted by weighted Gauss–Newton steps; pixels that the model puts near the clipping level are left out. With
weights 1 / variance the inverse normal matrix is the inverse Fisher information, hence the Cramér–Rao bound.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from pipeline.arrays import Float
from stages.rings.kernels import (
    FAST,
    bell,
    factor,
    first_at_least,
    inverse_diagonal,
    neighbours_joined,
    solve,
)
from stages.rings.picture import Image, channels, grey_at
from stages.rings.sectors import Sectors

WINDOW_WIDTHS = 5.0
_FLANK = 0.6
_STEPS, _FULL_STEPS = 12, 4
_LOG_WIDTH_PRIOR = 0.3
_SLOPE_SECTORS = 6
_CLIP_SIGMAS = 2.0
# Steps converge quadratically: after a step this small, the rest is less than a hundredth of it.
_SETTLED_WIDTHS, _SETTLED_LOG_WIDTH = 0.03, 0.06


class Response(NamedTuple):
    """Black level, noise and clipping of the grey levels.

    ``black``: level without light; ``variance`` there and ``variance_per_level`` above it (shot noise);
    ``clip_level``: level at which the line's strongest channel clips.
    """

    black: float
    variance: float
    variance_per_level: float
    clip_level: float

    @property
    def dark_noise(self) -> float:
        """1 σ, grey levels, where there is no line."""
        return float(np.sqrt(self.variance))

    @property
    def trusted_level(self) -> float:
        """Level below which noise hardly ever reaches the clipping level."""
        if not np.isfinite(self.clip_level):
            return self.clip_level
        noise = np.sqrt(self.variance + self.variance_per_level * max(self.clip_level - self.black, 0.0))
        return float(self.clip_level - _CLIP_SIGMAS * noise)


class ProfileFit(NamedTuple):
    """Fitted profiles, (A,) each; NaN where none could be fitted.

    ``radius_px``, ``width_px`` (1 σ), ``amplitude`` and ``background`` in grey levels, ``sigma_px`` and
    ``amplitude_sigma`` from the Fisher information, ``chi2`` per degree of freedom, ``unclipped_below`` and
    ``unclipped_above``: number of pixels of the inner and outer flank (0.5 to 3 widths) that did not clip.
    """

    radius_px: Float
    width_px: Float
    amplitude: Float
    background: Float
    sigma_px: Float
    amplitude_sigma: Float
    chi2: Float
    clipped: Float
    unclipped_below: Float
    unclipped_above: Float


def fit_line(
    image: Image,
    sectors: Sectors,
    seed_px: Float,
    width_px: float,
    response: Response,
    every: int = 1,
) -> ProfileFit:
    """Fit the line near ``seed_px`` (A,) in the sectors of ``image`` (H, W), or in one of ``every`` so many.

    NaN seeds are left out.
    """
    known, sectors = np.isfinite(seed_px), sectors.taken or sectors
    filled = np.where(known, seed_px, np.nanmean(seed_px)) if known.any() else seed_px
    step = sectors.azimuth_rad[1] - sectors.azimuth_rad[0]
    slope = (np.roll(filled, -_SLOPE_SECTORS) - np.roll(filled, _SLOPE_SECTORS)) / (2 * _SLOPE_SECTORS * step)
    fitted = np.full(len(seed_px), np.nan)
    fitted[::every] = seed_px[::every]
    out = np.empty((len(ProfileFit._fields), len(seed_px)))
    _fit_sectors(
        *channels(image), sectors.start, sectors.pixel, sectors.radius_px, sectors.offset_rad,
        fitted, slope, width_px, response, response.trusted_level, out,
    )  # fmt: skip
    return ProfileFit(*out)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _gather(image, weights, start, pixel, radius, offset, a, seed, slope, half, y, t):  # type: ignore[no-untyped-def]
    """Copy grey levels and distances to the seed of sector ``a``'s pixels near it; return their number.

    Where sectors are narrower than a pixel, whole neighbours are added until there is enough to fit.
    """
    sectors = start.size - 1
    step, aside = 2 * np.pi / sectors, neighbours_joined(sectors, seed)
    count = 0
    for turn in range(-aside, aside + 1):
        b = (a + turn) % sectors
        k = first_at_least(radius, start[b], start[b + 1], seed - half)
        while k < start[b + 1] and radius[k] <= seed + half and count < y.size:
            y[count] = grey_at(image, weights, pixel[k])
            t[count] = radius[k] - seed - slope * (offset[k] + turn * step)
            count += 1
            k += 1
    return count


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _guess(y, t, count, width, p):  # type: ignore[no-untyped-def]
    """Initialise ``p`` = (r − seed, ln w, A, b0, b1) from flanks and peak; False if a flank is not seen."""
    edge = _FLANK * WINDOW_WIDTHS * width
    top, inner, inners, outer, outers = 0.0, 0.0, 0, 0.0, 0
    for k in range(count):
        if t[k] < -edge:
            inner += y[k]
            inners += 1
        elif t[k] > edge:
            outer += y[k]
            outers += 1
        elif abs(t[k]) < width and y[k] > top:
            top = y[k]
    if inners == 0 or outers == 0:
        return False
    inner /= inners
    outer /= outers
    p[0], p[1], p[3] = 0.0, np.log(width), 0.5 * (inner + outer)
    p[2], p[4] = max(top - p[3], 1.0), (outer - inner) / ((1 + _FLANK) * WINDOW_WIDTHS * width)
    return True


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _normal_equations(y, t, count, p, response, trusted, n, v):  # type: ignore[no-untyped-def]
    """Fill ``n`` (5, 5) and ``v`` (5,) at parameters p = (r − seed, ln w, A, b0, b1); return χ²."""
    r, height, b0, b1 = p[0], p[2], p[3], p[4]
    iw = np.exp(-p[1])
    black, variance, per_level, _ = response
    n00 = n10 = n11 = n20 = n21 = n22 = n30 = n31 = n32 = n33 = n40 = n41 = n42 = n43 = n44 = 0.0
    v0 = v1 = v2 = v3 = v4 = chi2 = 0.0
    for k in range(count):
        x = (t[k] - r) * iw
        e = bell(x)
        m = height * e + b0 + b1 * t[k]
        light = m - black if m > black else 0.0
        weight = (0.0 if m > trusted else 1.0) / (variance + per_level * light)
        residual = y[k] - m
        d0 = height * e * x * iw
        d1 = height * e * x * x
        w0, w1, w2, w3, w4 = weight * d0, weight * d1, weight * e, weight, weight * t[k]
        chi2 += weight * residual * residual
        v0 += w0 * residual
        v1 += w1 * residual
        v2 += w2 * residual
        v3 += w3 * residual
        v4 += w4 * residual
        n00 += w0 * d0
        n10 += w1 * d0
        n11 += w1 * d1
        n20 += w2 * d0
        n21 += w2 * d1
        n22 += w2 * e
        n30 += w3 * d0
        n31 += w3 * d1
        n32 += w3 * e
        n33 += w3
        n40 += w4 * d0
        n41 += w4 * d1
        n42 += w4 * e
        n43 += w4
        n44 += w4 * t[k]
    n[0, 0], n[1, 0], n[1, 1], n[2, 0], n[2, 1], n[2, 2] = n00, n10, n11, n20, n21, n22
    n[3, 0], n[3, 1], n[3, 2], n[3, 3] = n30, n31, n32, n33
    n[4, 0], n[4, 1], n[4, 2], n[4, 3], n[4, 4] = n40, n41, n42, n43, n44
    v[0], v[1], v[2], v[3], v[4] = v0, v1, v2, v3, v4
    return chi2


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _flank_counts(t, count, p, trusted):  # type: ignore[no-untyped-def]
    """Return the numbers of clipped pixels, and of unclipped ones on the inner and the outer flank."""
    clipped, inner, outer = 0, 0, 0
    iw = np.exp(-p[1])
    may_clip = p[2] + p[3] + abs(p[4]) / iw > trusted
    for k in range(count):
        x = (t[k] - p[0]) * iw
        if may_clip and p[2] * np.exp(-0.5 * x * x) + p[3] + p[4] * t[k] > trusted:
            clipped += 1
        elif -_FLANK * WINDOW_WIDTHS < x < -0.5:
            inner += 1
        elif 0.5 < x < _FLANK * WINDOW_WIDTHS:
            outer += 1
    return clipped, inner, outer


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _settle(y, t, count, width, response, trusted, n, v, p):  # type: ignore[no-untyped-def]
    """Take Gauss–Newton steps from ``p`` until they are negligible; return χ², or NaN.

    A weak prior on ln w holds the width where clipping leaves little of the profile. Late steps are halved:
    the weights depend on the model, so that full steps may oscillate.
    """
    for step in range(_STEPS):
        chi2 = _normal_equations(y, t, count, p, response, trusted, n, v)
        n[1, 1] += 1.0 / _LOG_WIDTH_PRIOR**2
        v[1] += (np.log(width) - p[1]) / _LOG_WIDTH_PRIOR**2
        if not factor(n):
            return np.nan
        solve(n, v)
        if step >= _FULL_STEPS:
            v *= 0.5
        settled = abs(v[0]) < _SETTLED_WIDTHS * width and abs(v[1]) < _SETTLED_LOG_WIDTH
        v[0] = min(max(v[0], -width), width)
        v[1] = min(max(v[1], -0.3), 0.3)
        p += v
        if abs(p[0]) > WINDOW_WIDTHS * width:
            return np.nan
        if settled:
            return chi2 if p[2] > 0 else np.nan
    return np.nan


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _fit_sectors(image, weights, start, pixel, radius, offset, seed, slope, width, response, trusted, out):  # type: ignore[no-untyped-def]
    n, v, p = np.empty((5, 5)), np.empty(5), np.empty(5)
    half = WINDOW_WIDTHS * width
    y, t = np.empty(int(8 * half) + 64), np.empty(int(8 * half) + 64)
    out[:] = np.nan
    for a in range(seed.size):
        if not np.isfinite(seed[a]):
            continue
        count = _gather(image, weights, start, pixel, radius, offset, a, seed[a], slope[a], half, y, t)
        if count <= v.size or not _guess(y, t, count, width, p):
            continue
        chi2 = _settle(y, t, count, width, response, trusted, n, v, p)
        if np.isnan(chi2):
            continue
        out[0, a], out[1, a], out[2, a], out[3, a] = seed[a] + p[0], np.exp(p[1]), p[2], p[3]
        out[4, a] = np.sqrt(inverse_diagonal(n, 0, v))
        out[5, a] = np.sqrt(inverse_diagonal(n, 2, v))
        out[6, a] = chi2 / (count - v.size)
        out[7, a], out[8, a], out[9, a] = _flank_counts(t, count, p, trusted)
