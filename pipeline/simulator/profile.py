"""Light across the laser sheet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import exponnorm

from pipeline.arrays import Float

_LARGEST_SKEWNESS = 1.9


@dataclass(frozen=True)
class LineProfile:
    """Density of light over the height above the sheet, forward positive; its mean is at height 0.

    Attributes
    ----------
    sigma_mm : float
        1 σ.
    skewness : float
        Of the sheet itself, −1.9 to 1.9: a normal and an exponential added (exponentially modified Gaussian).
    transport_mm : float
        Mean way of a one-sided exponential tail that the wall's material adds; it moves the mean.
    copy_relative, copy_mm : float
        Height of a faint copy over that of the line, and its distance.
    """

    sigma_mm: float = 0.15
    skewness: float = 0.0
    transport_mm: float = 0.0
    copy_relative: float = 0.0
    copy_mm: float = 0.0

    def density(self, height_mm: Float) -> Float:
        """Return the density (...), 1/mm, at heights (...)."""
        line = self._line(np.asarray(height_mm, float))
        if not self.copy_relative:
            return line
        return line + self.copy_relative * self._line(np.asarray(height_mm, float) - self.copy_mm)

    def reach_mm(self) -> tuple[float, float]:
        """Return heights outside which the density is below 10⁻⁶ of the peak."""
        tail = 16 * abs(self._exponential_mm())
        low = -5.4 * self.sigma_mm - (tail if self.skewness < 0 else 0.0)
        high = 5.4 * self.sigma_mm + (tail if self.skewness > 0 else 0.0) + 16 * self.transport_mm
        moved = self.copy_mm if self.copy_relative else 0.0
        return low + min(moved, 0.0), high + max(moved, 0.0)

    def _exponential_mm(self) -> float:
        """Return the mean of the exponential part: skewness = 2 (τ/σ)³."""
        skewness = float(np.clip(self.skewness, -_LARGEST_SKEWNESS, _LARGEST_SKEWNESS))
        return float(np.cbrt(skewness / 2) * self.sigma_mm)

    def _line(self, height_mm: Float) -> Float:
        own = self._own(height_mm)
        if not self.transport_mm:
            return own
        node, weight = np.polynomial.laguerre.laggauss(24)
        parts = (w * self._own(height_mm - n * self.transport_mm) for n, w in zip(node, weight, strict=True))
        return np.asarray(sum(parts))

    def _own(self, height_mm: Float) -> Float:
        tau = self._exponential_mm()
        if abs(tau) < 1e-3 * self.sigma_mm:
            return np.asarray(
                np.exp(-0.5 * (height_mm / self.sigma_mm) ** 2) / (self.sigma_mm * np.sqrt(2 * np.pi))
            )
        normal = float(np.sqrt(self.sigma_mm**2 - tau**2))
        signed = np.sign(tau) * height_mm
        return np.asarray(exponnorm.pdf(signed, abs(tau) / normal, loc=-abs(tau), scale=normal))
