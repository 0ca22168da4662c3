"""Normal equations of frames, landmarks and a few global numbers: banded, bordered, landmarks eliminated.

The unknowns are ``BLOCK`` numbers for each frame (banded, because no landmark is followed for long), a border
of global numbers, and three for each landmark, which leave by the Schur complement. B. Triggs et al.,
"Bundle adjustment: a modern synthesis", 2000, § 6.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from stages.motion.elimination import add_landmarks, add_rows
from stages.motion.tridiagonal import BlockTridiagonal

Float = NDArray[np.float64]
Int = NDArray[np.int64]
BLOCK = 7
_DAMPING = 1e-5


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
        add_rows(
            rows.frame, rows.by_frame, rows.by_border, rows.residual, rows.weight,
            self._band, self._border, self._corner, self._right, self._right_border,
        )  # fmt: skip

    def add_landmarks(self, rows: LandmarkRows) -> tuple[Float, Float]:
        """Add texture and eliminate its landmarks; return their inverse information and right sides."""
        count = len(rows.start) - 1
        inverse, right = np.zeros((count, 3, 3)), np.zeros((count, 3))
        add_landmarks(
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
        try:
            return self._factor(0.0)
        except np.linalg.LinAlgError:
            # Rounding can make a weakly held direction negative: a shorter step is as good.
            return self._factor(_DAMPING)

    def _factor(self, damping: float) -> Factor:
        """Return the factors with the frames' own information raised by a relative ``damping``."""
        damped = self._band.copy() if damping else self._band
        damped[0] = damped[0] * (1 + damping)
        band = BlockTridiagonal.of_band(damped)
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
