"""Compiled sums of `stages.motion.bordered`: equations into a banded, bordered matrix, landmarks eliminated.

The band holds entry (i, j), i ≥ j, at ``band[i - j, j]``. Arguments are those of `Rows` or `LandmarkRows`,
then band, border, corner and both right sides, which are added to.
"""

from __future__ import annotations

import numba
import numpy as np

_HOLD = 1e-4  # 1/mm²: a landmark that nothing holds any more keeps its place


@numba.njit(cache=True)
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
                _add_to_band(frame[m], by_frame[m], w * ja, row, band)
                for b in range(border.shape[1]):
                    border[row, b] += w * ja * by_border[m, b]
        _add_to_corner(by_border[m], residual[m], w, corner, right_border)


@numba.njit(cache=True)
def _add_to_band(frame, by_frame, factor, row, band):  # type: ignore[no-untyped-def]
    block = by_frame.shape[1]
    for q in range(frame.shape[0]):
        for b in range(block):
            column = frame[q] * block + b
            if column <= row and by_frame[q, b] != 0.0:
                band[row - column, column] += factor * by_frame[q, b]


@numba.njit(cache=True)
def _add_to_corner(by_border, residual, w, corner, right_border):  # type: ignore[no-untyped-def]
    for a in range(by_border.shape[0]):
        ja = by_border[a]
        if ja == 0.0:
            continue
        right_border[a] -= w * ja * residual
        for b in range(by_border.shape[0]):
            corner[a, b] += w * ja * by_border[b]


@numba.njit(cache=True)
def add_landmarks(  # type: ignore[no-untyped-def]
    start, frame, by_pose, by_point, by_instrument, residual, weight,
    s_point, s_border, s_residual, s_weight, damping,
    band, border, corner, right, right_border, inverse, right_point,
):  # fmt: skip
    """Add texture and surface equations, and subtract what the landmarks take along when they leave.

    ``damping`` raises the diagonal of each landmark's information.
    """
    size = s_border.shape[1]
    first = size - by_instrument.shape[2]
    most = 0
    for k in range(len(start) - 1):
        most = max(most, start[k + 1] - start[k])
    cross = np.empty((most, 6, 3))
    for k in range(len(start) - 1):
        ws = s_weight[k]
        h = ws * np.outer(s_point[k], s_point[k])
        g = -ws * s_residual[k] * s_point[k]
        side = ws * np.outer(s_border[k], s_point[k])
        right_border -= ws * s_residual[k] * s_border[k]
        corner += ws * np.outer(s_border[k], s_border[k])
        for m in range(start[k], start[k + 1]):
            _add_observation(
                weight[m], frame[m] * 7, by_pose[m], by_point[m], by_instrument[m], residual[m], first,
                band, border, corner, right, right_border, h, g, side, cross[m - start[k]],
            )  # fmt: skip
        for a in range(3):
            h[a, a] *= 1.0 + damping
        if np.linalg.det(h) < _HOLD**3:
            h += _HOLD * np.eye(3)
        hi = np.linalg.inv(h)
        inverse[k], right_point[k] = hi, g
        solved_side = side @ hi
        right_border -= solved_side @ g
        corner -= solved_side @ side.T
        _eliminate(frame[start[k] : start[k + 1]], cross, hi, g, side, band, border, right)


@numba.njit(cache=True)
def _add_observation(  # type: ignore[no-untyped-def]
    w, f, jp, jx, jc, r, first, band, border, corner, right, right_border, h, g, side, cross
):
    """Add one texture observation; products of tiny matrices are written out, which is faster."""
    cross[:] = 0.0
    for c in range(2):
        wr = w * r[c]
        for a in range(3):
            g[a] -= wr * jx[c, a]
            for b in range(3):
                h[a, b] += w * jx[c, a] * jx[c, b]
        for a in range(6):
            wa = w * jp[c, a]
            right[f + a] -= wr * jp[c, a]
            for b in range(3):
                cross[a, b] += wa * jx[c, b]
            for b in range(a + 1):
                band[a - b, f + b] += wa * jp[c, b]
            for b in range(jc.shape[1]):
                border[f + a, first + b] += wa * jc[c, b]
        _add_instrument(w, wr, c, jx, jc, first, corner, right_border, side)


@numba.njit(cache=True)
def _add_instrument(w, wr, c, jx, jc, first, corner, right_border, side):  # type: ignore[no-untyped-def]
    for a in range(jc.shape[1]):
        wa = w * jc[c, a]
        right_border[first + a] -= wr * jc[c, a]
        for b in range(3):
            side[first + a, b] += wa * jx[c, b]
        for b in range(jc.shape[1]):
            corner[first + a, first + b] += wa * jc[c, b]


@numba.njit(cache=True)
def _eliminate(frame, cross, hi, g, side, band, border, right):  # type: ignore[no-untyped-def]
    """Subtract what one landmark, seen in ``frame``, takes along when it leaves."""
    solved = np.zeros((len(frame), 6, 3))
    for i in range(len(frame)):
        f = frame[i] * 7
        for a in range(6):
            for b in range(3):
                for c in range(3):
                    solved[i, a, b] += cross[i, a, c] * hi[c, b]
                right[f + a] -= solved[i, a, b] * g[b]
            for b in range(side.shape[0]):
                for c in range(3):
                    border[f + a, b] -= solved[i, a, c] * side[b, c]
        for j in range(i + 1):
            _subtract_pair(solved[i], cross[j], f, frame[j] * 7, band)


@numba.njit(cache=True)
def _subtract_pair(solved, cross, f, e, band):  # type: ignore[no-untyped-def]
    for a in range(6):
        for b in range(6):
            if f + a >= e + b:
                total = 0.0
                for c in range(3):
                    total += solved[a, c] * cross[b, c]
                band[f + a - e - b, e + b] -= total
