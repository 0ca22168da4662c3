"""Measures light that a codec carries over from picture to picture, by the laser line's finest structure.

Speckle, shot noise and texture finer than the distance of two rings differ in every ring. If they are the
same at the same place of the image, a codec has repeated old light: such rings share their errors, so that
neither their scatter nor their number shows their uncertainty. Errors that stay at one place of the image do
the same where the line hardly moves in it; they are not told apart. The wall's own shape has no influence,
because it is wider than the compared structure.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import uniform_filter1d

from pipeline.adjustment.robust import robust_spread
from pipeline.adjustment.shared_light import HeldOver
from pipeline.arrays import Float, Int

# Samples of the running mean that is subtracted: structure shorter than about 1 mm is left, in a pipe of 100
# mm with 1440 samples. Rings of open-1 and open-3, 1.2 and 0.5 mm apart, correlate by 0.05 and 0.16 in it.
_FINE = 5
# Rings farther apart along the pipe than so many samples show other wall, which has none of this structure
# structure.
_APART = 2.0
# Values are clipped at so many spreads; they count where this share of the running mean's samples is known.
_MOST, _KNOWN = 4.0, 0.8
# Largest lag, in rings, that is compared, and about how many pairs of rings for each lag on long runs.
_LAGS, _PAIRS = 16, 400


def held_over(structures: Sequence[Float], distance_mm: Float, sample_mm: float) -> HeldOver:
    """Return the correlation of rings in values (F, A) of their samples, NaN where unknown, by their lag.

    ``distance_mm`` (F,) is the distance of each ring along the pipe: if the probe stands, rings are equal
    because the wall is the same. ``sample_mm`` is the spacing of a ring's samples.
    """
    fine = [_fine(values) for values in structures]
    likeness = [1.0]
    for lag in range(1, min(_LAGS, len(distance_mm) - 1) + 1):
        way = np.abs(distance_mm[lag:] - distance_mm[:-lag])
        first = np.flatnonzero(way > _APART * sample_mm)
        some = first[:: max(len(first) // _PAIRS, 1)]
        likeness.append(min(max(_correlation(fine, some, lag), 0.0), likeness[-1]))
    return HeldOver(np.array(likeness))


def _correlation(fine: Sequence[Float], first: Int, lag: int) -> float:
    """Return the correlation of rings ``first`` (n,) with those ``lag`` later, 0 if unknown."""
    together, apart = 0.0, 0.0
    for values in fine:
        a, b = values[first], values[first + lag]
        known = np.isfinite(a) & np.isfinite(b)
        together += float((a * b)[known].sum())
        apart += float((a * a + b * b)[known].sum()) / 2
    return together / apart if apart > 0 else 0.0


def _fine(values: Float) -> Float:
    """Return values (F, A) minus their running mean around the ring, over the spread of that difference."""
    known = np.isfinite(values)
    share = uniform_filter1d(known.astype(float), _FINE, axis=1, mode="wrap")
    mean = uniform_filter1d(np.where(known, values, 0.0), _FINE, axis=1, mode="wrap")
    fine = np.where(known & (share > _KNOWN), values - mean / np.maximum(share, 1e-9), np.nan)
    spread = robust_spread(fine[np.isfinite(fine)]) if np.isfinite(fine).any() else 1.0
    return np.asarray(np.clip(fine / max(spread, 1e-12), -_MOST, _MOST))
