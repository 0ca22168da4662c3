"""Solves normal equations: dense ones, with covariance and the Schur complement, and banded ones.

Unknowns of one system may differ by ten powers of ten (focal lengths in px, distortions of the fourth order),
so all matrices are scaled to a unit diagonal first. B. Triggs et al., "Bundle adjustment: a modern
synthesis", 2000, § 6.

Banded ones have Cholesky factors, computed in dense columns of blocks as wide as the band: that is twice the
arithmetic, but LAPACK's banded routines, which go column by column, were measured ten times slower. G. Golub,
C. Van Loan, "Matrix computations", § 4.2.6 and 4.3.5.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numba
import numpy as np
from scipy.linalg import cho_factor, cho_solve, cholesky, solve_triangular

from pipeline.arrays import Float, Int

# Keeps a logarithm and a quotient finite.
_SMALLEST = 1e-300


def solved(matrix: Float, right: Float, rcond: float = 1e-15) -> Float:
    """Return the solution (N, ...) of a semidefinite system (N, N); undetermined directions stay 0."""
    scale = unit_scale(matrix)
    column = scale.reshape(-1, *(1,) * (right.ndim - 1))
    scaled = matrix * scale * scale[:, None]
    return np.asarray(column * np.linalg.lstsq(scaled, column * right, rcond=rcond)[0])


def spectrum(information: Float, least: float) -> tuple[Float, Float, Float]:
    """Return scale (N,), eigenvalues (N,) and eigenvectors (N, N) of the matrix with a unit diagonal.

    Eigenvalues below ``least`` are rounding: they are raised to it, so that undetermined directions stay
    uncertain.
    """
    scale = unit_scale(information)
    value, vector = np.linalg.eigh(information * scale * scale[:, None])
    return scale, np.maximum(value, least), vector


def covariance_of(information: Float, least: float = 1e-14) -> Float:
    """Return the inverse (N, N) of an information matrix."""
    scale, value, vector = spectrum(information, least)
    return np.asarray((vector / value) @ vector.T * scale * scale[:, None])


def log_determinant(information: Float) -> float:
    """Return the natural logarithm of the determinant of an information matrix."""
    scale, value, _ = spectrum(information, 1e-14)
    return float(np.sum(np.log(value)) - 2 * np.sum(np.log(scale)))


def unit_scale(matrix: Float) -> Float:
    """Return the factors (N,) that bring a matrix to a unit diagonal."""
    return np.asarray(1 / np.sqrt(np.maximum(np.diag(matrix), _SMALLEST)))


@dataclass(frozen=True)
class Marginal:
    """Normal equations of K unknowns, the other N − K eliminated at their best values.

    Attributes
    ----------
    information, right : (K, K), (K,)
        The Schur complement, and the remaining right side.
    follow : (N, K)
        Response of all unknowns to the kept ones.
    step : (N,)
        Step of the eliminated unknowns with the kept ones fixed.
    gain : float
        Decrease of the sum of squares by that step.
    """

    information: Float
    right: Float
    follow: Float
    step: Float
    gain: float


def marginalised(information: Float, right: Float, out: Int, rcond: float | None = None) -> Marginal:
    """Eliminate the unknowns at ``out`` (O,) from normal equations (N, N), (N,).

    Parameters
    ----------
    rcond
        If stated, unknowns are eliminated by least squares, and directions weaker than this part of the
        strongest do not move. If None, all must be determined.

    Raises
    ------
    numpy.linalg.LinAlgError
        When those to be eliminated are not determined.
    """
    kept = np.setdiff1d(np.arange(len(right)), out)
    own, cross = information[np.ix_(out, out)], information[np.ix_(out, kept)]
    sides = np.column_stack([cross, right[out]])
    moved = cho_solve(cho_factor(own), sides) if rcond is None else solved(own, sides, rcond)
    response, best = moved[:, :-1], moved[:, -1]
    left = information[np.ix_(kept, kept)] - cross.T @ response
    follow, step = np.zeros((len(right), len(kept))), np.zeros(len(right))
    follow[kept, np.arange(len(kept))] = 1
    follow[out], step[out] = -response, best
    return Marginal(
        (left + left.T) / 2, right[kept] - response.T @ right[out], follow, step, float(right[out] @ best)
    )


@dataclass(frozen=True)
class ArrowEquations:
    """Normal equations of F shared unknowns and V blocks of P, each coupled to the shared ones alone.

    Attributes
    ----------
    shared : (F, F)
    coupling : (V, F, P)
    block : (V, P, P)
    shared_gradients : (V, F)
        Gradients of each block's equations.
    block_gradient : (V, P)
    """

    shared: Float
    coupling: Float
    block: Float
    shared_gradients: Float
    block_gradient: Float

    def step(self, damping: float) -> tuple[Float, Float]:
        """Return the step of the shared unknowns (F,) and of the blocks (V, P), damped relatively."""
        block = self.block * (1 + damping * np.eye(self.block.shape[-1]))
        shared = self.shared * (1 + damping * np.eye(len(self.shared)))
        response = np.linalg.solve(block, np.swapaxes(self.coupling, 1, 2))
        best = np.linalg.solve(block, self.block_gradient[..., None])[..., 0]
        reduced = shared - np.einsum("vfp,vpg->fg", self.coupling, response)
        gradient = self.shared_gradients.sum(0) - np.einsum("vfp,vp->f", self.coupling, best)
        step = -solved(reduced, gradient)
        return step, -best - np.einsum("vpf,f->vp", response, step)

    def decrease(self, step: tuple[Float, Float]) -> float:
        """Return the decrease of the sum of squares by a step if the equations were linear."""
        shared, block = step
        slope = self.shared_gradients.sum(0) @ shared + np.sum(self.block_gradient * block)
        curve = shared @ self.shared @ shared + np.einsum("vp,vpq,vq->", block, self.block, block)
        return float(-2 * slope - curve - 2 * np.einsum("f,vfp,vp->", shared, self.coupling, block))

    def marginal(self) -> tuple[Float, Float]:
        """Return information (F, F) and gradients (V, F) of the shared unknowns, the blocks eliminated."""
        response = np.linalg.solve(self.block, np.swapaxes(self.coupling, 1, 2))
        information = self.shared - np.einsum("vfp,vpg->fg", self.coupling, response)
        gradients = self.shared_gradients - np.einsum("vpf,vp->vf", response, self.block_gradient)
        return information, gradients


_AT_ONCE = 16  # frames in each dense column


@dataclass(frozen=True)
class BandedCholesky:
    """Lower Cholesky factor: ``diagonal`` blocks, and ``below`` each the rows that are not all 0.

    ``rows`` holds their numbers. Frames that are coupled to a few others only, as those in the laser's light
    between lit ones, leave many rows at 0.
    """

    diagonal: tuple[Float, ...]
    below: tuple[Float, ...]
    rows: tuple[Int, ...]

    @staticmethod
    def of_band(band: Float) -> BandedCholesky:
        """Factorise the matrix whose rows f and columns f - l, in blocks, are ``band[f, l]`` (N, R, b, b).

        Of the blocks on the diagonal, l = 0, the lower triangle is used.

        Raises
        ------
        numpy.linalg.LinAlgError
            When it is not positive definite.
        """
        frames, lags, size = band.shape[:3]
        factor = BandedCholesky((), (), ())
        reached, taken = np.zeros(0, np.int64), np.zeros((0, 0))  # rows, and what columns so far take of them
        for first, last in pairwise([*range(0, frames, _AT_ONCE), frames]):
            start, width = first * size, (last - first) * size
            column = _dense(band, first, min(last - 1 + lags, frames), last)
            own = int(np.searchsorted(reached, start + width))
            column[np.ix_(reached - start, reached[:own] - start)] -= taken[:, :own]
            diagonal = cholesky(column[:width], lower=True, check_finite=False)
            below = np.flatnonzero(column[width:].any(axis=1)) + start + width
            before, reached = reached[own:], np.union1d(below, reached[own:])
            low = solve_triangular(diagonal, column[reached - start].T, lower=True, check_finite=False).T
            factor = factor._followed_by(diagonal, low, reached)
            more, at = low @ low.T, np.searchsorted(reached, before)
            more[np.ix_(at, at)] += taken[own:, own:]
            taken = more
        return factor

    def _followed_by(self, diagonal: Float, low: Float, rows: Int) -> BandedCholesky:
        return BandedCholesky((*self.diagonal, diagonal), (*self.below, low), (*self.rows, rows))

    def solve(self, right: Float) -> Float:
        """Return the solution (N, R) for right sides (N, R)."""
        return self.back(self.forth(right))

    def forth(self, right: Float) -> Float:
        """Return right sides (N, R) multiplied by the factor's inverse."""
        out = np.array(right, float)
        for own, factor, low, rows in self._columns():
            out[own] = solve_triangular(factor, out[own], lower=True, check_finite=False)
            out[rows] -= low @ out[own]
        return out

    def back(self, right: Float) -> Float:
        """Return right sides (N, R) multiplied by the inverse of the factor's transpose."""
        out = np.array(right, float)
        for own, factor, low, rows in reversed(self._columns()):
            part = out[own] - low.T @ out[rows]
            out[own] = solve_triangular(factor, part, lower=True, trans="T", check_finite=False)
        return out

    def _columns(self) -> list[tuple[slice, Float, Float, Int]]:
        """Return place, diagonal block, rows below it and their numbers of every column."""
        start = np.cumsum([0] + [len(d) for d in self.diagonal])
        own = [slice(int(a), int(b)) for a, b in pairwise(start)]
        return list(zip(own, self.diagonal, self.below, self.rows, strict=True))


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
