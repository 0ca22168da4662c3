"""By how much scores scatter more than independent errors would make them.

Errors are correlated within cells of wall and within frames: `pipeline.adjustment.robust`. Beyond that they
are treated there as independent between cells, but print, wear and stains continue from one cell to the next.
The correlation at each distance is estimated from the residuals of the whole run: the scores of one column at
the borders of cells are too few for that (T. Conley, "GMM estimation with cross sectional dependence", 1999).
"""

from __future__ import annotations

import numpy as np
from scipy.fft import next_fast_len, rfft2

from pipeline.adjustment.normal_equations import Marginal
from pipeline.adjustment.robust import cluster_variance, degrees_of, two_way_variance
from pipeline.arrays import Float, Int
from stages.calibrate.gauge.terms import WALL_CELL_MM
from stages.diagnose.gauge.elimination import Reduced
from stages.diagnose.gauge.equations import EDGE, ENCODER, RING, Equations, by_frame, by_kind

# Squares of wall per side of a cell; errors farther apart than a cell are taken as independent. Debt:
# data/debts.md.
_TO_A_SIDE = 4
_REACH = np.arange(-_TO_A_SIDE, _TO_A_SIDE + 1)

# Largest factor by which errors are taken to exceed their residuals: in a frame with few cells, its number of
# unknowns gives it only roughly. Debt: data/debts.md.
_MOST_LOST = 4.0


def score_inflation(
    equations: Equations, reduced: Reduced, left: Marginal, out: Int, group: Int, known: Float
) -> tuple[Float, Float]:
    """Return by how much (K,) the scores' true 1 σ exceeds that of independent errors, at least 1.

    The second result, (K,), is its degrees of freedom; infinite where it is 1.

    ``out`` (O,) are the globals that were eliminated, ``left`` the evidence without them. Columns of one
    ``group`` (K,) belong to one effect: what they explain together is not an error, or else a large effect
    would hide itself. Group −1 is the instrument, which follows effects as far as its information ``known``
    (I, I) lets it: an effect's score is that of what the instrument cannot absorb.
    """
    follow, step = _with_eliminated(equations, reduced, left, out)
    free, asked = np.flatnonzero(group < 0), np.flatnonzero(group >= 0)
    taken_up = left.information[np.ix_(free, free)] + known
    follow[asked] -= np.linalg.solve(taken_up, left.information[np.ix_(free, asked)]).T @ follow[free]
    residual = equations.residual + step
    plain = follow**2 @ equations.weight
    left_over = _unexplained(equations.weight, follow, residual, group)
    by_row = np.ascontiguousarray((follow * equations.weight * left_over).T)
    lost = _lost(equations, reduced.taken)
    # Errors that are independent from point to point are hardly reduced by the few unknowns of a frame.
    cells = cluster_variance(by_row * np.sqrt(lost)[:, None], equations.cell) - (lost - 1) @ by_row**2
    # Sums over frames are not reduced by poses, but a few frames may contain all of a score.
    robust = np.maximum(two_way_variance(by_row, equations.cell, equations.frame), cells)
    ring = np.flatnonzero((equations.kind == RING) & (equations.weight > 0))
    robust += beyond_cells(
        follow[:, ring], equations.weight[ring], left_over[:, ring], equations.wall_mm[ring]
    )
    ratio = robust / np.maximum(plain, 1e-300)
    return np.sqrt(np.maximum(ratio, 1.0)), np.where(ratio > 1, degrees_of(by_row, equations.cell), np.inf)


def _with_eliminated(equations: Equations, reduced: Reduced, left: Marginal, out: Int) -> tuple[Float, Float]:
    """Return how residuals (M,) change with the K kept globals, and with the optimum of what is eliminated.

    The derivatives (K, M) include the response of poses, edges and the globals ``out`` (O,) to the kept ones;
    the second result, (M,), is added to the residuals.
    """
    pose_by_kept = reduced.pose_by_global @ left.follow
    # An effect's column is used repeatedly, so it is stored contiguously.
    follow, step = np.zeros((left.follow.shape[1], len(equations.frame))), np.zeros(len(equations.frame))
    place = equations.place
    stays, goes = np.flatnonzero(np.isin(place, out, invert=True)), np.flatnonzero(np.isin(place, out))
    for rows, used in by_kind(equations):
        gone = np.intersect1d(used, goes)
        by_gone = equations.by_global[rows][:, gone]
        # A kept global only follows itself.
        follow[:, rows] = (equations.by_global[rows][:, stays] + by_gone @ left.follow[place[gone]]).T
        step[rows] = by_gone @ left.step[place[gone]]
    at = np.flatnonzero(equations.edge >= 0)
    follow[:, at] += left.follow[equations.edge[at]].T * equations.by_edge[at]
    step[at] += left.step[equations.edge[at]] * equations.by_edge[at]
    for k, (own, by_pose) in enumerate(by_frame(equations, len(pose_by_kept))):
        follow[:, own] -= (by_pose @ pose_by_kept[k]).T
        step[own] += by_pose @ (reduced.pose_step[k] - reduced.pose_by_global[k] @ left.step)
    return follow, step


