"""Tiles of the flat picture blended from many views, robustly.

Luma is sampled for every pixel, colour for every block of 2 by 2: video stores colour at half the resolution,
and the eye sees it no finer. Sampling a block takes less than half the time of four pixels.
"""

from __future__ import annotations

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipeline.adjustment.robust import MAD_TO_SIGMA
from pipeline.arrays import Byte, Float32, Image, Int
from pipeline.recording.images import SplitImage
from stages.texture.project import TileProjection

Short = NDArray[np.uint16]

# Reflectance is stored as multiples of 1 / 32 of a grey level at the reference brightness.
REFLECTANCE_SCALE = 32.0
_SCALE = np.float32(REFLECTANCE_SCALE)
_SATURATED = np.uint8(250)
# A key is brightness, 16 bits, above weight, 8 bits; samples without weight come last and have no influence.
_BITS, _WEIGHT = np.int32(8), np.int32(255)
_NO_SAMPLE = np.int32((1 << 31) - 256)
_ZERO, _ONE_COUNT, _TWO = np.int32(0), np.int32(1), np.int32(2)
# Pixels that are processed side by side: two registers of 16 numbers of 32 bits, if available.
_AT_ONCE = 32
_BLOCKS_AT_ONCE = _AT_ONCE // 2
# A map of pairs needs no second one, and is read without a copy.
_NO_SECOND_MAP = np.empty(0, np.float32)
_MAD, _TUKEY = np.float32(MAD_TO_SIGMA), np.float32(4.685)
_LEAST, _LEAST_LEVEL = np.float32(0.03), np.float32(1.0)
_HALF, _ONE = np.float32(0.5), np.float32(1.0)
_LUMA_OF_BGR = (0.114, 0.587, 0.299)
"""ITU-R BT.601, as OpenCV's BGR2GRAY."""
_LEAST_KNOWN = np.float32(0.25)
"""Smallest weight of a pixel's own block in the interpolation of its colour."""


