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
_SCALE = np.float32(REFLECTANCE_SCALE)
_SATURATED = np.uint8(250)
# A key is brightness, 18 bits, above weight, 8 bits; samples without weight come last and weigh nothing.
_BITS, _WEIGHT = np.int32(8), np.int32(255)
_NO_SAMPLE = np.int32((1 << 31) - 256)
_ZERO, _TWO = np.int32(0), np.int32(2)
# Pixels that are worked on side by side: two registers of 16 numbers of 32 bits where there are such.
_AT_ONCE = 32
# A map of pairs needs no second one, and is read without a copy.
_NO_SECOND_MAP = np.empty(0, np.float32)
_QUARTER, _MAD, _TUKEY = np.float32(0.25), np.float32(MAD_TO_SIGMA), np.float32(4.685)
_LEAST, _ONE = np.float32(0.03 * 0.25), np.float32(1.0)


class TileStack:
    """Samples of one tile's pixels in up to ``views`` views, each view's one after the other.

    Used for one tile after the other: memory that the system gives anew costs more than all writing to it.
    """

    def __init__(self, views: int, rows: int, columns: int) -> None:
        whole = -(-columns // _AT_ONCE) * _AT_ONCE
        self._values = np.empty((views, rows, 3, whole), np.uint16)
        self._weights = np.zeros((views, rows, whole), np.uint8)
        self._used, self._columns = 0, columns

    def add(self, image: Image, projection: TileProjection) -> None:
        """Sample a view's ``image`` (H, W, 3) where ``projection`` puts the tile's pixels."""
        seen = np.flatnonzero(projection.weight.any(1))
        if seen.size:
            rows = slice(seen[0], seen[-1] + 1)
            _store(
                cv2.split(cv2.remap(image, projection.uv[rows], _NO_SECOND_MAP, cv2.INTER_CUBIC)),
                projection.inverse_brightness[rows], projection.weight[rows],
                self._values[self._used, rows], self._weights[self._used, rows],
            )  # fmt: skip
        self._used += 1

    def blend(self) -> tuple[Short, Byte]:
        """Return the blended colours (rows, columns, 3) and how many samples are behind each; start anew."""
        colour, count = blend_samples(self._values, self._weights)
        self._weights[:] = 0
        self._used = 0
        return colour[:, : self._columns], count[:, : self._columns]


@njit(cache=True, nogil=True)
def _store(colours, inverse_brightness, weight, values, weights):  # type: ignore[no-untyped-def]
    """Write a view's samples and weights; values of weight 0 mean nothing."""
    most, half, steps = np.float32(65535.0), np.float32(0.5), np.float32(254.0)
    for i in range(len(weight)):
        own, gain, worth = weight[i], inverse_brightness[i], weights[i]
        for c in range(3):
            colour, out = colours[c][i], values[i, c]
            for p in range(len(own)):
                out[p] = np.int32(min(most, np.float32(colour[p]) * (_SCALE * gain[p]) + half))
        blue, green, red = colours[0][i], colours[1][i], colours[2][i]
        for p in range(len(own)):
            w = min(np.int32(255), np.int32(steps * own[p]) + np.int32(1))
            # A clipped sample counts only where there is no other.
            w = np.int32(1) if max(blue[p], max(green[p], red[p])) >= _SATURATED else w
            worth[p] = w if own[p] > 0 else _ZERO


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
def _weighted_median(key, network, total, below, middle):  # type: ignore[no-untyped-def]
    """Sort the keys (views, pixels) of each pixel and write its weighted median to ``middle`` (pixels,)."""
    for m in range(len(network)):
        low, high = key[network[m, 0]], key[network[m, 1]]
        for p in range(_AT_ONCE):
            a, b = low[p], high[p]
            low[p], high[p] = min(a, b), max(a, b)
    below[:] = 0
    for k in range(len(key)):
        for p in range(_AT_ONCE):
            middle[p] = key[k, p] >> _BITS if _TWO * below[p] < total[p] else middle[p]
            below[p] += key[k, p] & _WEIGHT


@njit(cache=True, nogil=True)
def _write_keys(four, weight, middle, key):  # type: ignore[no-untyped-def]
    """Write the keys of how far four times the brightness is from ``middle`` (pixels,)."""
    for k in range(len(key)):
        for p in range(_AT_ONCE):
            own = (abs(four[k, p] - middle[p]) << _BITS) + np.int32(weight[k, p])
            key[k, p] = own if weight[k, p] > 0 else _NO_SAMPLE


@njit(cache=True, nogil=True, error_model="numpy")
def _biweight_mean(values, four, weight, middle, spread, mean):  # type: ignore[no-untyped-def]
    """Write robust mean colours to ``mean`` (3, pixels), about the middles and in units of the spreads."""
    steepness, total = np.empty(_AT_ONCE, np.float32), np.zeros(_AT_ONCE, np.float32)
    worth = np.empty(_AT_ONCE, np.float32)
    for p in range(_AT_ONCE):
        limit = _TUKEY * max(_MAD * _QUARTER * np.float32(spread[p]), _LEAST * np.float32(middle[p]) + _ONE)
        steepness[p] = _QUARTER / limit
    mean[:] = 0
    for k in range(len(four)):
        for p in range(_AT_ONCE):
            x = np.float32(four[k, p] - middle[p]) * steepness[p]
            inside = max(_ONE - x * x, np.float32(0))
            worth[p] = np.float32(weight[k, p]) * inside * inside
            total[p] += worth[p]
        for c in range(3):
            for p in range(_AT_ONCE):
                mean[c, p] += worth[p] * np.float32(values[k, c, p])
    for c in range(3):
        for p in range(_AT_ONCE):
            mean[c, p] /= total[p]


@njit(cache=True, nogil=True)
def _brightness(values, weight, four, total, count):  # type: ignore[no-untyped-def]
    """Write four times the brightness (views, pixels); sum and count the weights."""
    total[:] = 0
    count[:] = 0
    for k in range(len(values)):
        for p in range(_AT_ONCE):
            own, w = values[k], np.int32(weight[k, p])
            four[k, p] = np.int32(own[0, p]) + _TWO * np.int32(own[1, p]) + np.int32(own[2, p])
            total[p] += w
            count[p] += min(w, np.int32(1))


def blend_samples(values: Short, weights: Byte) -> tuple[Short, Byte]:
    """Return robust weighted means (rows, columns, 3) and counts (rows, columns).

    Tukey's biweight on brightness about the weighted median, with the weighted median of absolute
    deviations as scale, but at least 3 %: a glint or a passing shadow is left out, noise is averaged.

    Parameters
    ----------
    values : (views, rows, 3, columns) uint16
        So many columns that 32 of them can be worked on at once.
    weights : (views, rows, columns) uint8
        0 where a view does not show the pixel.
    """
    views, rows, columns = weights.shape
    colour, count = np.zeros((rows, columns, 3), np.uint16), np.zeros((rows, columns), np.uint8)
    _blend(values, weights, _sorting_network(views), colour, count)
    return colour, count


@njit(cache=True, nogil=True, error_model="numpy")
def _blend(values, weights, network, colour, counts):  # type: ignore[no-untyped-def]
    views, rows, columns = weights.shape
    blocks, side = columns // _AT_ONCE, _AT_ONCE
    near = np.empty((blocks, views, 3, side), np.uint16)
    weight = np.empty((blocks, views, side), np.uint8)
    four, key = np.empty((views, side), np.int32), np.empty((views, side), np.int32)
    middle, spread, below = np.empty(side, np.int32), np.empty(side, np.int32), np.empty(side, np.int32)
    total, count, zero = np.empty(side, np.int32), np.empty(side, np.int32), np.zeros(side, np.int32)
    mean = np.empty((3, side), np.float32)
    for i in range(rows):
        for k in range(views):
            for b in range(blocks):
                for p in range(side):
                    weight[b, k, p] = weights[k, i, b * side + p]
                    for c in range(3):
                        near[b, k, c, p] = values[k, i, c, b * side + p]
        for b in range(blocks):
            _brightness(near[b], weight[b], four, total, count)
            _write_keys(four, weight[b], zero, key)
            _weighted_median(key, network, total, below, middle)
            _write_keys(four, weight[b], middle, key)
            _weighted_median(key, network, total, below, spread)
            _biweight_mean(near[b], four, weight[b], middle, spread, mean)
            for p in range(side):
                counts[i, b * side + p] = count[p]
                for c in range(3):
                    filled = mean[c, p] + np.float32(0.5) if count[p] > 0 else np.float32(0)
                    colour[i, b * side + p, c] = np.uint16(np.int32(filled))
