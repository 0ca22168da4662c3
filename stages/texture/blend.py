"""Tiles of the flat picture blended from many views, robustly."""

from __future__ import annotations

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipeline.adjustment.robust import MAD_TO_SIGMA
from pipeline.arrays import Byte, Image, Int
from stages.texture.project import TileProjection

Short = NDArray[np.uint16]

# Reflectance is kept as multiples of 1 / 32 of a grey level at the reference brightness.
REFLECTANCE_SCALE = 32.0
_SATURATED = 250
# Above the largest number of views a tile may have; with 18 bits of brightness a key fits in 31 bits.
_MOST_VIEWS = 256
_NO_SAMPLE = np.int32(2**31 - 1)
# Pixels whose samples are sorted side by side: two registers of 16 numbers of 32 bits where there are such.
_AT_ONCE = 32


class TileStack:
    """Samples of one tile's pixels in up to ``views`` views."""

    def __init__(self, views: int, rows: int, columns: int) -> None:
        # Views before columns: samples of a view are written one after the other.
        self._values = np.empty((rows, views, columns, 3), np.uint16)
        self._weights = np.zeros((rows, views, columns), np.uint8)
        self._used = 0

    def add(self, image: Image, projection: TileProjection) -> None:
        """Sample a view's ``image`` (H, W, 3) where ``projection`` puts the tile's pixels."""
        seen = np.flatnonzero(projection.weight.any(1))
        if seen.size:
            rows = slice(seen[0], seen[-1] + 1)
            uv = projection.uv[rows]
            _store(
                cv2.remap(image, uv[..., 0], uv[..., 1], cv2.INTER_CUBIC),
                projection.inverse_brightness[rows], projection.weight[rows], self._used,
                self._values[rows], self._weights[rows],
            )  # fmt: skip
        self._used += 1

    def blend(self) -> tuple[Short, Byte]:
        """Return the blended colours (rows, columns, 3) and how many samples stand behind each."""
        return blend_samples(self._values, self._weights)


@njit(cache=True, nogil=True)
def _store(sample, inverse_brightness, weight, view, values, weights):  # type: ignore[no-untyped-def]
    """Write a view's samples and weights; values of weight 0 mean nothing."""
    rows, columns = weight.shape
    gain = np.empty(3 * columns)
    for i in range(rows):
        colour, line = sample[i].reshape(-1), values[i, view].reshape(-1)
        for j in range(columns):
            gain[3 * j] = gain[3 * j + 1] = gain[3 * j + 2] = REFLECTANCE_SCALE * inverse_brightness[i, j]
        for k in range(3 * columns):
            line[k] = np.uint16(min(65535.0, colour[k] * gain[k] + 0.5))
        for j in range(columns):
            w = weight[i, j]
            brightest = max(colour[3 * j], colour[3 * j + 1], colour[3 * j + 2])
            # A clipped sample counts only where there is no other.
            worth = 1 if brightest >= _SATURATED else max(1, min(255, int(254 * w) + 1))
            weights[i, view, j] = worth if w > 0 else 0


def _sorting_network(keys: int) -> Int:
    """Return the pairs (N, 2) of places to be put in order one after the other to sort so many keys.

    K. Batcher, "Sorting networks and their applications", 1968: odd-even merge sort. Which pairs there are
    does not depend on the keys, so that many pixels are sorted by the same instructions.
    """
    pairs, size = [], 1
    while size < keys:
        apart = size
        while apart >= 1:
            for j in range(apart % size, keys - apart, 2 * apart):
                for low in range(j, j + min(apart, keys - j - apart)):
                    if low // (2 * size) == (low + apart) // (2 * size):
                        pairs.append((low, low + apart))
            apart //= 2
        size *= 2
    return np.array(pairs, np.int64).reshape(-1, 2)


@njit(cache=True, nogil=True)
def _sorted_keys(values, weights, first, end, network, key):  # type: ignore[no-untyped-def]
    """Write the keys of some pixels' samples to ``key`` (views, pixels), each pixel's in ascending order.

    A key is four times the brightness and then the view; samples without weight come last, as `_NO_SAMPLE`.
    """
    for k in range(len(key)):
        for j in range(first, end):
            four = np.int32(values[k, j, 0]) + 2 * np.int32(values[k, j, 1]) + np.int32(values[k, j, 2])
            own = four * np.int32(_MOST_VIEWS) + np.int32(k)
            key[k, j - first] = own if weights[k, j] > 0 else _NO_SAMPLE
    for m in range(len(network)):
        low, high = key[network[m, 0]], key[network[m, 1]]
        for p in range(_AT_ONCE):
            a, b = low[p], high[p]
            low[p], high[p] = min(a, b), max(a, b)


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


def blend_samples(values: Short, weights: Byte) -> tuple[Short, Byte]:
    """Return robust weighted means (rows, columns, 3) and counts (rows, columns).

    Tukey's biweight on brightness about the weighted median, with the weighted median of absolute
    deviations as scale, but at least 3 %: a glint or a passing shadow is left out, noise is averaged.

    Parameters
    ----------
    values : (rows, views, columns, 3) uint16
    weights : (rows, views, columns) uint8
        0 where a view does not show the pixel.
    """
    colour, count = _blended(values, weights, _sorting_network(values.shape[1]))
    return colour, count


@njit(cache=True, nogil=True)
def _blended(values, weights, network):  # type: ignore[no-untyped-def]
    rows, views, columns = weights.shape
    out = np.zeros((rows, columns, 3), np.uint16)
    counts = np.zeros((rows, columns), np.uint8)
    grey, weight = np.empty(views, np.float32), np.empty(views, np.float32)
    where, key = np.empty(views, np.int64), np.zeros((views, _AT_ONCE), np.int32)
    for i in range(rows):
        for first in range(0, columns, _AT_ONCE):
            end = min(first + _AT_ONCE, columns)
            _sorted_keys(values[i], weights[i], first, end, network, key)
            for j in range(first, end):
                n = 0
                while n < views and key[n, j - first] != _NO_SAMPLE:
                    k = key[n, j - first] & (_MOST_VIEWS - 1)
                    grey[n] = 0.25 * (key[n, j - first] // _MOST_VIEWS)
                    weight[n], where[n] = weights[i, k, j], k
                    n += 1
                counts[i, j] = n
                if n > 0:
                    _biweight_mean(values[i, :, j], grey, weight, where, n, out[i, j])
    return out, counts
