"""Sub-pixel matching of patches by inverse compositional Lucas-Kanade with free gain and offset.

S. Baker, I. Matthews, "Lucas-Kanade 20 years on: a unifying framework", IJCV 2004, § 3.2; gain and offset are
eliminated by matching zero-mean patches and scaling by the least-squares gain.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numba
import numpy as np

from pipeline.arrays import Bool, Float, Float32, Int, Int32
from pipeline.system.parallel import side_by_side
from stages.rings.kernels import FAST

_MOST_STEPS = 30
"""Gauss-Newton steps of one match; those that need more do not converge. Not measured."""
_SMALL_STEP = 0.003
"""Step, strip samples, after which matching ends: a hundredth of ``landmark_sigma_px``."""
_REGULAR = 1e-9
"""Added to the information of patches, so that those without any texture can be inverted."""


@dataclass(frozen=True)
class Patches:
    """Templates cut from strips.

    Attributes
    ----------
    value : (N, n, n) float32
        Contrast, of zero mean.
    by_row, by_column : (N, n, n) float32
        Its derivatives along the pipe and around it.
    information : (N, 2, 2)
        Fisher information of the position, for noise of variance 1.
    """

    value: Float32
    by_row: Float32
    by_column: Float32
    information: Float

    @property
    def sigma_per_noise(self) -> Float:
        """Return 1 σ (N,), strip samples, of a match in noise of 1 σ = 1 per sample (Cramér-Rao bound)."""
        return _sigma(self._covariance(np.arange(len(self.value))))

    def of(self, index: Int | Bool) -> Patches:
        """Return some of the patches."""
        return Patches(*(getattr(self, name)[index] for name in _FIELDS))

    def match(
        self, contrast: Float32, usable: Bool, row: Float, column: Float, index: Int | None = None
    ) -> Matches:
        """Find patches near predicted positions (N,) in a strip (H, W), up to half a patch away.

        ``index`` (N,) says which patches; without it, all.
        """
        index = np.arange(len(self.value)) if index is None else index
        covariance = self._covariance(index)
        wide, width = _wrapped(contrast, usable, self.value.shape[1]), contrast.shape[1]
        templates = self.value, self.by_row, self.by_column

        def found(some: slice) -> tuple[Float, Float, Float]:
            wanted = index[some], covariance[some], row[some], column[some]
            return _match(*wide, width, *templates, *wanted, _MOST_STEPS)  # type: ignore[no-any-return]

        middle = len(index) // 2
        halves = side_by_side(found, (slice(middle), slice(middle, None)))
        offset, correlation, residual = (np.concatenate(parts) for parts in zip(*halves, strict=True))
        return Matches(offset, correlation, residual * _sigma(covariance))

    @staticmethod
    def none(side: int) -> Patches:
        """Return an empty batch of patches of that side."""
        empty = np.zeros((0, side, side), np.float32)
        return Patches(empty, empty, empty, np.zeros((0, 2, 2)))

    def followed_by(self, count: int, more: Patches) -> Patches:
        """Return the first ``count`` patches and ``more``, in the same arrays while these have room."""
        end = count + len(more.value)
        arrays = [getattr(self, name) for name in _FIELDS]
        if end > len(self.value):
            arrays = [np.resize(a[:count], (2 * end, *a.shape[1:])) for a in arrays]
        for array, name in zip(arrays, _FIELDS, strict=True):
            array[count:end] = getattr(more, name)
        return Patches(*arrays)

    def _covariance(self, index: Int) -> Float:
        return np.asarray(np.linalg.inv(self.information[index] + _REGULAR * np.eye(2)))


def _sigma(covariance: Float) -> Float:
    return np.asarray(np.sqrt(np.trace(covariance, axis1=1, axis2=2) / 2))


_FIELDS = tuple(Patches.__dataclass_fields__)


@dataclass(frozen=True)
class Matches:
    """Positions at which patches were found.

    Attributes
    ----------
    offset : (N, 2)
        Rows and columns from the predicted position; NaN where a patch was lost.
    correlation : (N,)
        Normalised cross-correlation there.
    sigma : (N,)
        1 σ of ``offset``, strip samples, from the difference between the patch and the strip.
    """

    offset: Float
    correlation: Float
    sigma: Float


def cut(contrast: Float32, row: Int, column: Int, half: int) -> Patches:
    """Cut patches of side 2 half + 1 around integer positions (N,); columns wrap round the pipe."""
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


def cornerness(contrast: Float32, usable: Bool, half: int, rows: slice) -> Float32:
    """Return the cornerness of a patch (side 2 half + 1) around each sample of some rows; 0: cut off.

    The smaller eigenvalue of the structure tensor: J. Shi, C. Tomasi, "Good features to track", CVPR 1994.
    """
    margin = half + 2  # a patch, and the derivatives at its edge
    first, last = max(rows.start - margin, 0), rows.stop + margin
    inner = slice(rows.start - first, rows.stop - first)
    whole = whole_patches(usable[first:last], half + 1)[inner].copy()
    row = np.arange(rows.start, rows.stop)
    whole[(row < margin) | (row >= len(contrast) - margin - 1)] = False
    if not whole.any():
        return np.zeros(whole.shape, np.float32)
    corner = cv2.cornerMinEigenVal(np.ascontiguousarray(contrast[first:last]), 2 * half + 1)[inner]
    return np.where(whole, corner, np.float32(0))


def best_of_cells(corner: Float32, free: Bool, cell: int) -> tuple[Int, Int]:
    """Return rows and columns of the best corner of each of a row of cells (C,) that is free."""
    blocks = corner[:, : len(free) * cell].reshape(len(corner), len(free), cell)[:, free]
    flat = blocks.swapaxes(0, 1).reshape(blocks.shape[1], -1)
    if not flat.size:
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    best = flat.argmax(1)
    there = flat.max(1) > 0
    row, column = np.divmod(best[there], cell)
    return row, np.flatnonzero(free)[there] * cell + column


def whole_patches(usable: Bool, half: int) -> Bool:
    """Return where (H, W) all samples of a patch of side 2 half + 1 are usable."""
    return np.asarray(cv2.erode(usable.astype(np.uint8), np.ones((2 * half + 1,) * 2)) > 0)


def _wrapped(contrast: Float32, usable: Bool, side: int) -> tuple[Float32, Int32]:
    """Return the strip with its first columns again behind the last, and where it is unusable.

    The latter is an integral image (H + 1, W + side + 2): sums over all samples above and to the left.
    """
    wide = np.concatenate([contrast, contrast[:, : side + 1]], 1)
    unusable = (~np.concatenate([usable, usable[:, : side + 1]], 1)).astype(np.uint8)
    return wide, np.asarray(cv2.integral(unusable), np.int32)


# These are inlined in one kernel: a separate `fastmath` kernel rounds differently when it was just compiled
# than when it comes from the cache, and results would differ in their last digits.
@numba.njit(cache=True, nogil=True, forceinline=True)
def _whole(unusable, i, j, n):  # type: ignore[no-untyped-def]
    """Whether the square of side n from (i, j) on holds no unusable sample."""
    return unusable[i + n, j + n] - unusable[i, j + n] - unusable[i + n, j] + unusable[i, j] == 0


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
def _match_one(contrast, unusable, width, template, by_row, by_column, own, inverse, row, column, steps):  # type: ignore[no-untyped-def]
    """Return the offset of one patch, and Σ t s and Σ s² about the mean there; both are 0 where it is lost.

    ``own``: Σ ∂t/∂row, Σ ∂t/∂column, Σ t ∂t/∂row, Σ t ∂t/∂column. With these, one pass over the
    samples gives the Gauss-Newton step, and the samples need not be kept.
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
        if not (_whole(unusable, i, j, n) and _whole(unusable, i + 1, j + 1, n)):
            return dr, dc, 0.0, 0.0
        s1, s2, ts, rs, cs = _sums(contrast, i, j, a, b, template, by_row, by_column)
        mean = s1 / (n * n)
        ss = s2 - s1 * mean
        if step < _SMALL_STEP:
            break
        gain = ts / ss if ss > 0 else 1.0
        g0, g1 = tr - gain * (rs - mean * r), tc - gain * (cs - mean * c)
        s0, s1 = inverse[0, 0] * g0 + inverse[0, 1] * g1, inverse[1, 0] * g0 + inverse[1, 1] * g1
        dr, dc, step = dr + s0, dc + s1, abs(s0) + abs(s1)
        if max(abs(dr), abs(dc)) > n / 2:
            return dr, dc, 0.0, 0.0
    return dr, dc, ts, ss


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _match(contrast, unusable, width, value, by_row, by_column, index, inverse, row, column, steps):  # type: ignore[no-untyped-def]
    """Return offset (N, 2), correlation (N,) and residual 1 σ (N,) of patches in a strip of ``_wrapped``."""
    count, n = len(index), value.shape[1]
    offset = np.full((count, 2), np.nan)
    correlation = np.zeros(count)
    residual = np.full(count, np.nan)
    for k in range(count):
        t, r, c = value[index[k]], by_row[index[k]], by_column[index[k]]
        sr = sc = tr = tc = tt = np.float32(0)
        for i in range(n):
            for j in range(n):
                sr, sc, tt = sr + r[i, j], sc + c[i, j], tt + t[i, j] * t[i, j]
                tr, tc = tr + t[i, j] * r[i, j], tc + t[i, j] * c[i, j]
        own = sr, sc, tr, tc
        dr, dc, ts, ss = _match_one(
            contrast, unusable, width, t, r, c, own, inverse[k], row[k], column[k], steps
        )
        if tt > 0 and ss > 0:
            offset[k, 0], offset[k, 1] = dr, dc
            correlation[k] = ts / np.sqrt(tt * ss)
            residual[k] = np.sqrt(max(tt - ts * ts / ss, 0.0) / (n * n - 4))
    return offset, correlation, residual
