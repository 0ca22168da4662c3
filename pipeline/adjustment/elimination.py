"""Normal equations of `bordered` summed in compiled loops: a banded, bordered matrix, landmarks eliminated.

The band holds the rows of frame f and the columns of frame f - l in ``band[f, l]`` (block, block); with l = 0
only the lower triangle counts. Arguments are those of `Rows` or `LandmarkRows`, then band, border, corner and
both right sides, which are added to.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from pipeline.arrays import Float

_HOLD = 1e-4  # 1/mm²: a landmark without observations keeps its place
BLOCK = 7


@dataclass(frozen=True)
class Sums:
    """Normal equations of N frames and B global unknowns.

    Attributes
    ----------
    band : (N, R, 7, 7)
        Rows of frame f and columns of frame f - l in ``band[f, l]``; of l = 0 the lower triangle.
    border : (7 N, B)
    corner : (B, B)
    right : (7 N,)
    right_border : (B,)
    """

    band: Float
    border: Float
    corner: Float
    right: Float
    right_border: Float

    @staticmethod
    def empty(frames: int, border: int, lags: int, block: int = BLOCK) -> Sums:
        """Return empty sums, for frames with ``block`` unknowns each."""
        size = block * frames
        shapes = (frames, lags, block, block), (size, border), (border, border), (size,), (border,)
        return Sums(*(np.zeros(shape) for shape in shapes))

    def like(self) -> Sums:
        """Return empty sums of the same sizes."""
        return Sums(*(np.zeros(a.shape) for a in self.arrays))

    @property
    def arrays(self) -> tuple[Float, ...]:
        """All arrays, in the order of the fields."""
        return self.band, self.border, self.corner, self.right, self.right_border

    def add(self, other: Sums) -> None:
        """Add other sums to these."""
        for mine, more in zip(self.arrays, other.arrays, strict=True):
            mine += more


@numba.njit(cache=True, nogil=True, error_model="numpy")
def add_rows(frame, by_frame, by_border, residual, weight, band, border, corner, right, right_border):  # type: ignore[no-untyped-def]
    """Add equations without landmarks to the band, the border, the corner and the right sides."""
    block = by_frame.shape[2]
    for m in range(frame.shape[0]):
        w = weight[m]
        for p in range(frame.shape[1]):
            for a in range(block):
                ja = by_frame[m, p, a]
                if ja == 0.0:
                    continue
                row = frame[m, p] * block + a
                right[row] -= w * ja * residual[m]
                _add_to_band(frame[m], by_frame[m], w * ja, frame[m, p], a, band)
                for b in range(border.shape[1]):
                    border[row, b] += w * ja * by_border[m, b]
        _add_to_corner(by_border[m], residual[m], w, corner, right_border)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _add_to_band(frame, by_frame, factor, f, a, band):  # type: ignore[no-untyped-def]
    """Add the products of one entry, row ``a`` of frame ``f``, with those on and below the diagonal."""
    for q in range(frame.shape[0]):
        if frame[q] <= f:
            for b in range(a + 1 if frame[q] == f else by_frame.shape[1]):
                band[f, f - frame[q], a, b] += factor * by_frame[q, b]


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _add_to_corner(by_border, residual, w, corner, right_border):  # type: ignore[no-untyped-def]
    for a in range(by_border.shape[0]):
        ja = by_border[a]
        if ja == 0.0:
            continue
        right_border[a] -= w * ja * residual
        for b in range(by_border.shape[0]):
            corner[a, b] += w * ja * by_border[b]


@numba.njit(cache=True, nogil=True, error_model="numpy")
def add_landmarks(  # type: ignore[no-untyped-def]
    start, frame, by_pose, by_point, by_instrument, residual, weight,
    s_point, s_border, s_residual, s_weight, damping,
    band, border, corner, right, right_border, inverse, right_point,
):  # fmt: skip
    """Add texture and surface equations with the landmarks eliminated by their Schur complement.

    ``damping`` raises the diagonal of each landmark's information. Products of the instrument's derivatives
    with themselves are left to matrix algebra, which is quicker.
    """
    size = s_border.shape[1]
    first = size - by_instrument.shape[2]
    most = 0
    for k in range(len(start) - 1):
        most = max(most, start[k + 1] - start[k])
    cross, side = np.empty((3, 6 * most)), np.empty((3, size))
    h = np.empty((3, 3))
    for k in range(len(start) - 1):
        ws, g = s_weight[k], right_point[k]
        for c in range(3):
            g[c] = -ws * s_residual[k] * s_point[k, c]
            for d in range(3):
                h[c, d] = ws * (s_point[k, c] * s_point[k, d])
            for d in range(size):
                side[c, d] = ws * s_point[k, c] * s_border[k, d]
        _add_to_corner(s_border[k], s_residual[k], ws, corner, right_border)
        for m in range(start[k], start[k + 1]):
            _add_observation(
                weight[m], frame[m], by_pose[m], by_point[m], by_instrument[m], residual[m], first,
                band, border, right, h, g, side, cross[:, 6 * (m - start[k]) : 6 * (m - start[k]) + 6],
            )  # fmt: skip
        for a in range(3):
            h[a, a] *= 1.0 + damping
        _invert(h, inverse[k])
        _eliminate_from_corner(inverse[k], g, side, corner, right_border)
        seen = frame[start[k] : start[k + 1]]
        _eliminate_from_frames(seen, cross, inverse[k], g, side, band, border, right)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _invert(h, out):  # type: ignore[no-untyped-def]
    """Write the inverse of a landmark's information, regularised where nothing determines the landmark."""
    determinant = _cofactors(h, out)
    if determinant < _HOLD**3:
        for a in range(3):
            h[a, a] += _HOLD
        determinant = _cofactors(h, out)
    out /= determinant


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _cofactors(h, out):  # type: ignore[no-untyped-def]
    """Write the cofactors of a symmetric matrix (3, 3); return its determinant."""
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        out[a, a] = h[b, b] * h[c, c] - h[b, c] * h[b, c]
        out[b, c] = out[c, b] = h[a, b] * h[a, c] - h[a, a] * h[b, c]
    return h[0, 0] * out[0, 0] + h[0, 1] * out[0, 1] + h[0, 2] * out[0, 2]


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _add_observation(  # type: ignore[no-untyped-def]
    w, f, jp, jx, jc, r, first, band, border, right, h, g, side, cross
):
    """Add one texture observation; products of tiny matrices are written out, which is faster."""
    row, block = f * band.shape[2], band[f, 0]
    r0, r1 = w * r[0], w * r[1]
    for a in range(3):
        x0, x1 = w * jx[0, a], w * jx[1, a]
        g[a] = g[a] - r0 * jx[0, a] - r1 * jx[1, a]
        for b in range(3):
            h[a, b] = h[a, b] + x0 * jx[0, b] + x1 * jx[1, b]
        for b in range(6):
            cross[a, b] = x0 * jp[0, b] + x1 * jp[1, b]
        for b in range(jc.shape[1]):
            side[a, first + b] = side[a, first + b] + x0 * jc[0, b] + x1 * jc[1, b]
    for a in range(6):
        p0, p1 = w * jp[0, a], w * jp[1, a]
        right[row + a] = right[row + a] - r0 * jp[0, a] - r1 * jp[1, a]
        for b in range(a + 1):
            block[a, b] = block[a, b] + p0 * jp[0, b] + p1 * jp[1, b]
        for b in range(jc.shape[1]):
            border[row + a, first + b] = border[row + a, first + b] + p0 * jc[0, b] + p1 * jc[1, b]


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _eliminate_from_corner(hi, g, side, corner, right_border):  # type: ignore[no-untyped-def]
    """Subtract one landmark's Schur complement from the border; ``side`` is (3, B)."""
    for a in range(side.shape[1]):
        if side[0, a] == 0.0 and side[1, a] == 0.0 and side[2, a] == 0.0:
            continue
        s0 = side[0, a] * hi[0, 0] + side[1, a] * hi[1, 0] + side[2, a] * hi[2, 0]
        s1 = side[0, a] * hi[0, 1] + side[1, a] * hi[1, 1] + side[2, a] * hi[2, 1]
        s2 = side[0, a] * hi[0, 2] + side[1, a] * hi[1, 2] + side[2, a] * hi[2, 2]
        right_border[a] -= s0 * g[0] + s1 * g[1] + s2 * g[2]
        for b in range(side.shape[1]):
            corner[a, b] -= s0 * side[0, b] + s1 * side[1, b] + s2 * side[2, b]


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _eliminate_from_frames(frame, cross, hi, g, side, band, border, right):  # type: ignore[no-untyped-def]
    """Subtract one landmark's Schur complement, seen in ``frame``, from its frames; ``cross``: (3, 6 n)."""
    size = band.shape[2]
    taken = np.empty(6 * len(frame))
    for i in range(len(frame)):
        f, row = frame[i], frame[i] * size
        for a in range(6):
            x0, x1, x2 = cross[0, 6 * i + a], cross[1, 6 * i + a], cross[2, 6 * i + a]
            s0 = x0 * hi[0, 0] + x1 * hi[1, 0] + x2 * hi[2, 0]
            s1 = x0 * hi[0, 1] + x1 * hi[1, 1] + x2 * hi[2, 1]
            s2 = x0 * hi[0, 2] + x1 * hi[1, 2] + x2 * hi[2, 2]
            right[row + a] -= s0 * g[0] + s1 * g[1] + s2 * g[2]
            for b in range(side.shape[1]):
                border[row + a, b] -= s0 * side[0, b] + s1 * side[1, b] + s2 * side[2, b]
            for k in range(6 * i + 6):
                taken[k] = s0 * cross[0, k] + s1 * cross[1, k] + s2 * cross[2, k]
            for j in range(i + 1):
                own = band[f, f - frame[j], a]
                for b in range(6):
                    own[b] -= taken[6 * j + b]
