"""Sub-pixel patch matching by inverse compositional Lucas-Kanade with free gain and offset.

S. Baker, I. Matthews, "Lucas-Kanade 20 years on: a unifying framework", IJCV 2004, § 3.2; the gain and the
offset are taken out by matching zero-mean patches and scaling by the least-squares gain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numba
import numpy as np

from pipeline.arrays import Bool, Float, Float32, Int, Int32
from stages.rings.kernels import FAST

_STEPS = 30
_ENOUGH = 0.003  # a step, strip px, after which the next would not matter


@dataclass(frozen=True)
class Patches:
    """Templates: zero-mean ``value`` (N, n, n), slopes along rows and columns, ``information`` (N, 2, 2)."""

    value: Float32
    by_row: Float32
    by_column: Float32
    information: Float

    def of(self, index: Int | Bool) -> Patches:
        """Return some of the patches."""
        return Patches(*(getattr(self, name)[index] for name in _FIELDS))

    @staticmethod
    def none(side: int) -> Patches:
        """Return an empty batch of patches of that side."""
        empty = np.zeros((0, side, side), np.float32)
        return Patches(empty, empty, empty, np.zeros((0, 2, 2)))

    @staticmethod
    def joined(parts: Sequence[Patches]) -> Patches:
        """Return several batches as one."""
        return Patches(*(np.concatenate([getattr(p, name) for p in parts]) for name in _FIELDS))


_FIELDS = tuple(Patches.__dataclass_fields__)


@dataclass(frozen=True)
class Matches:
    """Row and column offsets (N, 2), correlation (N,) and predicted 1 σ (N,), strip px; NaN if lost."""

    offset: Float
    correlation: Float
    sigma: Float


def cut(contrast: Float32, row: Int, column: Int, half: int) -> Patches:
    """Cut patches of side 2 half + 1 around integer positions (N,), columns wrapping round."""
    span = np.arange(-half - 1, half + 2)
    rows = np.clip(row[:, None] + span, 0, contrast.shape[0] - 1)
    columns = np.mod(column[:, None] + span, contrast.shape[1])
    big = contrast[rows[:, :, None], columns[:, None, :]].astype(np.float32)
    inner = big[:, 1:-1, 1:-1]
    by_row = (big[:, 2:, 1:-1] - big[:, :-2, 1:-1]) / 2
    by_column = (big[:, 1:-1, 2:] - big[:, 1:-1, :-2]) / 2
    gradient = np.stack([by_row, by_column], -1).astype(np.float64)
    gradient -= gradient.mean((1, 2), keepdims=True)
    information = np.einsum("nijk,nijl->nkl", gradient, gradient)
    value = inner - inner.mean((1, 2), keepdims=True)
    return Patches(value, by_row, by_column, information)


def match(contrast: Float32, usable: Bool, patches: Patches, row: Float, column: Float) -> Matches:
    """Find patches near predicted strip positions (N,); they move by at most half a patch."""
    inverse = np.linalg.inv(patches.information + 1e-9 * np.eye(2))
    offset, correlation, residual = _match(
        *_wrapped(contrast, usable, patches.value.shape[1]), contrast.shape[1],
        patches.value, patches.by_row, patches.by_column, inverse, row, column, _STEPS,
    )  # fmt: skip
    sigma = residual * np.sqrt(np.trace(inverse, axis1=1, axis2=2) / 2)
    return Matches(offset, correlation, sigma)


def _wrapped(contrast: Float32, usable: Bool, side: int) -> tuple[Float32, Int32]:
    """Return the strip with its first columns again behind the last, and its unusable samples summed up.

    The sums (H + 1, W + side + 2) are over all samples above and to the left.
    """
    wide = np.concatenate([contrast, contrast[:, : side + 1]], 1)
    spoilt = (~np.concatenate([usable, usable[:, : side + 1]], 1)).astype(np.uint8)
    return wide, np.asarray(cv2.integral(spoilt), np.int32)


# Inlined in one kernel: a fast function on its own rounds otherwise freshly compiled than from the cache.
@numba.njit(cache=True, nogil=True, forceinline=True)
def _whole(spoilt, i, j, n):  # type: ignore[no-untyped-def]
    """Whether the square of side n from (i, j) on holds no unusable sample."""
    return spoilt[i + n, j + n] - spoilt[i, j + n] - spoilt[i + n, j] + spoilt[i, j] == 0


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST, forceinline=True)
def _sums(contrast, i0, j0, a, b, template, by_row, by_column):  # type: ignore[no-untyped-def]
    """Return Σ s, Σ s², Σ t s, Σ s ∂t/∂row and Σ s ∂t/∂column of the patch s at (i0 + a, j0 + b)."""
    n = template.shape[0]
    one = np.float32(1)
    w00, w01, w10, w11 = (one - a) * (one - b), (one - a) * b, a * (one - b), a * b
    s1 = s2 = ts = rs = cs = np.float32(0)
    for i in range(n):
        top, low = contrast[i0 + i, j0 : j0 + n + 1], contrast[i0 + i + 1, j0 : j0 + n + 1]
        for j in range(n):
            s = w00 * top[j] + w01 * top[j + 1] + w10 * low[j] + w11 * low[j + 1]
            s1 += s
            s2 += s * s
            ts += template[i, j] * s
            rs += by_row[i, j] * s
            cs += by_column[i, j] * s
    return s1, s2, ts, rs, cs


@numba.njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def _settled(contrast, spoilt, width, template, by_row, by_column, own, inverse, row, column, steps):  # type: ignore[no-untyped-def]
    """Return the offset of one patch with Σ t s and Σ s² about the mean there; 0 where it is lost.

    ``own``: Σ ∂t/∂row, Σ ∂t/∂column, Σ t ∂t/∂row, Σ t ∂t/∂column. With them one pass over the patch gives the
    Gauss-Newton step, and the patch looked at need not be kept.
    """
    n = template.shape[0]
    r, c, tr, tc = own
    dr, dc, step, ts, ss = 0.0, 0.0, 1.0, 0.0, 0.0
    for _ in range(steps + 1):
        i, j = int(np.floor(row + dr)), int(np.floor(column + dc))
        a, b = np.float32(row + dr - i), np.float32(column + dc - j)
        i, j = i - n // 2, (j - n // 2) % width
        if i < 0 or i + n >= contrast.shape[0]:
            return dr, dc, 0.0, 0.0
        if not (_whole(spoilt, i, j, n) and _whole(spoilt, i + 1, j + 1, n)):
            return dr, dc, 0.0, 0.0
        s1, s2, ts, rs, cs = _sums(contrast, i, j, a, b, template, by_row, by_column)
        mean = s1 / (n * n)
        ss = s2 - s1 * mean
        if step < _ENOUGH:
            break
        gain = ts / ss if ss > 0 else 1.0
        g0, g1 = tr - gain * (rs - mean * r), tc - gain * (cs - mean * c)
        s0, s1 = inverse[0, 0] * g0 + inverse[0, 1] * g1, inverse[1, 0] * g0 + inverse[1, 1] * g1
        dr, dc, step = dr + s0, dc + s1, abs(s0) + abs(s1)
        if max(abs(dr), abs(dc)) > n / 2:
            return dr, dc, 0.0, 0.0
    return dr, dc, ts, ss


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _match(contrast, spoilt, width, value, by_row, by_column, inverse, row, column, steps):  # type: ignore[no-untyped-def]
    """Return offset (N, 2), correlation (N,) and residual 1 σ (N,) in a strip of ``_wrapped``."""
    count, n = value.shape[0], value.shape[1]
    offset = np.full((count, 2), np.nan)
    correlation = np.zeros(count)
    residual = np.full(count, np.nan)
    for k in range(count):
        t, r, c = value[k], by_row[k], by_column[k]
        own = np.sum(r), np.sum(c), np.sum(t * r), np.sum(t * c)
        dr, dc, ts, ss = _settled(contrast, spoilt, width, t, r, c, own, inverse[k], row[k], column[k], steps)
        tt = np.sum(t * t)
        if tt > 0 and ss > 0:
            offset[k, 0], offset[k, 1] = dr, dc
            correlation[k] = ts / np.sqrt(tt * ss)
            residual[k] = np.sqrt(max(tt - ts * ts / ss, 0.0) / (n * n - 4))
    return offset, correlation, residual
