"""The picture in which a ring is traced: grey levels, or a mixture of channels, computed where it is read.

A line covers a tenth of a picture. Mixing the channels of all pixels took a third as long as everything
else that is done with a picture whose wall is lit, too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from pipeline.arrays import Byte, Float, Float32
from stages.rings.kernels import FAST

_ALONE = (np.float32(1),)


@dataclass(frozen=True)
class Mixture:
    """The sum of a picture's channels ``bgr`` (H, W, 3), times ``weights`` (3,)."""

    bgr: Byte
    weights: Float

    def everywhere(self, every: int = 1) -> Float32:
        """Return the mixture (H, W) of all pixels, or of one of ``every`` so many each way."""
        return np.asarray(self.bgr[::every, ::every] @ self.weights.astype(np.float32), np.float32)


Image = Byte | Float32 | Mixture


def everywhere(image: Image) -> Byte | Float32:
    """Return the grey levels (H, W) of all pixels."""
    return image.everywhere() if isinstance(image, Mixture) else image


def channels(image: Image) -> tuple[Byte | Float32, tuple[np.float32, ...]]:
    """Return what `grey_at` reads: the channels of all pixels one after the other, and their weights."""
    if isinstance(image, Mixture):
        return image.bgr.ravel(), tuple(image.weights.astype(np.float32))
    return image.ravel(), _ALONE


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def grey_at(values, weights, pixel):  # type: ignore[no-untyped-def]
    """Return the grey level of a pixel, a flat index. The number of weights is known to the compiler."""
    total = weights[0] * values[pixel * len(weights)]
    for c in range(1, len(weights)):
        total += weights[c] * values[pixel * len(weights) + c]
    return total
