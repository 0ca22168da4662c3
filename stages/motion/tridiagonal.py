"""Cholesky factors of a symmetric banded matrix, worked on in dense blocks as wide as the band.

LAPACK's banded routines work column by column and were measured ten times slower here.
G. Golub, C. Van Loan, "Matrix computations", § 4.5.1 (block tridiagonal systems).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numba
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
        """Factorise the matrix whose rows f and columns f - l, in blocks, are ``band[f, l]`` (N, R, b, b).

        Of the blocks on the diagonal, l = 0, the lower triangle is looked at.

        Raises
        ------
        numpy.linalg.LinAlgError
            When it is not positive definite.
        """
        frames, lags = band.shape[:2]
        width = max(lags - 1, 1)
        edges = [*range(0, max(frames - width + 1, 1), width), frames]
        diagonal: list[Float] = []
        below: list[Float] = []
        for k, (a, b) in enumerate(pairwise(edges)):
            block = _dense(band, a, b, a, b)
            if below:
                block -= below[-1] @ below[-1].T
            diagonal.append(cholesky(block, lower=True, overwrite_a=True, check_finite=False))
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


@numba.njit(cache=True, nogil=True)
def _dense(band, r0, r1, c0, c1):  # type: ignore[no-untyped-def]
    """Return rows r0:r1 and columns c0:c1, in frames, of the lower triangle; 0 outside the band."""
    size = band.shape[2]
    out = np.zeros(((r1 - r0) * size, (c1 - c0) * size))
    for f in range(r0, r1):
        for e in range(max(c0, f - band.shape[1] + 1), min(c1, f + 1)):
            i, j = (f - r0) * size, (e - c0) * size
            out[i : i + size, j : j + size] = band[f, f - e]
    return out