class TileStack:
    """Samples of one tile's pixels in up to ``views`` views, each view's one after the other.

    One stack serves one tile after the other, because getting new memory from the system takes longer than
    writing to it. ``rows`` and ``columns`` are even.
    """

    def __init__(self, views: int, rows: int, columns: int) -> None:
        whole = -(-columns // _AT_ONCE) * _AT_ONCE
        self._luma = np.empty((views, rows, whole), np.uint16)
        self._colour = np.empty((views, rows // 2, 3, whole // 2), np.uint16)
        self._weights = np.zeros((views, rows, whole), np.uint8)
        self._used, self._columns = 0, columns

    def add(self, image: SplitImage, projection: TileProjection) -> None:
        """Sample a view's ``image`` where ``projection`` puts the tile's pixels."""
        seen = np.flatnonzero(projection.weight.any(1)) // 2
        if seen.size:
            blocks = slice(seen[0], seen[-1] + 1)
            rows = slice(2 * blocks.start, 2 * blocks.stop)
            _store(
                cv2.remap(image.luma, projection.uv[rows], _NO_SECOND_MAP, cv2.INTER_CUBIC),
                tuple(_colours_at(image, projection.block_uv[blocks])),
                projection.inverse_brightness[rows], projection.weight[rows],
                self._luma[self._used, rows], self._colour[self._used, blocks],
                self._weights[self._used, rows],
            )  # fmt: skip
        self._used += 1

    def blend(self) -> tuple[Short, Byte]:
        """Return the blended colours (rows, columns, 3) and their numbers of samples; clear the stack."""
        luma, colour, count = blend_samples(self._luma, self._colour, self._weights)
        self._weights[:] = 0
        self._used = 0
        columns, blocks = slice(self._columns), slice(self._columns // 2)
        return _in_colour(luma[:, columns], colour[:, blocks]), count[:, columns]


def _colours_at(image: SplitImage, uv: Float32) -> list[Image]:
    """Return the blue, green and red (n, m) of the small picture at places (n, m, 2) of the large one."""
    u, v = (
        (uv[..., k] + _HALF) * np.float32(image.small.shape[1 - k] / image.luma.shape[1 - k]) - _HALF
        for k in range(2)
    )
    # With both maps in one, OpenCV 5.0 reads beyond them when it interpolates linearly.
    return [np.asarray(c, np.uint8) for c in cv2.split(cv2.remap(image.small, u, v, cv2.INTER_LINEAR))]


@njit(cache=True, nogil=True)
def _store(grey, colours, inverse_brightness, weight, lumas, values, weights):  # type: ignore[no-untyped-def]
    """Write a view's samples and weights; values of weight 0 are undefined."""
    most, half, steps = np.float32(65535.0), np.float32(0.5), np.float32(254.0)
    for i in range(len(weight)):
        own, gain, worth, seen, out = weight[i], inverse_brightness[i], weights[i], grey[i], lumas[i]
        for p in range(len(own)):
            out[p] = np.int32(min(most, np.float32(seen[p]) * (_SCALE * gain[p]) + half))
            w = min(np.int32(255), np.int32(steps * own[p]) + _ONE_COUNT)
            w = _ONE_COUNT if seen[p] >= _SATURATED else w
            worth[p] = w if own[p] > 0 else _ZERO
    for i in range(len(values)):
        gain = inverse_brightness[2 * i]
        blue, green, red = colours[0][i], colours[1][i], colours[2][i]
        for c in range(3):
            colour, out = colours[c][i], values[i, c]
            for q in range(len(colour)):
                out[q] = np.int32(min(most, np.float32(colour[q]) * (_SCALE * gain[2 * q]) + half))
        for q in range(len(blue)):
            # A clipped sample counts only if there is no other.
            if max(blue[q], max(green[q], red[q])) >= _SATURATED:
                for worth in (weights[2 * i], weights[2 * i + 1]):
                    for p in (2 * q, 2 * q + 1):
                        worth[p] = min(worth[p], np.uint8(1))


def _sorting_network(keys: int) -> Int:
    """Return the pairs (N, 2) of places to be compared and exchanged in turn to sort ``keys`` keys.

    K. Batcher, "Sorting networks and their applications", 1968: odd-even merge sort. The pairs do not depend
    on the keys, so that many pixels are sorted by the same instructions.
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
def _write_keys(luma, weight, middle, key):  # type: ignore[no-untyped-def]
    """Write the keys of the luma's absolute distance from ``middle`` (pixels,)."""
    for k in range(len(key)):
        for p in range(_AT_ONCE):
            own = (abs(np.int32(luma[k, p]) - middle[p]) << _BITS) + np.int32(weight[k, p])
            key[k, p] = own if weight[k, p] > 0 else _NO_SAMPLE


@njit(cache=True, nogil=True, error_model="numpy")
def _biweight_mean(luma, weight, middle, spread, worth, mean):  # type: ignore[no-untyped-def]
    """Write the samples' robust weights and mean, about the middles and in units of the spreads."""
    steepness, total = np.empty(_AT_ONCE, np.float32), np.zeros(_AT_ONCE, np.float32)
    for p in range(_AT_ONCE):
        least = _LEAST * np.float32(middle[p]) + _LEAST_LEVEL
        steepness[p] = _ONE / (_TUKEY * max(_MAD * np.float32(spread[p]), least))
    mean[:] = 0
    for k in range(len(luma)):
        for p in range(_AT_ONCE):
            x = np.float32(np.int32(luma[k, p]) - middle[p]) * steepness[p]
            inside = max(_ONE - x * x, np.float32(0))
            worth[k, p] = np.float32(weight[k, p]) * inside * inside
            total[p] += worth[k, p]
            mean[p] += worth[k, p] * np.float32(luma[k, p])
    for p in range(_AT_ONCE):
        mean[p] /= total[p]


@njit(cache=True, nogil=True, error_model="numpy")
def _mean_colour(values, worth, mean):  # type: ignore[no-untyped-def]
    """Write the mean colours of blocks (3, blocks), with the weights of their pixels' samples (2, ...)."""
    total, own = np.zeros(_BLOCKS_AT_ONCE, np.float32), np.empty(_BLOCKS_AT_ONCE, np.float32)
    mean[:] = 0
    for k in range(len(values)):
        for q in range(_BLOCKS_AT_ONCE):
            own[q] = worth[0, k, 2 * q] + worth[0, k, 2 * q + 1] + worth[1, k, 2 * q] + worth[1, k, 2 * q + 1]
            total[q] += own[q]
        for c in range(3):
            for q in range(_BLOCKS_AT_ONCE):
                mean[c, q] += own[q] * np.float32(values[k, c, q])
    for c in range(3):
        for q in range(_BLOCKS_AT_ONCE):
            mean[c, q] /= total[q]


@njit(cache=True, nogil=True)
def _summed(weight, total, count):  # type: ignore[no-untyped-def]
    """Sum and count the weights (views, pixels)."""
    total[:] = 0
    count[:] = 0
    for k in range(len(weight)):
        for p in range(_AT_ONCE):
            w = np.int32(weight[k, p])
            total[p] += w
            count[p] += min(w, _ONE_COUNT)


def blend_samples(luma: Short, colour: Short, weights: Byte) -> tuple[Short, Short, Byte]:
    """Return robust weighted means of luma (rows, columns) and colours (blocks), and counts (rows, columns).

    Tukey's biweight on luma around the weighted median, with the weighted median of absolute deviations as
    scale, but at least 3 %: a glint or a passing shadow is left out, noise is averaged. Colours (rows / 2,
    columns / 2, 3) have the weights of their pixels' luma.

    Parameters
    ----------
    luma : (views, rows, columns) uint16
        The number of columns is a multiple of 32, which are processed at once.
    colour : (views, rows / 2, 3, columns / 2) uint16
    weights : (views, rows, columns) uint8
        0 where a view does not show the pixel.
    """
    views, rows, columns = weights.shape
    mean, count = np.zeros((rows, columns), np.uint16), np.zeros((rows, columns), np.uint8)
    mean_colour = np.zeros((rows // 2, columns // 2, 3), np.uint16)
    _blend(luma, colour, weights, _sorting_network(views), mean, mean_colour, count)
    return mean, mean_colour, count


@njit(cache=True, nogil=True, error_model="numpy")
def _gathered(luma, colour, weights, i, near, tint, weight):  # type: ignore[no-untyped-def]
    """Write the samples of a pair of rows so that those processed at once lie side by side."""
    for k in range(luma.shape[0]):
        for b in range(near.shape[1]):
            for p in range(_AT_ONCE):
                for r in range(2):
                    near[r, b, k, p] = luma[k, 2 * i + r, b * _AT_ONCE + p]
                    weight[r, b, k, p] = weights[k, 2 * i + r, b * _AT_ONCE + p]
            for c in range(3):
                for q in range(_BLOCKS_AT_ONCE):
                    tint[b, k, c, q] = colour[k, i, c, b * _BLOCKS_AT_ONCE + q]


@njit(cache=True, nogil=True, error_model="numpy")
def _blend(lumas, colours, weights, network, out, out_colour, counts):  # type: ignore[no-untyped-def]
    views, rows, columns = weights.shape
    blocks, side, half = columns // _AT_ONCE, _AT_ONCE, np.float32(0.5)
    near, weight = np.empty((2, blocks, views, side), np.uint16), np.empty((2, blocks, views, side), np.uint8)
    tint, key = np.empty((blocks, views, 3, side // 2), np.uint16), np.empty((views, side), np.int32)
    middle, spread, below = np.empty(side, np.int32), np.empty(side, np.int32), np.empty(side, np.int32)
    total, count, zero = np.empty(side, np.int32), np.empty((2, side), np.int32), np.zeros(side, np.int32)
    worth, mean = np.empty((2, views, side), np.float32), np.empty(side, np.float32)
    mean_colour = np.empty((3, side // 2), np.float32)
    for i in range(rows // 2):
        _gathered(lumas, colours, weights, i, near, tint, weight)
        for b in range(blocks):
            for r in range(2):
                _summed(weight[r, b], total, count[r])
                _write_keys(near[r, b], weight[r, b], zero, key)
                _weighted_median(key, network, total, below, middle)
                _write_keys(near[r, b], weight[r, b], middle, key)
                _weighted_median(key, network, total, below, spread)
                _biweight_mean(near[r, b], weight[r, b], middle, spread, worth[r], mean)
                for p in range(side):
                    seen = count[r, p] > 0
                    counts[2 * i + r, b * side + p] = count[r, p]
                    out[2 * i + r, b * side + p] = np.int32(mean[p] + half) if seen else _ZERO
            _mean_colour(tint[b], worth, mean_colour)
            for q in range(side // 2):
                seen = count[0, 2 * q] + count[0, 2 * q + 1] + count[1, 2 * q] + count[1, 2 * q + 1] > 0
                for c in range(3):
                    filled = np.int32(mean_colour[c, q] + half) if seen else _ZERO
                    out_colour[i, b * (side // 2) + q, c] = filled


def _in_colour(luma: Short, colour: Short) -> Short:
    """Return luma (rows, columns) with the colours (rows / 2, columns / 2, 3) of its blocks.

    Differences of colour from luma are interpolated linearly between blocks; blocks without a sample have
    none.
    """
    known = (colour.max(2) > 0).astype(np.float32)
    small = colour.astype(np.float32)
    grey = sum(np.float32(share) * small[..., c] for c, share in enumerate(_LUMA_OF_BGR))
    layers = np.dstack([small - np.expand_dims(grey, -1), known])
    large = cv2.resize(layers, luma.shape[::-1], interpolation=cv2.INTER_LINEAR)
    tint = large[..., :3] / np.maximum(large[..., 3:], _LEAST_KNOWN)
    shown = np.clip(luma[..., None] + tint + np.float32(0.5), 0, 65535)
    return np.where(luma[..., None] > 0, shown, 0).astype(np.uint16)
