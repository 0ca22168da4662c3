"""Cholesky factors of a symmetric banded matrix, worked on in dense columns of blocks.

LAPACK's banded routines work column by column and were measured ten times slower here; dense blocks as wide
as the band do twice the arithmetic. G. Golub, C. Van Loan, "Matrix computations", § 4.2.6 and 4.3.5.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numba
import numpy as np
from scipy.linalg import cholesky, solve_triangular

from pipeline.arrays import Float

_AT_ONCE = 16  # frames a column


@dataclass(frozen=True)
class BandedCholesky:
    """Lower Cholesky factor: ``diagonal`` blocks, and in ``below`` all that lies under each."""

    diagonal: tuple[Float, ...]
    below: tuple[Float, ...]

    @staticmethod
    def of_band(band: Float) -> BandedCholesky:
        """Factorise the matrix whose rows f and columns f - l, in blocks, are ``band[f, l]`` (N, R, b, b).

        Of the blocks on the diagonal, l = 0, the lower triangle is looked at.

        Raises
        ------
        numpy.linalg.LinAlgError
            When it is not positive definite.
        """
        frames, lags, size = band.shape[:3]
        diagonal: list[Float] = []
        below: list[Float] = []
        taken = np.zeros((0, 0))  # what the columns so far take from the rows that they reach
        for first, last in pairwise([*range(0, frames, _AT_ONCE), frames]):
            width = (last - first) * size
            column = _dense(band, first, min(last - 1 + lags, frames), last)
            reached = len(taken)
            column[:reached, :reached] -= taken[:, :width]
            diagonal.append(cholesky(column[:width], lower=True, check_finite=False))
            low = solve_triangular(diagonal[-1], column[width:].T, lower=True, check_finite=False).T
            below.append(low)
            more = low @ low.T
            still = max(reached - width, 0)
            more[:still, :still] += taken[width:, width:]
            taken = more
        return BandedCholesky(tuple(diagonal), tuple(below))

    def solve(self, right: Float) -> Float:
        """Return the solution (N, R) for right sides (N, R)."""
        out = np.array(right, float)
        start = np.cumsum([0] + [len(d) for d in self.diagonal])
        for k, (factor, low) in enumerate(zip(self.diagonal, self.below, strict=True)):
            own, reached = slice(start[k], start[k + 1]), slice(start[k + 1], start[k + 1] + len(low))
            out[own] = solve_triangular(factor, out[own], lower=True, check_finite=False)
            out[reached] -= low @ out[own]
        for k in range(len(self.diagonal) - 1, -1, -1):
            factor, low = self.diagonal[k], self.below[k]
            own, reached = slice(start[k], start[k + 1]), slice(start[k + 1], start[k + 1] + len(low))
            part = out[own] - low.T @ out[reached]
            out[own] = solve_triangular(factor, part, lower=True, trans="T", check_finite=False)
        return out


@numba.njit(cache=True, nogil=True)
def _dense(band, first, end, last):  # type: ignore[no-untyped-def]
    """Return rows first:end and columns first:last, in frames, of the lower triangle; 0 outside the band."""
    size = band.shape[2]
    out = np.zeros(((end - first) * size, (last - first) * size))
    for f in range(first, end):
        for e in range(max(first, f - band.shape[1] + 1), min(last, f + 1)):
            i, j = (f - first) * size, (e - first) * size
            for a in range(size):
                for b in range(size):
                    out[i + a, j + b] = band[f, f - e, a, b]
    return out
