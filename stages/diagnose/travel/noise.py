"""Noise of an encoder's readings that drifts with distance, and least squares with that noise."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.stats import f as fisher

from pipeline.arrays import Float

# Number of columns as long as the run that are processed together: all of them would need its square in
# memory.
AT_ONCE = 256
# Columns of length 1 count as dependent below this residual: the square root of the resolution of doubles.
SOLID = 1e-8


@dataclass(frozen=True)
class DriftNoise:
    """White noise of ``white_mm`` in each difference, and a random walk of ``drift_mm`` per √mm of travel."""

    white_mm: float
    drift_mm: float

    def precision(self, path_mm: Float) -> Precision:
        """Return its inverse covariance at travelled distances (N,), which never decrease."""
        step = np.diff(path_mm, prepend=path_mm[0])
        band = np.zeros((2, len(path_mm)))
        band[0] = 2 * self.white_mm**2 + self.drift_mm**2 * step
        band[0, 0] = self.white_mm**2
        band[1, :-1] = -(self.white_mm**2)
        return Precision(cholesky_banded(band, lower=True))


@dataclass(frozen=True)
class Precision:
    """Inverse K⁻¹ of the covariance of N differences, in which only neighbouring steps are correlated.

    Attributes
    ----------
    factor : (2, N)
        Cholesky factor of the covariance of the first difference and of the steps: its diagonal, and below.
    """

    factor: Float

    def times(self, values: Float) -> Float:
        """Return K⁻¹ times values (N, ...)."""
        steps = np.diff(values, axis=0, prepend=0 * values[:1])
        solved = cho_solve_banded((self.factor, True), steps)
        return np.asarray(-np.diff(solved, axis=0, append=0 * solved[:1]))


@dataclass(frozen=True)
class Whitened:
    """Generalised least squares of differences (N,) on columns (N, C).

    Attributes
    ----------
    estimate : (C,)
    covariance : (C, C)
    residual : (N,)
        Of the differences.
    weighted : (N,)
        K⁻¹ residual.
    precision : Precision
        K⁻¹.
    weighted_columns : (N, C)
        K⁻¹ columns.
    inverse : (C, C)
        Inverse of the columns' information, 0 in undetermined directions.
    """

    estimate: Float
    covariance: Float
    residual: Float
    weighted: Float
    precision: Precision
    weighted_columns: Float
    inverse: Float

    def beyond(self, values: Float) -> Float:
        """Return K⁻¹ times values (N, M), minus what the columns explain."""
        return self.precision.times(values) - self.weighted_columns @ self.inverse @ (
            self.weighted_columns.T @ values
        )

    def information(self, candidates: Float) -> Float:
        """Return the information (M,) of candidate columns (N, M), each alone beside the columns."""
        return np.asarray(np.einsum("nm,nm->m", candidates, self.beyond(candidates)))

    def gain(self, candidates: Float) -> tuple[Float, Float]:
        """Return the estimate (M,) and score z² (M,) of each candidate column (N, M), added alone."""
        return self.gain_in_parts([candidates])

    def gain_in_parts(self, parts: Iterable[Float]) -> tuple[Float, Float]:
        """Return `gain` for all candidate columns, processed some (N, M) at a time."""
        each = [(self.information(part), part.T @ self.weighted) for part in parts]
        information, score = (np.concatenate(one) for one in zip(*each, strict=True))
        seen = information > 1e-9 * np.max(information, initial=1e-30)
        safe = np.where(seen, information, 1.0)
        return np.where(seen, score / safe, 0.0), np.where(seen, score**2 / safe, 0.0)


def whitened_fit(difference_mm: Float, columns: Float, precision: Precision) -> Whitened:
    """Return the generalised least-squares fit; undetermined columns get no estimate (σ infinite)."""
    weighted_columns = precision.times(columns)
    information = columns.T @ weighted_columns
    scale = 1 / np.sqrt(np.maximum(np.diag(information), 1e-30))
    value, vector = np.linalg.eigh(information * np.outer(scale, scale))
    solid = value > SOLID
    inverse = (vector[:, solid] / value[solid]) @ vector[:, solid].T
    inverse = inverse * np.outer(scale, scale)
    hidden = (vector[:, ~solid] ** 2).sum(1) > 1e-6
    estimate = inverse @ (weighted_columns.T @ difference_mm)
    residual = difference_mm - columns @ estimate
    spread = inverse.copy()
    spread[hidden, hidden] = np.inf
    weighted = precision.times(residual)
    return Whitened(estimate, spread, residual, weighted, precision, weighted_columns, inverse)


def chance_of_noise(left_over: float, free: int, pictures: int) -> float:
    """Return the probability that noise leaves such a χ² per each of ``free`` degrees of freedom (F test).

    The noise itself is estimated by medians, which are about as precise as a third of the pictures.
    """
    return float(fisher.sf(left_over, max(free, 1), max(pictures / 3, 1.0)))
