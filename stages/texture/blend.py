"""Tiles of the flat picture blended from many views, robustly."""

from __future__ import annotations

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipeline.artefacts import Byte
from pipeline.recording.base import Image
from stages.texture.project import TileProjection

Short = NDArray[np.uint16]

# Reflectance is kept as multiples of 1 / 32 of a grey level at the reference brightness.
REFLECTANCE_SCALE = 32.0
_SATURATED = 250


class TileStack:
    """Samples of one tile's pixels in up to ``views`` views."""

    def __init__(self, views: int, rows: int, columns: int) -> None:
        self._values = np.zeros((rows, columns, views, 3), np.uint16)
        self._weights = np.zeros((rows, columns, views), np.uint8)
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
        return blend_samples(self._values, self._weights)


@njit(cache=True, nogil=True)  # type: ignore[misc]
def _store(sample, inverse_brightness, weight, view, values, weights):  # type: ignore[no-untyped-def]
    rows, columns = weight.shape
    for i in range(rows):
        for j in range(columns):
            w = weight[i, j]
            if w <= 0:
                continue
            brightest = max(sample[i, j, 0], sample[i, j, 1], sample[i, j, 2])
            # A clipped sample counts only where there is no other.
            weights[i, j, view] = 1 if brightest >= _SATURATED else max(1, min(255, int(254 * w) + 1))
            gain = REFLECTANCE_SCALE * inverse_brightness[i, j]
            for c in range(3):
                values[i, j, view, c] = min(65535, int(sample[i, j, c] * gain + 0.5))


@njit(cache=True, nogil=True)  # type: ignore[misc]
def _weighted_median(value, weight, count):  # type: ignore[no-untyped-def]
    order = np.argsort(value[:count])
    half = 0.5 * weight[:count].sum()
    total = 0.0
    for k in order:
        total += weight[k]
        if total >= half:
            return value[k]
    return value[order[-1]]


@njit(cache=True, nogil=True)  # type: ignore[misc]
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
    for i in range(rows):
        grey, weight, apart = np.empty(views), np.empty(views), np.empty(views)
        where = np.empty(views, np.int64)
        for j in range(columns):
            n = 0
            for k in range(views):
                if weights[i, j, k] > 0:
                    v = values[i, j, k]
                    grey[n] = 0.25 * v[0] + 0.5 * v[1] + 0.25 * v[2]
                    weight[n] = weights[i, j, k]
                    where[n] = k
                    n += 1
            counts[i, j] = n
            if n == 0:
                continue
            middle = _weighted_median(grey, weight, n)
            for m in range(n):
                apart[m] = abs(grey[m] - middle)
            limit = 4.685 * max(1.4826 * _weighted_median(apart, weight, n), 0.03 * middle + 1.0)
            total, b, g, r = 0.0, 0.0, 0.0, 0.0
            for m in range(n):
                if apart[m] < limit:
                    x = apart[m] / limit
                    w = weight[m] * (1 - x * x) ** 2
                    v = values[i, j, where[m]]
                    total += w
                    b += w * v[0]
                    g += w * v[1]
                    r += w * v[2]
            out[i, j, 0] = np.uint16(b / total + 0.5)
            out[i, j, 1] = np.uint16(g / total + 0.5)
            out[i, j, 2] = np.uint16(r / total + 0.5)
    return out, counts
