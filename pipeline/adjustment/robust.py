"""Losses of residuals with their σ: the weight of an equation, and what it costs, which belong together.

The cost of a loss ρ is what its weight minimises when the equations are solved anew: w = ρ′(r) / r.
P. Huber, "Robust statistics", 1981, § 7.8; S. Geman, D. McClure, "Statistical methods for tomographic image
reconstruction", 1987.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pipeline.arrays import Float


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
