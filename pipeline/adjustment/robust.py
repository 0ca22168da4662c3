"""Spreads, robust losses, harmonics of rings, and scores of equations with correlated errors in clusters.

A robust loss gives the weight of an equation and the cost that goes with it.
The weight w = ρ′(r) / r of a loss ρ minimises its cost by repeated solution of the equations.
P. Huber, "Robust statistics", 1981, § 7.8; S. Geman, D. McClure, "Statistical methods for tomographic image
reconstruction", 1987.

Errors are correlated between neighbours on the wall and between corners of one picture. The variance of the
score of such equations is that of its sums over clusters, taken as independent, times C / (C − 1) for C
clusters (H. White, "Asymptotic theory for econometricians", 1984, ch. 6; A. Cameron, D. Miller, "A
practitioner's guide to cluster-robust inference", 2015).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pipeline.arrays import Float, Float32, Int

MAD_TO_SIGMA = 1.4826
"""1/Φ⁻¹(3/4): half of all normal errors are smaller than Φ⁻¹(3/4) σ = 0.67449 σ (Huber 1981, § 5.1)."""

TUKEY = 4.685
"""Spreads beyond which a residual does not count: 95 % efficiency on normal noise (Beaton & Tukey 1974)."""
_HARMONICS = 2
# Means over sectors of 1.5° stand for the columns of a row: one period of the second harmonic has 120.
_SECTORS = 240


def root_mean_square(values: Float) -> float:
    """Return the root mean square of all values."""
    return float(np.sqrt(np.mean(np.square(values))))


def left_out_sd(without: Float) -> Float:
    """Return the 1 σ (...) of a figure from its values (N, ...) without each of N parts of the data.

    The jackknife (B. Efron, "The jackknife, the bootstrap and other resampling plans", 1982).
    """
    parts = len(without)
    return np.asarray(np.sqrt((parts - 1) / parts * ((without - without.mean(0)) ** 2).sum(0)))


def cluster_sums(scores: Float, cluster: Int) -> Float:
    """Return the sums (C, K) of scores (M, K) over the clusters, by ascending number of ``cluster`` (M,)."""
    from scipy.sparse import csr_matrix  # loaded where it is needed: a spread alone does without

    place = np.unique(cluster, return_inverse=True)[1]
    count = int(place.max(initial=-1)) + 1
    member = csr_matrix((np.ones(len(place)), (place, np.arange(len(place)))), shape=(count, len(place)))
    return np.asarray(member @ scores)


def cluster_covariance(scores: Float, cluster: Int) -> Float:
    """Return the covariance (K, K) of the sum of all scores (M, K)."""
    sums = cluster_sums(scores, cluster)
    return np.asarray(sums.T @ sums * _few(len(sums)))


def cluster_variance(scores: Float, cluster: Int) -> Float:
    """Return the diagonal (K,) of `cluster_covariance`."""
    sums = cluster_sums(scores, cluster)
    return np.asarray(np.square(sums).sum(0) * _few(len(sums)))


def degrees_of(scores: Float, cluster: Int) -> Float:
    """Return the degrees of freedom (K,) of `cluster_variance`: few clusters may hold most of a score.

    F. Satterthwaite, "An approximate distribution of estimates of variance components", 1946.
    """
    squares = np.square(cluster_sums(scores, cluster))
    return np.asarray(squares.sum(0) ** 2 / np.maximum(np.square(squares).sum(0), 1e-300))


def two_way_variance(scores: Float, cluster: Int, other: Int) -> Float:
    """Return the variance (K,) of summed scores that err alike in clusters of two kinds.

    A. Cameron, J. Gelbach, D. Miller, "Robust inference with multiway clustering", 2011.
    """
    first, second = (np.unique(x, return_inverse=True)[1] for x in (cluster, other))
    both = first * (second.max(initial=0) + 1) + second
    either = cluster_variance(scores, first) + cluster_variance(scores, second)
    return np.asarray(either - cluster_variance(scores, both))


def _few(clusters: int) -> float:
    return clusters / max(clusters - 1, 1)


def independent_count(values: Float) -> float:
    """Return how many independent values would have a mean as uncertain as that of a correlated series (n,).

    Their autocorrelation is summed up to where it is first negative (C. Geyer, "Practical Markov chain Monte
    Carlo", 1992).
    """
    off = values - values.mean()
    alike = np.fft.irfft(np.abs(np.fft.rfft(off, 2 * len(off))) ** 2)[: len(off)]
    positive = alike[: int(np.argmax(alike < 0)) or len(off)]
    return max(len(off) / max(2 * float(positive.sum() / max(alike[0], 1e-300)) - 1, 1.0), 1.0)


def robust_spread(residual: Float | Float32) -> float:
    """Return 1 σ of residuals of any shape about zero, from their median size; NaN entries do not count."""
    size = np.abs(residual)
    middle = np.nanmedian(size) if np.isnan(size).any() else np.median(size)
    return MAD_TO_SIGMA * float(middle)


def robust_spreads(residual: Float | Float32, axis: int) -> Float:
    """Return 1 σ about zero along ``axis``, from the median size; NaN entries do not count."""
    size = np.abs(residual)
    known = not np.isnan(size).any()
    middle = np.median(size, axis) if known else row_median(np.moveaxis(size, axis, -1))
    return np.asarray(MAD_TO_SIGMA * middle)


def spread_about_median(values: Float | Float32) -> float:
    """Return 1 σ of values about their median: 1.4826 times the median absolute deviation."""
    return robust_spread(values - np.median(values))


def basis_of(azimuth_rad: Float, harmonics: int = _HARMONICS) -> Float:
    """Return (A, 1 + 2 h): 1, cos ψ, sin ψ, … cos hψ, sin hψ for h harmonics."""
    waves = [f(m * azimuth_rad) for m in range(1, harmonics + 1) for f in (np.cos, np.sin)]
    return np.stack([np.ones_like(azimuth_rad), *waves], -1)


def ring_harmonics(radius: Float, basis: Float) -> Float:
    """Return the harmonics (S, B) of rows (S, A) by a redescending fit, so that defects do not pull.

    ``basis`` (A, B) is that of `basis_of`. NaN for rows seen to less than a half.
    """
    radius, basis = _sectors(radius), _sectors(basis.T).T
    seen = np.isfinite(radius)
    usable = seen.mean(1) >= 0.5
    out = np.full((len(radius), basis.shape[1]), np.nan)
    values, weight = np.where(seen, radius, 0.0)[usable], seen[usable]
    found = np.zeros((len(values), basis.shape[1]))
    found[:, 0] = row_median(radius[usable])
    products = (basis[:, :, None] * basis[:, None, :]).reshape(len(basis), -1)
    for _ in range(12):
        residual = np.where(weight, values - found @ basis.T, np.nan)
        scale = MAD_TO_SIGMA * row_median(np.abs(residual))
        u = np.nan_to_num(residual / (TUKEY * np.maximum(scale, 1e-6))[:, None], nan=2.0)
        w = np.where(np.abs(u) < 1, (1 - u * u) ** 2, 0.0)
        normal = (w @ products).reshape(-1, basis.shape[1], basis.shape[1])
        normal += 1e-6 * np.eye(basis.shape[1])
        found = np.linalg.solve(normal, ((w * values) @ basis)[..., None])[..., 0]
    out[usable] = found
    return out


def _sectors(rows: Float) -> Float:
    """Return the means (S, A / k) of k neighbouring columns; NaN where half of them or more was not seen."""
    width = next(k for k in range(max(1, rows.shape[1] // _SECTORS), 0, -1) if rows.shape[1] % k == 0)
    blocks = rows.reshape(len(rows), -1, width)
    count = np.isfinite(blocks).sum(2)
    total = np.nan_to_num(blocks).sum(2)
    return np.asarray(np.where(2 * count > width, total / np.maximum(count, 1), np.nan))


def row_median(rows: Float | Float32) -> Float:
    """Return the median (...) of each row's finite values, along the last axis of ``rows`` (..., N).

    NaN where a row has none. NumPy's `nanmedian` takes five times as long.
    """
    if rows.shape[-1] == 0:
        return np.full(rows.shape[:-1], np.nan)
    ordered = np.sort(np.where(np.isfinite(rows), rows, np.nan), -1)
    count = np.isfinite(ordered).sum(-1)
    middle = np.stack([np.maximum(count - 1, 0) // 2, np.minimum(count // 2, rows.shape[-1] - 1)], -1)
    return np.asarray(np.take_along_axis(ordered, middle, -1).mean(-1))


class Loss(Protocol):
    """How residuals (M,) of standard uncertainty ``sigma`` (M,) count."""

    def weight(self, residual: Float, sigma: Float) -> Float:
        """Return the weights (M,), 1 / unit²."""

    def cost(self, residual: Float, sigma: Float) -> Float:
        """Return the costs (M,): half the squared residual in σ where the residual is small."""


@dataclass(frozen=True)
class Squares:
    """Plain least squares."""

    def weight(self, residual: Float, sigma: Float) -> Float:
        """Return 1/σ²."""
        return sigma**-2.0 + 0 * residual

    def cost(self, residual: Float, sigma: Float) -> Float:
        """Return half the squared residual in σ."""
        return np.asarray(0.5 * (residual / sigma) ** 2)


@dataclass(frozen=True)
class Cauchy:
    """Residuals far beyond ``scale`` σ pull ever less, but never quite nothing."""

    scale: float = 2.5

    def weight(self, residual: Float, sigma: Float) -> Float:
        """Return the weights (M,)."""
        return np.asarray(1 / (1 + (residual / (self.scale * sigma)) ** 2) / sigma**2)

    def cost(self, residual: Float, sigma: Float) -> Float:
        """Return the costs (M,)."""
        return np.asarray(0.5 * self.scale**2 * np.log1p((residual / (self.scale * sigma)) ** 2))


@dataclass(frozen=True)
class GemanMcClure:
    """Residuals far beyond ``scale_mm``, one number for all, hardly pull at all."""

    scale_mm: float

    def weight(self, residual: Float, sigma: Float) -> Float:
        """Return the weights (M,)."""
        return np.asarray(1 / (1 + (residual / self.scale_mm) ** 2) ** 2 / sigma**2)

    def cost(self, residual: Float, sigma: Float) -> Float:
        """Return the costs (M,)."""
        square = (residual / self.scale_mm) ** 2
        return np.asarray(0.5 * (self.scale_mm / sigma) ** 2 * square / (1 + square))
