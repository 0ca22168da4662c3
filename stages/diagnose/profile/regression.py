"""Robust regression with an uncertainty that survives correlated neighbours."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from pipeline.adjustment.robust import robust_spread
from pipeline.arrays import Float, Int

_TUNING = 4.685
_STEPS = 8


@dataclass(frozen=True)
class Regression:
    """Coefficients (K,), their covariance (K, K) from leaving out groups, and the number of groups."""

    coefficient: Float
    covariance: Float
    groups: int

    @property
    def sigma(self) -> Float:
        """(K,) 1 σ."""
        return np.asarray(np.sqrt(np.diagonal(self.covariance)))


def regress(design: Float, value: Float, group: Int) -> Regression:
    """Fit ``value`` (M,) by ``design`` (M, K) with biweights; σ by the jackknife over ``group`` (M,).

    The groups must be far enough apart to err independently. Rows that are not finite, or of a negative
    group, are left out.
    """
    known = (group >= 0) & np.isfinite(value) & np.isfinite(design).all(1)
    x, y, g = design[known], value[known], group[known]
    names = np.unique(g)
    width = x.shape[1]
    if len(names) < 3 or len(y) <= 2 * width:
        return Regression(np.full(width, np.nan), np.full((width, width), np.nan), len(names))
    weight = _biweights(x, y)
    parts = [
        (x[s].T @ (weight[s, None] * x[s]), x[s].T @ (weight[s] * y[s])) for s in (g == n for n in names)
    ]
    normal, right = sum(p[0] for p in parts), sum(p[1] for p in parts)
    best = _solve(normal, right)
    left = np.array([_solve(normal - a, right - b) for a, b in parts]) - best
    return Regression(best, (len(names) - 1) / len(names) * left.T @ left, len(names))


@dataclass(frozen=True)
class Tested:
    """An estimate against nothing: over its σ, and the two-sided p-value."""

    sigma: float
    z: float
    p_value: float


def tested(estimate: float, random: float, floor: float, groups: int) -> Tested:
    """Test an estimate whose 1 σ ``random`` was estimated from ``groups`` groups; its ``floor`` is known.

    Student's t with Welch and Satterthwaite's degrees of freedom; the known floor has infinitely many.
    """
    variance = random**2 + floor**2
    sigma = float(np.sqrt(variance))
    freedom = max(groups - 1, 1) * (variance / max(random**2, 1e-12 * variance)) ** 2
    z = float(estimate / sigma)
    return Tested(sigma, z, float(2 * student.sf(abs(z), freedom)))


def _biweights(x: Float, y: Float) -> Float:
    weight = np.ones(len(y))
    for _ in range(_STEPS):
        rest = y - x @ _solve(x.T @ (weight[:, None] * x), x.T @ (weight * y))
        scale = max(robust_spread(rest), 1e-12)
        weight = np.maximum(1 - (rest / (_TUNING * scale)) ** 2, 0.0) ** 2
    return weight


def _solve(normal: Float, right: Float) -> Float:
    """Solve with columns scaled alike, so that units do not decide what is singular."""
    scale = np.sqrt(np.maximum(np.diagonal(normal), 1e-300))
    return np.asarray(np.linalg.lstsq(normal / np.outer(scale, scale), right / scale, rcond=1e-10)[0] / scale)
