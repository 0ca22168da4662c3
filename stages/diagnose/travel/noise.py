"""Noise between encoder and visual distance: white noise of readings, and drift of the visual distance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from pipeline.adjustment.robust import spread_about_median
from pipeline.arrays import Float

_LEAST_WHITE_MM = 0.002
_LAGS = (2, 4, 8, 16, 32)
# Increments a lag needs at least: one or two steps among twelve do not move their median by much.
_PER_LAG = 12
_ROUNDS = 30


@dataclass(frozen=True)
class DriftNoise:
    """White noise of ``white_mm`` in each difference, and a random walk of ``drift_mm`` per √mm of way."""

    white_mm: float
    drift_mm: float

    def covariance(self, path_mm: Float) -> Float:
        """Return (N, N) at ways (N,)."""
        walk = np.minimum(path_mm[:, None], path_mm[None, :]) - path_mm[0]
        return np.asarray(self.white_mm**2 * np.eye(len(path_mm)) + self.drift_mm**2 * walk)


def estimated_noise(difference_mm: Float, columns: Float, path_mm: Float, least_mm: float) -> DriftNoise:
    """Return the noise of differences (N,), what columns (N, C) explain taken out, whatever events are in it.

    Steps of the differences are few, whatever slips there are, so least absolute deviations and medians of
    increments see past them. Drift is the largest that increments over several lags show, so that drift
    smoother than a random walk is not mistaken for events. No less than ``least_mm`` is believed: increments
    of an even motion may hit the readings' quanta alike.
    """
    left = difference_mm - columns @ robust_coefficients(difference_mm, columns)
    one = _increment_variance(left, 1)
    white = max(one / 2, least_mm**2, _LEAST_WHITE_MM**2)
    step, drift = float(np.median(np.diff(path_mm))), 0.0
    for lag in _LAGS:
        if lag == _LAGS[0] or _PER_LAG * lag <= len(left):
            way = float(np.median(path_mm[lag:] - path_mm[:-lag])) - step
            drift = max(drift, (_increment_variance(left, lag) - one) / max(way, 1e-6))
    return DriftNoise(float(np.sqrt(white)), float(np.sqrt(drift)))


def _increment_variance(values: Float, lag: int) -> float:
    step = values[lag:] - values[:-lag]
    return spread_about_median(step) ** 2 if len(step) else 0.0


def robust_coefficients(values: Float, columns: Float, rounds: int = _ROUNDS) -> Float:
    """Return coefficients (C,) of least absolute deviations of the increments (iterated reweighting)."""
    y, a = np.diff(values), np.diff(columns, axis=0)
    scale = np.maximum(np.linalg.norm(a, axis=0), 1e-12)
    found = np.zeros(columns.shape[1])
    for _ in range(rounds):
        weight = 1 / np.sqrt(np.maximum(np.abs(y - a @ found), 1e-4))
        found = np.linalg.lstsq(weight[:, None] * a / scale, weight * y, rcond=1e-8)[0] / scale
    return found


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
    projector : (N, N)
        K⁻¹ less what the columns take.
    """

    estimate: Float
    covariance: Float
    residual: Float
    weighted: Float
    projector: Float

    def gain(self, candidates: Float) -> tuple[Float, Float]:
        """Return estimates (M,) and scores z² (M,) that each candidate column (N, M) alone would add."""
        information = np.einsum("nm,nk,km->m", candidates, self.projector, candidates, optimize=True)
        score = candidates.T @ self.weighted
        seen = information > 1e-9 * np.max(information, initial=1e-30)
        safe = np.where(seen, information, 1.0)
        return np.where(seen, score / safe, 0.0), np.where(seen, score**2 / safe, 0.0)


def whitened_fit(difference_mm: Float, columns: Float, covariance: Float) -> Whitened:
    """Return the generalised least-squares fit; columns that say nothing get no estimate (σ infinite)."""
    factor = cho_factor(covariance, lower=True)
    weighted_columns = cho_solve(factor, columns)
    information = columns.T @ weighted_columns
    scale = 1 / np.sqrt(np.maximum(np.diag(information), 1e-30))
    value, vector = np.linalg.eigh(information * np.outer(scale, scale))
    solid = value > 1e-8
    inverse = (vector[:, solid] / value[solid]) @ vector[:, solid].T
    inverse = inverse * np.outer(scale, scale)
    hidden = (vector[:, ~solid] ** 2).sum(1) > 1e-6
    estimate = inverse @ (weighted_columns.T @ difference_mm)
    residual = difference_mm - columns @ estimate
    projector = cho_solve(factor, np.eye(len(residual))) - weighted_columns @ inverse @ weighted_columns.T
    inverse[hidden, hidden] = np.inf
    return Whitened(estimate, inverse, residual, cho_solve(factor, residual), projector)