def _lost(equations: Equations, taken: Float) -> Float:
    """Return by how much (M,) the variance of errors common to cells exceeds that of a frame's residuals.

    A pose and the places of fiducials' edges absorb what is common in a cell: of n cells of a frame, as many
    as they have unknowns (J. MacKinnon, H. White, "Some heteroskedasticity-consistent covariance matrix
    estimators", 1985). The place of each edge is shared by the frames that see it.
    """
    used = (equations.weight > 0) & (equations.kind != ENCODER)
    pair, first = np.unique(np.stack([equations.frame, equations.cell])[:, used], axis=1, return_index=True)
    kind = equations.kind[used][first]
    seen, visits = np.unique(pair[1], return_counts=True)
    shared = np.where(kind == EDGE, 1 / visits[np.searchsorted(seen, pair[1])], 0.0)
    cells = np.maximum(np.bincount(pair[0], minlength=len(taken)), 1.0)
    gone = taken + np.bincount(pair[0], shared, minlength=len(taken))
    factor = cells / np.maximum(cells - gone, cells / _MOST_LOST)
    return np.where(equations.kind == ENCODER, 1.0, factor[equations.frame])


def _unexplained(weight: Float, follow: Float, residual: Float, group: Int) -> Float:
    """Return the residual (K, M) that each column's own group leaves; ``follow`` is (K, M), too."""
    out = np.tile(residual, (len(follow), 1))
    for own in (np.flatnonzero(group == g) for g in np.unique(group[group >= 0])):
        columns = follow[own]
        weighted = columns * weight
        out[own] -= np.linalg.lstsq(weighted @ columns.T, weighted @ residual)[0] @ columns
    return out


def beyond_cells(follow: Float, weight: Float, left: Float, wall_mm: Float) -> Float:
    """Return the variance (K,) of scores from errors that continue into the next cell of wall, at least 0.

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
    """Return each point's square of wall (M,), and the numbers of squares along and around."""
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
    # A point's error with itself says nothing about neighbours.
    products[:, _TO_A_SIDE, _TO_A_SIDE] -= np.sum(weighted**2, axis=1)
    count[:, _TO_A_SIDE, _TO_A_SIDE] -= np.sum(weight**2)
    return np.where(count > 1e-9 * count.max(), products / np.maximum(count, 1e-300), 0.0)


def _correlated(grids: Float) -> Float:
    """Return (K, 9, 9) the products of grids (K, X, Y) with themselves displaced as in `_REACH`."""
    shape = along, around = [next_fast_len(n + _TO_A_SIDE, real=True) for n in grids.shape[1:]]
    spectrum = rfft2(grids, shape)
    power = spectrum.real**2 + spectrum.imag**2
    # All displacements would need an inverse transform; a power spectrum is even, so that a few are sums of
    # cosines.
    frequency = np.arange(power.shape[2])
    twice = np.where((frequency == 0) | (2 * frequency == around), 1.0, 2.0)[:, None]
    (cos_x, sin_x), (cos_y, sin_y) = (_waves(np.arange(along), along), _waves(frequency, around))
    even, odd = power @ (twice * cos_y.T), power @ (twice * sin_y.T)
    return np.asarray((cos_x @ even - sin_x @ odd) / (along * around))


def _waves(frequency: Int, length: int) -> tuple[Float, Float]:
    """Return cosine and sine (9, F) of whole frequencies in ``length`` at the displacements."""
    phase = 2 * np.pi / length * np.outer(_REACH, frequency)
    return np.cos(phase), np.sin(phase)


def _within(columns: Float, alike: Float) -> Float:
    """Return the part (K,) of the variance that comes from pairs in one cell."""
    count, along, around = columns.shape
    n = _TO_A_SIDE
    cells = columns.reshape(count, along // n, n, around // n, n).swapaxes(2, 3).reshape(count, -1, n * n)
    x, y = np.divmod(np.arange(n * n), n)
    pairs = alike[:, x[:, None] - x + n, y[:, None] - y + n]
    return np.asarray(np.sum((cells @ pairs) * cells, axis=(1, 2)))
