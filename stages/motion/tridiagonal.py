"""Cholesky factors of a symmetric banded matrix, worked on in dense blocks as wide as the band.

LAPACK's banded routines work column by column and were measured ten times slower here.
G. Golub, C. Van Loan, "Matrix computations", § 4.5.1 (block tridiagonal systems).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular

Float = NDArray[np.float64]


@dataclass(frozen=True)
class BlockTridiagonal:
    """Lower Cholesky factor: ``diagonal`` blocks and the ``below`` blocks under them."""

    diagonal: tuple[Float, ...]
    below: tuple[Float, ...]

    @staticmethod
    def of_band(band: Float) -> BlockTridiagonal:
        """Factorise the matrix whose entry (i, j), i ≥ j, is ``band[i - j, j]``.

        Raises
        ------
        numpy.linalg.LinAlgError
            When it is not positive definite.
        """
        width, size = band.shape
        edges = [*range(0, max(size - width + 1, 1), width), size]
        diagonal: list[Float] = []
        below: list[Float] = []
        for k, (a, b) in enumerate(pairwise(edges)):
            block = _dense(band, a, b, a, b)
            block = block + np.tril(block, -1).T
            if below:
                block -= below[-1] @ below[-1].T
            diagonal.append(cholesky(block, lower=True, check_finite=False))
            if k + 2 < len(edges):
                low = _dense(band, b, edges[k + 2], a, b)
                below.append(solve_triangular(diagonal[-1], low.T, lower=True, check_finite=False).T)
        return BlockTridiagonal(tuple(diagonal), tuple(below))

    def solve(self, right: Float) -> Float:
        """Return the solution (N, R) for right sides (N, R)."""
        edges = np.cumsum([0] + [len(d) for d in self.diagonal])
        parts = [right[a:b] for a, b in pairwise(edges)]
        for k, factor in enumerate(self.diagonal):
            part = parts[k] - self.below[k - 1] @ parts[k - 1] if k else parts[k]
            parts[k] = solve_triangular(factor, part, lower=True, check_finite=False)
        for k in range(len(parts) - 1, -1, -1):
            part = parts[k] - self.below[k].T @ parts[k + 1] if k < len(self.below) else parts[k]
            parts[k] = solve_triangular(self.diagonal[k], part, lower=True, trans="T", check_finite=False)
        return np.concatenate(parts)


def _dense(band: Float, r0: int, r1: int, c0: int, c1: int) -> Float:
    """Return rows r0:r1, columns c0:c1 of the lower triangle; 0 outside the band."""
    lag = np.arange(r0, r1)[:, None] - np.arange(c0, c1)
    inside = (lag >= 0) & (lag < len(band))
    column = np.broadcast_to(np.arange(c0, c1), lag.shape)
    return np.where(inside, band[np.where(inside, lag, 0), column], 0.0)
