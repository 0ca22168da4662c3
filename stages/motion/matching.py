"""Sub-pixel patch matching by inverse compositional Lucas-Kanade with free gain and offset.

S. Baker, I. Matthews, "Lucas-Kanade 20 years on: a unifying framework", IJCV 2004, § 3.2; the gain and the
offset are taken out by matching zero-mean patches and scaling by the least-squares gain.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]
Float32 = NDArray[np.float32]
_STEPS = 30
_THREADS = 2


@dataclass(frozen=True)
class Patches:
    """Templates: zero-mean ``value`` (N, n, n), slopes along rows and columns, ``information`` (N, 2, 2)."""

    value: Float32
    by_row: Float32
    by_column: Float32
    information: Float

    def of(self, index: NDArray[np.int64] | NDArray[np.bool_]) -> Patches:
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


def cut(contrast: Float32, row: NDArray[np.int64], column: NDArray[np.int64], half: int) -> Patches:
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


def match(
    contrast: Float32, usable: NDArray[np.bool_], patches: Patches, row: Float, column: Float
) -> Matches:
    """Find patches near predicted strip positions (N,); they move by at most half a patch."""
    inverse = np.linalg.inv(patches.information + 1e-9 * np.eye(2))

    def matched(part: slice) -> tuple[Float, Float, Float]:
        templates = (a[part] for a in (patches.value, patches.by_row, patches.by_column, inverse))
        found: tuple[Float, Float, Float] = _match(
            contrast, usable, *templates, row[part], column[part], _STEPS
        )
        return found

    cuts = np.linspace(0, len(row), _THREADS + 1).astype(int)
    with ThreadPoolExecutor(_THREADS) as pool:
        parts = list(pool.map(matched, map(slice, cuts[:-1], cuts[1:])))
    offset, correlation, residual = (np.concatenate(p) for p in zip(*parts, strict=True))
    sigma = residual * np.sqrt(np.trace(inverse, axis1=1, axis2=2) / 2)
    return Matches(offset, correlation, sigma)


@numba.njit(cache=True, nogil=True)
def _look(contrast, usable, r, c, out):  # type: ignore[no-untyped-def]
    """Sample a patch centred on (r, c) into ``out``; False where it leaves the usable strip."""
    n = out.shape[0]
    half = n // 2
    height, width = contrast.shape
    i0, j0 = int(np.floor(r)) - half, int(np.floor(c)) - half
    if i0 < 0 or i0 + n >= height:
        return False
    a, b = np.float32(r - np.floor(r)), np.float32(c - np.floor(c))
    total = np.float32(0)
    for i in range(n):
        for j in range(n):
            x0, x1 = (j0 + j) % width, (j0 + j + 1) % width
            y = i0 + i
            if not (usable[y, x0] and usable[y + 1, x1]):
                return False
            top = contrast[y, x0] * (1 - b) + contrast[y, x1] * b
            low = contrast[y + 1, x0] * (1 - b) + contrast[y + 1, x1] * b
            out[i, j] = top * (1 - a) + low * a
            total += out[i, j]
    total /= n * n
    for i in range(n):
        for j in range(n):
            out[i, j] -= total
    return True


@numba.njit(cache=True, nogil=True)
def _match(contrast, usable, value, by_row, by_column, inverse, row, column, steps):  # type: ignore[no-untyped-def]
    count, n = value.shape[0], value.shape[1]
    offset = np.full((count, 2), np.nan)
    correlation = np.zeros(count)
    residual = np.full(count, np.nan)
    seen = np.empty((n, n), np.float32)
    limit = n / 2
    for k in range(count):
        dr, dc, step = 0.0, 0.0, 1.0
        tt, ts, ss = 0.0, 0.0, 0.0
        for _ in range(steps + 1):
            if not _look(contrast, usable, row[k] + dr, column[k] + dc, seen):
                tt = 0.0
                break
            tt, ts, ss = _products(value[k], seen)
            if step < 0.003:
                break
            s0, s1 = _step(value[k], by_row[k], by_column[k], inverse[k], seen, ts / ss if ss > 0 else 1.0)
            dr += s0
            dc += s1
            step = abs(s0) + abs(s1)
            if max(abs(dr), abs(dc)) > limit:
                tt = 0.0
                break
        if tt <= 0 or ss <= 0:
            continue
        offset[k, 0], offset[k, 1] = dr, dc
        correlation[k] = ts / np.sqrt(tt * ss)
        residual[k] = np.sqrt(max(tt - ts * ts / ss, 0.0) / (n * n - 4))
    return offset, correlation, residual


@numba.njit(cache=True, nogil=True)
def _products(template, seen):  # type: ignore[no-untyped-def]
    """Return Σ t², Σ t s and Σ s²."""
    tt, ts, ss = 0.0, 0.0, 0.0
    for i in range(seen.shape[0]):
        for j in range(seen.shape[1]):
            t, s = template[i, j], seen[i, j]
            tt += t * t
            ts += t * s
            ss += s * s
    return tt, ts, ss


@numba.njit(cache=True, nogil=True)
def _step(template, by_row, by_column, inverse, seen, gain):  # type: ignore[no-untyped-def]
    """Return the Gauss-Newton step along rows and columns."""
    g0, g1 = 0.0, 0.0
    for i in range(seen.shape[0]):
        for j in range(seen.shape[1]):
            e = template[i, j] - gain * seen[i, j]
            g0 += by_row[i, j] * e
            g1 += by_column[i, j] * e
    return inverse[0, 0] * g0 + inverse[0, 1] * g1, inverse[1, 0] * g0 + inverse[1, 1] * g1
