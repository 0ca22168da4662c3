"""Robust spread of residuals, and robust losses: the weight of an equation and the cost that goes with it.

The cost of a loss ρ is what its weight minimises when the equations are solved anew: w = ρ′(r) / r.
P. Huber, "Robust statistics", 1981, § 7.8; S. Geman, D. McClure, "Statistical methods for tomographic image
reconstruction", 1987.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pipeline.arrays import Float, Float32

MAD_TO_SIGMA = 1.4826
"""1/Φ⁻¹(3/4): half of all normal errors are smaller than Φ⁻¹(3/4) σ = 0.67449 σ (Huber 1981, § 5.1)."""


def robust_spread(residual: Float | Float32) -> float:
    """Return 1 σ of residuals of any shape about zero, from their median size; NaN entries do not count."""
    size = np.abs(residual)
    middle = np.nanmedian(size) if np.isnan(size).any() else np.median(size)
    return MAD_TO_SIGMA * float(middle)


def robust_spreads(residual: Float | Float32, axis: int) -> Float:
    """Return 1 σ about zero along ``axis``, from the median size; NaN entries do not count."""
    size = np.abs(residual)
    middle = np.nanmedian(size, axis) if np.isnan(size).any() else np.median(size, axis)
    return np.asarray(MAD_TO_SIGMA * middle)


def spread_about_median(values: Float | Float32) -> float:
    """Return 1 σ of values about their median: 1.4826 times the median absolute deviation."""
    return robust_spread(values - np.median(values))


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
