"""Normal equations of frames, landmarks and a few global numbers: banded, bordered, landmarks eliminated.

The unknowns are ``BLOCK`` numbers for each frame (banded, because no landmark is followed for long), a border
of global numbers, and three coordinates for each landmark, which the Schur complement eliminates. B. Triggs
et al., "Bundle adjustment: a modern synthesis", 2000, § 6.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from pipeline.adjustment.elimination import BLOCK, Sums, add_landmarks, add_rows
from pipeline.adjustment.normal_equations import BandedCholesky, marginalised
from pipeline.adjustment.rows import LandmarkRows, Rows
from pipeline.arrays import Float, Int
from pipeline.system.parallel import side_by_side

# Observations multiplied at a time: so few that their derivatives by the instrument stay in the processor's
# cache.
_IN_CACHE = 1024


class BorderedSystem:
    """Accumulates equations, solves them, and gives covariances.

    Parameters
    ----------
    frames, border, bandwidth
        Number of frames and of global numbers, and the largest distance of two frames in one equation.
    """

    def __init__(self, frames: int, border: int, bandwidth: int) -> None:
        self._sums = Sums.empty(frames, border, min(bandwidth, frames - 1) + 1)

    def add(self, rows: Rows) -> None:
        """Add equations without landmarks."""
        add_rows(rows.frame, rows.by_frame, rows.by_border, rows.residual, rows.weight, *self._sums.arrays)

    def add_landmarks(self, rows: LandmarkRows, damping: float = 0.0) -> tuple[Float, Float]:
        """Add texture and eliminate its landmarks.

        Return the inverse information (L, 3, 3) and the right side (L, 3) of each landmark.

        A relative ``damping`` raises the diagonal of each landmark's information. Two threads sum one half of
        the landmarks each; the halves are always the same, so that the sums have the same bytes.
        """
        count, weight, surface_weight = len(rows.start) - 1, rows.weight, rows.surface_weight
        self._add_instrument(rows, weight)
        inverse, right = np.zeros((count, 3, 3)), np.zeros((count, 3))

        def add_share(sums: Sums, part: slice) -> None:
            add_landmarks(
                rows.start[part.start : part.stop + 1], rows.frame, rows.by_pose, rows.by_point,
                rows.by_instrument, rows.residual, weight, rows.surface_by_point[part],
                rows.surface_by_border[part], rows.surface_residual[part], surface_weight[part], damping,
                *sums.arrays, inverse[part], right[part],
            )  # fmt: skip

        other, half = self._sums.like(), count // 2
        shares = [(self._sums, slice(0, half)), (other, slice(half, count))]
        side_by_side(lambda share: add_share(*share), shares)
        self._sums.add(other)
        return inverse, right

    def _add_instrument(self, rows: LandmarkRows, weight: Float) -> None:
        """Add the products of the instrument's derivatives with themselves."""
        count = rows.by_instrument.shape[2]
        own = slice(len(self._sums.corner) - count, None)
        for first in range(0, len(weight), _IN_CACHE):
            part = slice(first, first + _IN_CACHE)
            instrument = rows.by_instrument[part].reshape(-1, count)
            weighted = (rows.by_instrument[part] * weight[part, None, None]).reshape(-1, count)
            self._sums.corner[own, own] += weighted.T @ instrument
            self._sums.right_border[own] -= weighted.T @ rows.residual[part].ravel()

    def factor(self, damping: float = 0.0) -> Factor:
        """Return the factorised system, the diagonal raised by a relative ``damping``.

        Raises
        ------
        numpy.linalg.LinAlgError
            When some unknown is not determined.
        """
        sums = self._sums
        band, corner = sums.band, sums.corner
        if damping:
            band, corner = band.copy(), corner + damping * np.diag(np.diag(corner))
            diagonal = np.arange(BLOCK)
            band[:, 0, diagonal, diagonal] *= 1 + damping
        banded = BandedCholesky.of_band(band)
        halfway = banded.forth(np.column_stack([sums.border, sums.right]))
        border, right = halfway[:, :-1], halfway[:, -1]
        reduced = corner - border.T @ border
        if not np.isfinite(reduced).all():
            raise np.linalg.LinAlgError("the normal equations are not finite")
        return Factor(banded, border, cho_factor(reduced), right, sums.right_border - border.T @ right)


