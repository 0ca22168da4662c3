"""Measures light that a codec carries over from picture to picture, by the laser line's finest structure.

Speckle, shot noise and texture finer than the distance of two rings differ in every ring. If they are the
same at the same place of the image, a codec has repeated old light: such rings share their errors, so that
neither their scatter nor their number shows their uncertainty. Pixels, their colour mosaic and blocks of a
codec make rings alike, too, where the line hardly moves in the image. Those errors depend on how far it
moved and not on how much later: rings far apart show them alone, and what nearer ones share beyond that is
repeated light. The wall's own shape has no influence, because it is wider than the compared structure.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import uniform_filter1d

from pipeline.adjustment.robust import robust_spread
from pipeline.adjustment.shared_light import HeldOver
from pipeline.arrays import Float, Int

# Samples of the running mean that is subtracted: structure shorter than about 1 mm is left, in a pipe of 100
# mm with 1440 samples. Rings of open-1 and open-3, 1.2 and 0.5 mm apart, correlate by 0.05 and 0.16 in it.
_FINE = 5
# Rings farther apart along the pipe than so many samples show other wall, which has none of this structure.
_APART = 2.0
# Values are clipped at so many spreads; they count where this share of the running mean's samples is known.
_MOST, _KNOWN = 4.0, 0.8
# Largest lag, in rings, that is compared, and about how many pairs of rings for each lag on long runs. Rings
# up to as much farther apart are taken to share nothing but places of the image.
_LAGS, _PAIRS = 16, 400
# Movements of the line in the image, px, that are told apart. Errors fixed to the image end within 1 to 2 px
# in open-1, 2 and 3, at crf 18 to 30, and in 8 inspections drawn by another renderer.
_MOVED_PX = np.array([0.0, 0.05, 0.1, 0.2, 0.3, 0.5, 0.75, 1.0, 1.5, 2.5, np.inf])
# Values from which on, with some 1000 independent ones among them, a correlation errs by .03 at most.
_FEWEST = 3000
# Repeated light is a share of what is not fixed to the image; its error grows no more than to the double.
_LEAST_FREE = 0.5


def held_over(
    structures: Sequence[Float], distance_mm: Float, sample_mm: float, place_px: Float | None = None
) -> HeldOver:
    """Return the correlation of rings in values (F, A) of their samples, NaN where unknown, by their lag.

    ``distance_mm`` (F,) is the distance of each ring along the pipe: if the probe stands, rings are equal
    because the wall is the same. ``sample_mm`` is the spacing of a ring's samples, ``place_px`` (F, A) is
    where the line lies in the image, across itself. Without it, or with too few rings, errors fixed to the
    image are not told apart from repeated light.
    """
    place = np.full(structures[0].shape, np.nan) if place_px is None else _smooth(place_px)
    rings = _Rings([_fine(values) for values in structures], place, distance_mm, _APART * sample_mm)
    near, far = rings.compared(1, _LAGS), rings.compared(_LAGS + 1, 2 * _LAGS)
    likeness = np.array([1.0, *(max(_ratio(of.together.sum(), of.power.sum()), 0.0) for of in near)])
    fixed = _fixed(far)
    if not fixed.any():
        return HeldOver(likeness)
    by_place = np.array([_ratio(float(fixed @ of.power), of.power.sum()) for of in near])
    repeated = (likeness[1:] - by_place) / max(1 - float(fixed.max()), _LEAST_FREE)
    return HeldOver(likeness, np.array([1.0, *repeated.clip(0.0, 1.0)]))


@dataclass(frozen=True)
class _Compared:
    """Number, Σ ab and Σ (a² + b²) / 2 of pairs of values, (K,) by the movement of the line between them.

    The last of the K are those of unknown movement.
    """

    count: Int
    together: Float
    power: Float


@dataclass(frozen=True)
class _Rings:
    """Fine structures (F, A) of rings, the line's place in the image, and distances along the pipe (F,)."""

    fine: Sequence[Float]
    place_px: Float
    distance_mm: Float
    apart_mm: float

    def compared(self, first: int, last: int) -> list[_Compared]:
        """Return the comparison of rings at each lag that the run has, those of the same wall left out."""
        return [self._compared(lag) for lag in range(first, min(last, len(self.distance_mm) - 1) + 1)]

    def _compared(self, lag: int) -> _Compared:
        way = np.abs(self.distance_mm[lag:] - self.distance_mm[:-lag])
        first = np.flatnonzero(way > self.apart_mm)
        some = first[:: max(len(first) // _PAIRS, 1)]
        moved = np.abs(self.place_px[some + lag] - self.place_px[some])
        bins = len(_MOVED_PX)
        bin_of = np.where(np.isfinite(moved), np.searchsorted(_MOVED_PX, moved, "right") - 1, bins - 1)
        count, together, power = np.zeros(bins, np.int64), np.zeros(bins), np.zeros(bins)
        for values in self.fine:
            a, b = values[some], values[some + lag]
            known = np.isfinite(a) & np.isfinite(b)
            a, b, where = a[known], b[known], bin_of[known]
            count += np.bincount(where, minlength=bins)
            together += np.bincount(where, a * b, bins)
            power += np.bincount(where, (a * a + b * b) / 2, bins)
        return _Compared(count, together, power)


def _fixed(far: Sequence[_Compared]) -> Float:
    """Return what rings far apart in time share (K,), by the movement of the line; 0 where it is unknown.

    It falls with the movement, so that too few values of a small one are bounded by those of a larger one.
    """
    count, together, power = (
        np.sum([getattr(of, name) for of in far], axis=0) if far else np.zeros(len(_MOVED_PX))
        for name in ("count", "together", "power")
    )
    shared = np.where(count >= _FEWEST, np.maximum(together, 0.0) / np.maximum(power, 1e-12), 0.0)
    return np.append(np.maximum.accumulate(shared[-2::-1])[::-1], 0.0)


def _ratio(together: float, power: float) -> float:
    """Return a correlation, 0 if unknown."""
    return together / power if power > 0 else 0.0


def _fine(values: Float) -> Float:
    """Return values (F, A) minus their running mean around the ring, over the spread of that difference."""
    fine = values - _smooth(values)
    spread = robust_spread(fine[np.isfinite(fine)]) if np.isfinite(fine).any() else 1.0
    return np.asarray(np.clip(fine / max(spread, 1e-12), -_MOST, _MOST))


def _smooth(values: Float) -> Float:
    """Return the running mean of values (F, A) around the ring, NaN where too few are known.

    Noise of the line's place that is the fine structure itself would make alike what seems not to have moved.
    """
    known = np.isfinite(values)
    share = uniform_filter1d(known.astype(float), _FINE, axis=1, mode="wrap")
    mean = uniform_filter1d(np.where(known, values, 0.0), _FINE, axis=1, mode="wrap")
    return np.where(known & (share > _KNOWN), mean / np.maximum(share, 1e-9), np.nan)
