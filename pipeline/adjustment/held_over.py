"""Light that a codec holds over from picture to picture, told by the finest structure of the laser line.

Speckle, shot noise and texture finer than the way between two rings are another in every ring. Where they
are the same at the same place of the image, a codec showed the old light again: such rings share their
errors, so that neither their scatter nor their number tells how sure they are. The wall's own shape does not
come into it: it is wider than what is compared.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import uniform_filter1d

from pipeline.adjustment.robust import robust_spread
from pipeline.arrays import Float, Int

# Samples of the running mean that is taken out: what is left is 1 mm long in a pipe of 100 mm with 1440
# samples. The rings of open-1 and open-3, 1.2 and 0.5 mm apart, are alike by 0.05 and 0.16 in it.
_FINE = 5
# Farther apart than so many samples, places of the wall share nothing of it.
_APART = 2.0
# Values are cut off at so many spreads, and known in most of the running mean.
_MOST, _KNOWN = 4.0, 0.8
# Rings apart that are compared, and pairs of them on long runs.
_LAGS, _PAIRS = 16, 400
# What is less alike counts as new: σ from the scatter of such rings is too small by 1 − √(1 − 0.1) = 5 %.
_NOTHING = 0.1


@dataclass(frozen=True)
class HeldOver:
    """How alike (L,) rings 0, 1, 2, ... apart are: 1 where nothing is new, 0 where all is."""

    likeness: Float

    @property
    def rings(self) -> int:
        """How many rings apart next to nothing is shared; as far as was looked, where there are none."""
        below = self.likeness <= _NOTHING
        return int(np.argmax(below)) if below.any() else len(self.likeness) - 1

    def independent(self, count: int) -> int:
        """Return by how many rings that share nothing so many in a row are outweighed, rounded.

        The variance of their mean is Σ_ij ρ_(i−j) / n² of one's. Next to nothing shared counts as nothing.
        """
        apart = np.arange(1, min(len(self.likeness), count))
        shared = np.where(self.likeness > _NOTHING, self.likeness, 0.0)[apart]
        return round(count / (1 + 2 * float(shared @ (1 - apart / count)))) if count > 1 else count

    def gain_in_mean(self, width: float) -> float:
        """Return how many times the σ of a Gaussian mean over ``width`` ring spacings is that of other rings.

        The variance of Σ w_i x_i is Σ_k ρ_k Σ_i w_i w_(i+k), and a Gaussian's Σ_i w_i w_(i+k) falls off as
        exp(−k² / 4 w²).
        """
        apart = np.arange(1, len(self.likeness))
        shared = np.exp(-((apart / (2 * width)) ** 2))
        return float(np.sqrt(1 + 2 * self.likeness[1:] @ shared))


NOTHING_HELD = HeldOver(np.ones(1))
"""Of rings that share nothing."""


def held_over(structures: Sequence[Float], distance_mm: Float, sample_mm: float) -> HeldOver:
    """Return how alike rings are in values (F, A) of their samples, NaN where unknown.

    ``distance_mm`` (F,) is how far along the pipe each ring lies: where the probe stands, rings are alike
    because the wall is. ``sample_mm`` lies between two samples of a ring.
    """
    fine = [_fine(values) for values in structures]
    likeness = [1.0]
    for lag in range(1, min(_LAGS, len(distance_mm) - 1) + 1):
        way = np.abs(distance_mm[lag:] - distance_mm[:-lag])
        first = np.flatnonzero(way > _APART * sample_mm)
        some = first[:: max(len(first) // _PAIRS, 1)]
        likeness.append(min(max(_likeness(fine, some, lag), 0.0), likeness[-1]))
    return HeldOver(np.array(likeness))


def _likeness(fine: Sequence[Float], first: Int, lag: int) -> float:
    """Return the correlation of rings ``first`` (n,) with those so many later, 0 where there is none."""
    together, apart = 0.0, 0.0
    for values in fine:
        a, b = values[first], values[first + lag]
        known = np.isfinite(a) & np.isfinite(b)
        together += float((a * b)[known].sum())
        apart += float((a * a + b * b)[known].sum()) / 2
    return together / apart if apart > 0 else 0.0


def _fine(values: Float) -> Float:
    """Return what values (F, A) have beyond their running mean around the ring, in spreads of it."""
    known = np.isfinite(values)
    share = uniform_filter1d(known.astype(float), _FINE, axis=1, mode="wrap")
    mean = uniform_filter1d(np.where(known, values, 0.0), _FINE, axis=1, mode="wrap")
    fine = np.where(known & (share > _KNOWN), values - mean / np.maximum(share, 1e-9), np.nan)
    spread = robust_spread(fine[np.isfinite(fine)]) if np.isfinite(fine).any() else 1.0
    return np.asarray(np.clip(fine / max(spread, 1e-12), -_MOST, _MOST))
