"""Noise and clipping of the images, learned from the recording itself."""

from __future__ import annotations

import numba
import numpy as np
from scipy.optimize import nnls

from pipeline.adjustment.robust import robust_spread
from pipeline.arrays import Byte, Int32
from stages.rings.kernels import bell, first_at_least
from stages.rings.picture import Image, channels, everywhere, grey_at
from stages.rings.profile import WINDOW_WIDTHS, ProfileFit, Response
from stages.rings.sectors import Sectors

QUANTISATION_VARIANCE = 1 / 12
_BINS, _BIN_LEVELS = 32, 8.0
_ABSOLUTE_TO_SIGMA = np.sqrt(np.pi / 2)
_LEAST_RESIDUALS = 50
# Noise and coding blur clipped pixels by a few levels: 5 % below white is not clipped.
SURELY_UNCLIPPED = 0.95


def dark_response(image: Image, clip_level: float) -> Response:
    """Return a first guess from the image alone: median level and robust noise of neighbouring pixels."""
    grey = everywhere(image)
    step = np.diff(grey.astype(np.float32), axis=1)
    variance = robust_spread(step) ** 2 / 2
    return Response(float(np.median(grey)), variance + QUANTISATION_VARIANCE, 0.0, clip_level)


def noise_response(image: Image, sectors: Sectors, fit: ProfileFit, guess: Response) -> Response:
    """Return ``guess`` with the variance at black and per level as estimated from the fit's residuals.

    Mean absolute residuals are used, so that a few misfitted sectors have no more weight than their number.
    """
    total, count, sectors = np.zeros(_BINS), np.zeros(_BINS), sectors.taken or sectors
    _residuals_by_level(
        *channels(image), sectors.start, sectors.pixel, sectors.radius_px, fit.radius_px, fit.width_px,
        fit.amplitude, fit.background, guess.black, guess.clip_level, total, count,
    )  # fmt: skip
    used = count > _LEAST_RESIDUALS
    if not used.any():
        return guess
    level = (np.arange(_BINS) + 0.5)[used] * _BIN_LEVELS
    variance = np.maximum((_ABSOLUTE_TO_SIGMA * total[used] / count[used]) ** 2, QUANTISATION_VARIANCE)
    design = np.stack([np.ones_like(level), level], 1) / variance[:, None]
    dark, per_level = nnls(design, np.ones_like(level))[0]
    return guess._replace(
        variance=max(float(dark), QUANTISATION_VARIANCE), variance_per_level=float(per_level)
    )


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _residuals_by_level(  # type: ignore[no-untyped-def]
    image, weights, start, pixel, radius, r, width, amplitude, background, black, clip_level, total, count
):
    for a in range(r.size):
        if not np.isfinite(r[a]):
            continue
        half, per_width = WINDOW_WIDTHS * width[a], 1 / width[a]
        k = first_at_least(radius, start[a], start[a + 1], r[a] - half)
        while k < start[a + 1] and radius[k] < r[a] + half:
            m = background[a] + amplitude[a] * bell((radius[k] - r[a]) * per_width)
            level = int((m - black) * (1 / _BIN_LEVELS))
            if 0 <= level < total.size and m < clip_level:
                total[level] += abs(grey_at(image, weights, pixel[k]) - m)
                count[level] += 1.0
            k += 1


def clip_level_of(grey: Byte, bgr: Byte, line: Int32) -> float:
    """Return the grey level at which the line's strongest channel clips.

    Grey is a fixed linear mixture of the channels, and a laser line keeps its colour: both are estimated from
    the pixels of the ``line`` (flat indices).
    """
    colour, level = bgr.reshape(-1, 3)[line].astype(float), grey.ravel()[line].astype(float)
    white = float(np.iinfo(bgr.dtype).max)
    strongest = int(np.argmax(colour.mean(0)))
    unclipped = (colour < SURELY_UNCLIPPED * white).all(1)
    bright = unclipped & (colour[:, strongest] > np.median(colour[:, strongest]))
    if bright.sum() < _LEAST_RESIDUALS:
        return white
    design = np.column_stack([colour[unclipped], np.ones(int(unclipped.sum()))])
    *mixture, black = np.linalg.lstsq(design, level[unclipped], rcond=None)[0]
    ratio = np.median(colour[bright] / colour[bright, strongest, None], axis=0)
    return float(black + white * (ratio @ np.array(mixture)))
