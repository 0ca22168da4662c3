"""Tiles of the flat picture blended from many views, robustly."""

from __future__ import annotations

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipeline.adjustment.robust import MAD_TO_SIGMA
from pipeline.arrays import Byte, Image
from stages.texture.project import TileProjection

Short = NDArray[np.uint16]

# Reflectance is kept as multiples of 1 / 32 of a grey level at the reference brightness.
REFLECTANCE_SCALE = 32.0
_SATURATED = 250
# Above the largest number of views a tile may have; with 18 bits of brightness a key fits in 31 bits.
_MOST_VIEWS = 256


class TileStack:
    """Samples of one tile's pixels in up to ``views`` views."""

    def __init__(self, views: int, rows: int, columns: int) -> None:
        # Views before columns: samples of a view are written one after the other.
        self._values = np.zeros((rows, views, columns, 3), np.uint16)
        self._weights = np.zeros((rows, views, columns), np.uint8)
        self._used = 0

    def add(self, image: Image, projection: TileProjection) -> None:
        """Sample a view's ``image`` (H, W, 3) where ``projection`` puts the tile's pixels."""
        uv = projection.uv
        sample = cv2.remap(image, uv[..., 0], uv[..., 1], cv2.INTER_CUBIC)
        _store(
            sample, projection.inverse_brightness, projection.weight, self._used, self._values, self._weights
        )
        self._used += 1

    def blend(self) -> tuple[Short, Byte]:
        """Return the blended colours (rows, columns, 3) and how many samples stand behind each."""
        colour, count = blend_samples(self._values.swapaxes(1, 2), self._weights.swapaxes(1, 2))
        return colour, count


@njit(cache=True, nogil=True)
def _store(sample, inverse_brightness, weight, view, values, weights):  # type: ignore[no-untyped-def]
    rows, columns = weight.shape
    for i in range(rows):
        for j in range(columns):
            w = weight[i, j]
            if w <= 0:
                continue
            brightest = max(sample[i, j, 0], sample[i, j, 1], sample[i, j, 2])
            # A clipped sample counts only where there is no other.
            weights[i, view, j] = 1 if brightest >= _SATURATED else max(1, min(255, int(254 * w) + 1))
            gain = REFLECTANCE_SCALE * inverse_brightness[i, j]
            for c in range(3):
                values[i, view, j, c] = min(65535, int(sample[i, j, c] * gain + 0.5))


@njit(cache=True, nogil=True)
def _sort_in(values, weights, key, grey, weight, where):  # type: ignore[no-untyped-def]
    """Put the brightness of one pixel's samples into ``grey`` in ascending order; return how many.

    A sample's place is how many keys are below its own, four times the brightness and then the view; counting
    them is quicker than sorting, as many are compared at once.
    """
    n = 0
    for k in range(len(weights)):
        if weights[k] > 0:
            four = np.int32(values[k, 0]) + 2 * np.int32(values[k, 1]) + np.int32(values[k, 2])
            key[n] = four * _MOST_VIEWS + k
            n += 1
    for m in range(n):
        own, place = key[m], np.int32(0)
        for other in range(n):
            place += np.int32(key[other] < own)
        k = own & (_MOST_VIEWS - 1)
        grey[place], weight[place], where[place] = 0.25 * (own // _MOST_VIEWS), weights[k], k
    return n


@njit(cache=True, nogil=True)
def _middle_and_spread(grey, weight, n):  # type: ignore[no-untyped-def]
    """Return weighted median and weighted median absolute deviation of n sorted values."""
    half = 0.0
    for m in range(n):
        half += 0.5 * weight[m]
    low, below = 0, weight[0]
    while below < half and low < n - 1:
        low += 1
        below += weight[low]
    middle, within, spread = grey[low], weight[low], 0.0
    high = low + 1
    low -= 1
    while within < half and (low >= 0 or high < n):
        if high >= n or (low >= 0 and middle - grey[low] <= grey[high] - middle):
            spread = middle - grey[low]
            within += weight[low]
            low -= 1
        else:
            spread = grey[high] - middle
            within += weight[high]
            high += 1
    return middle, spread


@njit(cache=True, nogil=True)
def _biweight_mean(values, grey, weight, where, n, out):  # type: ignore[no-untyped-def]
    """Write the robust mean colour of one pixel's n samples to ``out`` (3,)."""
    middle, spread = _middle_and_spread(grey, weight, n)
    limit = 4.685 * max(MAD_TO_SIGMA * spread, 0.03 * middle + 1.0)
    total, blue, green, red = 0.0, 0.0, 0.0, 0.0
    for m in range(n):
        x = (grey[m] - middle) / limit
        if x * x < 1:
            w = weight[m] * (1 - x * x) ** 2
            total += w
            blue += w * values[where[m], 0]
            green += w * values[where[m], 1]
            red += w * values[where[m], 2]
    out[0], out[1], out[2] = int(blue / total + 0.5), int(green / total + 0.5), int(red / total + 0.5)


@njit(cache=True, nogil=True)
def blend_samples(values, weights):  # type: ignore[no-untyped-def]
    """Return robust weighted means (rows, columns, 3) and counts (rows, columns).

    Tukey's biweight on brightness about the weighted median, with the weighted median of absolute
    deviations as scale, but at least 3 %: a glint or a passing shadow is left out, noise is averaged.

    Parameters
    ----------
    values : (rows, columns, views, 3) uint16
    weights : (rows, columns, views) uint8
        0 where a view does not show the pixel.
    """
    rows, columns, views = weights.shape
    out = np.zeros((rows, columns, 3), np.uint16)
    counts = np.zeros((rows, columns), np.uint8)
    grey, weight = np.empty(views, np.float32), np.empty(views, np.float32)
    where, key = np.empty(views, np.int64), np.empty(views, np.int32)
    for i in range(rows):
        for j in range(columns):
            n = _sort_in(values[i, j], weights[i, j], key, grey, weight, where)
            counts[i, j] = n
            if n > 0:
                _biweight_mean(values[i, j], grey, weight, where, n, out[i, j])
    return out, counts
