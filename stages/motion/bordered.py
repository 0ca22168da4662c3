"""Normal equations of frames, landmarks and a few global numbers: banded, bordered, landmarks eliminated.

The unknowns are ``BLOCK`` numbers for each frame (banded, because no landmark is followed for long), a border
of global numbers, and three for each landmark, which leave by the Schur complement. B. Triggs et al.,
"Bundle adjustment: a modern synthesis", 2000, § 6.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from stages.motion.tridiagonal import BlockTridiagonal

Float = NDArray[np.float64]
Int = NDArray[np.int64]
BLOCK = 7


@dataclass(frozen=True)
class Rows:
    """Scalar, weighted residual equations that touch some frames and the border, but no landmark.

    Attributes
    ----------
    frame : (M, F) int
        The F frames of each equation.
    by_frame : (M, F, 7)
    by_border : (M, B)
    residual, weight : (M,)
    """

    frame: Int
    by_frame: Float
    by_border: Float
    residual: Float
    weight: Float


@dataclass(frozen=True)
class LandmarkRows:
    """Texture observations and the landmarks' surface equations.

    Attributes
    ----------
    start : (L + 1,) int
        Observations of landmark l are ``start[l]:start[l + 1]``.
    frame : (M,) int
    by_pose : (M, 2, 6)
    by_point : (M, 2, 3)
    by_instrument : (M, 2, Q)
        By the last Q numbers of the border.
    residual : (M, 2)
    weight : (M,)
    surface_by_point : (L, 3)
    surface_by_border : (L, B)
    surface_residual, surface_weight : (L,)
    """

    start: Int
    frame: Int
    by_pose: Float
    by_point: Float
    by_instrument: Float
    residual: Float
    weight: Float
    surface_by_point: Float
    surface_by_border: Float
    surface_residual: Float
    surface_weight: Float


class BorderedSystem:
    """Accumulates equations, solves them, and gives covariances.

    Parameters
    ----------
    frames, border, bandwidth
        Number of frames and of global numbers, and the largest distance of two frames in one equation.
    """

    def __init__(self, frames: int, border: int, bandwidth: int) -> None:
        size = BLOCK * frames
        self._band = np.zeros((BLOCK * (min(bandwidth, frames - 1) + 1), size))
        self._border = np.zeros((size, border))
        self._corner = np.zeros((border, border))
        self._right = np.zeros(size)
        self._right_border = np.zeros(border)

    def add(self, rows: Rows) -> None:
        """Add equations without landmarks."""
        _add_rows(
            rows.frame, rows.by_frame, rows.by_border, rows.residual, rows.weight,
            self._band, self._border, self._corner, self._right, self._right_border,
        )  # fmt: skip

    def add_landmarks(self, rows: LandmarkRows) -> tuple[Float, Float]:
        """Add texture and eliminate its landmarks; return their inverse information and right sides."""
        count = len(rows.start) - 1
        inverse, right = np.zeros((count, 3, 3)), np.zeros((count, 3))
        _add_landmarks(
            rows.start, rows.frame, rows.by_pose, rows.by_point, rows.by_instrument,
            rows.residual, rows.weight, rows.surface_by_point, rows.surface_by_border,
            rows.surface_residual, rows.surface_weight,
            self._band, self._border, self._corner, self._right, self._right_border, inverse, right,
        )  # fmt: skip
        return inverse, right

    def factor(self) -> Factor:
        """Return the factorised system.

        Raises
        ------
        numpy.linalg.LinAlgError
            When some unknown is not determined.
        """
        band = BlockTridiagonal.of_band(self._band)
        solved = band.solve(self._border)
        corner = cho_factor(self._corner - self._border.T @ solved)
        return Factor(band, self._border, solved, corner, self._right, self._right_border)


@dataclass(frozen=True)
class Factor:
    """A factorised `BorderedSystem`."""

    band: BlockTridiagonal
    border: Float
    solved_border: Float
    corner: tuple[Float, bool]
    right: Float
    right_border: Float

    def step(self) -> tuple[Float, Float]:
        """Return the step of the frames (N, 7) and of the border (B,)."""
        direct = self.band.solve(self.right[:, None])[:, 0]
        border = cho_solve(self.corner, self.right_border - self.border.T @ direct)
        return (direct - self.solved_border @ border).reshape(-1, BLOCK), border

    def border_covariance(self) -> Float:
        """Return (B, B)."""
        return np.asarray(cho_solve(self.corner, np.eye(self.border.shape[1])))

    def frame_covariance(self, frames: Int) -> Float:
        """Return (len(frames), 7, 7) marginal covariances."""
        border = self.border_covariance()
        rows = (BLOCK * frames[:, None] + np.arange(BLOCK)).ravel()
        unit = np.zeros((len(self.right), len(rows)))
        unit[rows, np.arange(len(rows))] = 1
        own = self.band.solve(unit)[rows] + self.solved_border[rows] @ border @ self.solved_border[rows].T
        blocks = own.reshape(len(frames), BLOCK, len(frames), BLOCK)
        each = np.arange(len(frames))
        return np.asarray(blocks[each, :, each])


def landmark_steps(
    rows: LandmarkRows, inverse: Float, right: Float, frame_step: Float, border_step: Float
) -> Float:
    """Return the steps (L, 3) of the eliminated landmarks."""
    instrument = border_step[len(border_step) - rows.by_instrument.shape[2] :]
    by_frames = np.einsum("mij,mj->mi", rows.by_pose, frame_step[rows.frame, :6])
    moved = by_frames + rows.by_instrument @ instrument
    pull = np.einsum("mij,mi,m->mj", rows.by_point, moved, rows.weight)
    total = np.add.reduceat(pull, rows.start[:-1], axis=0) if len(pull) else np.zeros((0, 3))
    surface = rows.surface_weight * (rows.surface_by_border @ border_step)
    return np.asarray(
        np.einsum("lij,lj->li", inverse, right - total - surface[:, None] * rows.surface_by_point)
    )


@numba.njit(cache=True)
def _add_rows(frame, by_frame, by_border, residual, weight, band, border, corner, right, right_border):  # type: ignore[no-untyped-def]
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
def _add_landmarks(  # type: ignore[no-untyped-def]
    start, frame, by_pose, by_point, by_instrument, residual, weight,
    s_point, s_border, s_residual, s_weight,
    band, border, corner, right, right_border, inverse, right_point,
):  # fmt: skip
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