@dataclass(frozen=True)
class Factor:
    """A factorised `BorderedSystem`.

    Attributes
    ----------
    band : BandedCholesky
        Cholesky factor of the frames' band.
    border : (7 N, B)
        The border, multiplied by the inverse of the band's factor.
    corner
        Cholesky factor of the border's information after elimination of the frames.
    right : (7 N,)
        The frames' right side, multiplied in the same way as the border.
    border_right : (B,)
        The border's right side after elimination of the frames.
    """

    band: BandedCholesky
    border: Float
    corner: tuple[Float, bool]
    right: Float
    border_right: Float

    @cached_property
    def solved_border(self) -> Float:
        """Return the decrease (7 N, B) of the frames' unknowns per unit of each border unknown."""
        return self.band.back(self.border)

    def step(self) -> tuple[Float, Float]:
        """Return the step of the frames (N, 7) and of the border (B,)."""
        border = cho_solve(self.corner, self.border_right)
        return self.frames_after(border), border

    def border_covariance(self) -> Float:
        """Return the covariance (B, B) of the border's unknowns."""
        return np.asarray(cho_solve(self.corner, np.eye(self.border.shape[1])))

    def joint_covariance(self, frames: Int) -> Float:
        """Return the covariance (K, 7, K, 7) of K frames with each other."""
        border = self.border_covariance()
        rows = (BLOCK * frames[:, None] + np.arange(BLOCK)).ravel()
        unit = np.zeros((len(self.right), len(rows)))
        unit[rows, np.arange(len(rows))] = 1
        halfway, follow = self.band.forth(unit), self.solved_border[rows]
        own = halfway.T @ halfway + follow @ border @ follow.T
        return np.asarray(own.reshape(len(frames), BLOCK, len(frames), BLOCK))

    def border_information(self) -> Float:
        """Return the information (B, B) of the border's unknowns, the frames eliminated."""
        upper = np.triu(self.corner[0])
        return np.asarray(upper.T @ upper)

    def border_rows(self, rows: Rows) -> Float:
        """Return derivatives (M, B) of residuals by the border, each equation's one frame following it."""
        of_frame = self.solved_border.reshape(-1, BLOCK, self.border.shape[1])
        out = rows.by_border.copy()
        for frame in np.unique(rows.frame[:, 0]):
            own = rows.frame[:, 0] == frame
            out[own] -= rows.by_frame[own, 0] @ of_frame[frame]
        return out

    def frames_after(self, border: Float) -> Float:
        """Return the step (N, 7) of the frames to their optimum when the border steps by (B,)."""
        rest = self.right - self.border @ border
        return self.band.back(rest[:, None]).reshape(-1, BLOCK)

    def frames_follow(self, border: Float) -> Float:
        """Return the response (N, 7, S) of the frames to S directions (B, S) of the border."""
        return np.asarray((-self.solved_border @ border).reshape(-1, BLOCK, border.shape[1]))

    def response(self, which: Int) -> tuple[Float, Float]:
        """Return the response of frames (N, 7, S) and border (B, S) to changes of S border unknowns.

        All other unknowns take their optimum.
        """
        information = self.border_information()
        other = np.setdiff1d(np.arange(len(information)), which)
        border = marginalised(information, np.zeros(len(information)), other).follow
        border = border[:, np.argsort(np.argsort(which))]
        return self.frames_follow(border), border


def landmark_steps(
    rows: LandmarkRows, inverse: Float, right: Float, frame_step: Float, border_step: Float
) -> Float:
    """Return the steps (L, 3) of the eliminated landmarks."""
    moved = rows.change_by_view(frame_step, border_step)
    pull = np.einsum("mij,mi->mj", rows.by_point, moved * rows.weight[:, None])
    total, seen = np.zeros((len(right), 3)), np.flatnonzero(np.diff(rows.start))
    if len(seen):  # reduceat gives a landmark without views the first row of the next one, or fails
        total[seen] = np.add.reduceat(pull, rows.start[seen], axis=0)
    surface = rows.surface_weight * (rows.surface_by_border @ border_step)
    return np.asarray(
        np.einsum("lij,lj->li", inverse, right - total - surface[:, None] * rows.surface_by_point)
    )
