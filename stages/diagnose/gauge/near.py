"""What errors of rings in neighbouring cells of wall add to the variance of scores.

Scores are taken as independent from cell to cell, but print, wear and stains on a wall pass from one cell to
the next. How alike errors are at each distance follows from the residuals of the whole run: the scores of one
column at the cells' borders are too few for that (T. Conley, "GMM estimation with cross sectional
dependence", 1999).
"""

from __future__ import annotations

import numpy as np
from scipy.fft import irfft2, next_fast_len, rfft2

from pipeline.arrays import Float, Int
from stages.calibrate.gauge.terms import WALL_CELL_MM

# Squares of wall to each side of a cell; errors farther apart than a cell are taken as independent.
# Debt: data/debts.md.
_TO_A_SIDE = 4
_REACH = np.arange(-_TO_A_SIDE, _TO_A_SIDE + 1)


def beyond_cells(follow: Float, weight: Float, left: Float, wall_mm: Float) -> Float:
    """Return (K,) the variance of scores by errors that pass from one cell of wall to the next, at least 0.

    Parameters
    ----------
    follow : (K, M)
        Derivatives of the residuals by what each score is for.
    weight : (M,)
    left : (K, M)
        Residuals without what each score's own effect explains.
    wall_mm : (M, 2)
        Along the pipe and around it.
    """
    if not len(weight):
        return np.zeros(len(follow))
    square, shape = _squares(wall_mm)
    alike = _alike(weight, left, square, shape)
    columns = _gridded(follow * weight, square, shape)
    every = np.einsum("kxy,kxy->k", _correlated(columns), alike)
    return np.asarray(np.maximum(every - _within(columns, alike), 0.0))


def _squares(wall_mm: Float) -> tuple[Int, Int]:
    """Return each point's square of wall (M,), and how many there are along and around, in whole cells."""
    at = np.floor(wall_mm * (_TO_A_SIDE / WALL_CELL_MM)).astype(np.int64)
    at -= at.min(axis=0) // _TO_A_SIDE * _TO_A_SIDE
    shape = (at.max(axis=0) // _TO_A_SIDE + 1) * _TO_A_SIDE
    return at[:, 0] * shape[1] + at[:, 1], shape


def _gridded(values: Float, square: Int, shape: Int) -> Float:
    """Return the sums of values (K, M) over squares, (K, X, Y)."""
    return np.reshape([np.bincount(square, row, shape.prod()) for row in values], (-1, *shape))


def _alike(weight: Float, left: Float, square: Int, shape: Int) -> Float:
    """Return the errors' covariance (K, 9, 9) by distance in squares, along and around, as in `_REACH`."""
    weighted = weight * left
    products = _correlated(_gridded(weighted, square, shape))
    count = _correlated(_gridded(weight[None], square, shape))
    # A point's error with itself tells nothing of its neighbours'.
    products[:, _TO_A_SIDE, _TO_A_SIDE] -= np.sum(weighted**2, axis=1)
    count[:, _TO_A_SIDE, _TO_A_SIDE] -= np.sum(weight**2)
    return np.where(count > 1e-9 * count.max(), products / np.maximum(count, 1e-300), 0.0)


def _correlated(grids: Float) -> Float:
    """Return (K, 9, 9) the products of grids (K, X, Y) with themselves displaced as in `_REACH`."""
    along, around = (next_fast_len(n + _TO_A_SIDE, real=True) for n in grids.shape[1:])
    power = np.abs(rfft2(grids, (along, around))) ** 2
    return np.asarray(irfft2(power, (along, around))[:, _REACH[:, None] % along, _REACH % around])


def _within(columns: Float, alike: Float) -> Float:
    """Return (K,) what of the variance comes from pairs in one cell."""
    count, along, around = columns.shape
    n = _TO_A_SIDE
    cells = columns.reshape(count, along // n, n, around // n, n).swapaxes(2, 3).reshape(count, -1, n * n)
    x, y = np.divmod(np.arange(n * n), n)
    pairs = alike[:, x[:, None] - x + n, y[:, None] - y + n]
    return np.asarray(np.sum((cells @ pairs) * cells, axis=(1, 2)))
