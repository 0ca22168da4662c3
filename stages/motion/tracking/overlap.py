"""The correlation of two whole strips at every shift, and walls whose texture repeats along the pipe.

On a printed pattern or a corrugated wall, patches match as well one period farther on. All of them do, so
that they agree on a wrong step. What else is on the wall decides: whole strips correlate best at the true
shift (D. Padfield, "Masked object registration in the Fourier domain", 2012).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, irfft2, rfft, rfft2
from scipy.ndimage import maximum_filter1d

from pipeline.arrays import Bool, Float, Float32, Int
from stages.motion.tracking.strips import Strip

Spectrum = NDArray[np.complex64]

MOST_RIVAL = 0.75
"""Correlation, as a share of the best, from which another shift makes the best one doubtful. With it, all of
422 wrong pairs of equal welds were rejected (`python -m tests.benchmarks.bench_loops OUT`)."""
_LEAST_OVERLAP = 0.3
"""Share of the usable samples of the poorer strip that must be usable in both."""
_REPEATS = 0.3
"""Correlation of a strip with itself farther on, from which its wall may repeat (chosen): it was 0.4 to 0.6
on enamel with printed dots, below 0.15 on painted steel. It only decides whether shifts are compared."""
_FEWEST_ROWS = 32
"""Rows two strips must have in common to be correlated as a whole: one patch and a half. Not measured."""
_LEAST_RESPONSE = 0.05
"""Peak of the phase correlation below which two strips are taken for unrelated. Not measured."""
_NEAR = 2
"""Shifts by up to so many steps of two samples beside one belong to the same peak."""


@dataclass(frozen=True)
class StoredStrip:
    """The stored part of a strip: its first row and its contrast (H, W), NaN where unusable."""

    first_row: int
    contrast: Float32

    @property
    def usable(self) -> Bool:
        """Return where (H, W) the wall is seen."""
        return np.isfinite(self.contrast)

    @staticmethod
    def of(strip: Strip) -> StoredStrip:
        """Return the stored part of a strip."""
        return StoredStrip(strip.first_row, np.where(strip.usable, strip.contrast, np.float32(np.nan)))


@dataclass(frozen=True)
class Overlap:
    """Normalised correlation of two strips; 0 where little overlaps.

    Attributes
    ----------
    height : (H, W/2) float32
    row, column : (H, 1), (1, W/2) int
        Strip samples by which the wall lies farther in the later strip.
    """

    height: Float32
    row: Int
    column: Int

    @staticmethod
    def of(earlier: StoredStrip, later: StoredStrip) -> Overlap:
        """Correlate two strips at all shifts by two samples."""
        a, b = _Halved.of(earlier), _Halved.of(later)
        size = (2 * len(a.value), a.value.shape[1])
        first, second = ([rfft2(x, size) for x in half.parts] for half in (a, b))
        height = _normalised(
            [irfft2(np.conj(f) * s, size) for f, s in _factors(first, second)], a.least_common(b)
        )
        row = later.first_row - earlier.first_row + _shifts(len(height))
        return Overlap(height, row[:, None], _shifts(size[1])[None])


def along(earlier: StoredStrip, later: StoredStrip, most_turned: int) -> tuple[Float, Float]:
    """Return all shifts along the pipe (H,), and the best correlation there at a turn up to so many.

    Only these few turns are computed: a tenth of the arithmetic of `Overlap.of`.
    """
    a, b = _Halved.of(earlier), _Halved.of(later)
    turns, size = most_turned // 2, 2 * len(a.value)
    first = second = [rfft(x.T, size) for x in a.parts]
    if later is not earlier:
        second = [rfft(x.T, size) for x in b.parts]
    products = [_summed_around(f, s, turns) for f, s in _factors(first, second)]
    height = _normalised([irfft(p, size) for p in products], a.least_common(b)).max(0)
    row = later.first_row - earlier.first_row + _shifts(size)
    order = np.argsort(row, kind="stable")
    return row[order].astype(float), height[order].astype(float)


@dataclass(frozen=True)
class Rival:
    """Another shift along the pipe, strip samples, and its correlation as a share of the found one's."""

    shift: float
    share: float

    @property
    def fits_better(self) -> bool:
        """Whether it fits so much better that the found one is wrong."""
        return self.share * MOST_RIVAL > 1

    @property
    def fits_as_well(self) -> bool:
        """Whether the strips cannot tell the two apart."""
        return not self.fits_better and self.share > MOST_RIVAL


def repeats(strip: Strip, apart: int) -> bool:
    """Return whether a strip resembles itself farther along the pipe than ``apart``, strip samples."""
    stored = StoredStrip.of(strip)
    return _rival(*along(stored, stored, apart), 0.0, apart).share > _REPEATS


def rival_of(found: float, before: Strip, now: Strip, apart: int) -> Rival:
    """Return the best shift of two strips that is farther than ``apart`` from the one that was found."""
    return _rival(*along(StoredStrip.of(before), StoredStrip.of(now), apart), found, apart)


def displacement(before: Strip, now: Strip) -> Float:
    """Return rows and columns (2,) from where ``before`` has the wall to where ``now`` has it, or 0."""
    lag = now.first_row - before.first_row
    rows = before.contrast.shape[0] - abs(lag)
    if rows < _FEWEST_ROWS:
        return np.zeros(2)
    a = before.contrast[max(lag, 0) : max(lag, 0) + rows]
    b = now.contrast[max(-lag, 0) : max(-lag, 0) + rows]
    size = (a.shape[1] // 2, a.shape[0] // 2)
    halves = [cv2.resize(np.clip(x, -1, 1), size, interpolation=cv2.INTER_AREA) for x in (a, b)]
    window = np.broadcast_to(np.hanning(halves[0].shape[0])[:, None], halves[0].shape)
    (dx, dy), response = cv2.phaseCorrelate(*(np.asarray(h * window, np.float32) for h in halves))
    return np.array([2 * dy, 2 * dx]) if response > _LEAST_RESPONSE else np.zeros(2)


def _rival(shift: Float, height: Float, found: float, apart: int) -> Rival:
    here = height[np.abs(shift - found) <= 2 * _NEAR].max(initial=1e-9)
    crest = height >= maximum_filter1d(height, 2 * _NEAR + 1)
    elsewhere = np.where(crest & (np.abs(shift - found) > apart), height, 0.0)
    best = int(np.argmax(elsewhere))
    return Rival(float(shift[best]), float(elsewhere[best] / here))


@dataclass(frozen=True)
class _Halved:
    """A strip's contrast and usability (H/2, W/2), without structures that run all along the pipe.

    A seam or a streak has no information on distance and would fit everywhere.
    """

    value: Float32
    seen: Float32

    @staticmethod
    def of(strip: StoredStrip) -> _Halved:
        seen = strip.usable
        value = np.where(seen, np.clip(np.nan_to_num(strip.contrast), -1, 1), 0).astype(np.float32)
        value -= (value.sum(0) / np.maximum(seen.sum(0), 1)).astype(np.float32)
        size = (value.shape[1] // 2, value.shape[0] // 2)
        parts = (np.where(seen, value, 0).astype(np.float32), seen.astype(np.float32))
        a, b = (cv2.resize(x, size, interpolation=cv2.INTER_AREA) for x in parts)
        return _Halved(np.asarray(a, np.float32), np.asarray(b, np.float32))

    @property
    def parts(self) -> tuple[Float32, Float32, Float32]:
        """Return contrast, its square, and usability."""
        return self.value, self.value * self.value, self.seen

    def least_common(self, other: _Halved) -> float:
        """Return how many usable samples two strips must have in common to be compared."""
        return _LEAST_OVERLAP * min(float(self.seen.sum()), float(other.seen.sum()))


def _factors(first: list[Spectrum], second: list[Spectrum]) -> list[tuple[Spectrum, Spectrum]]:
    """Return the spectra whose products are those of the contrasts, the powers and the common samples."""
    (a, a2, seen_a), (b, b2, seen_b) = first, second
    return [(a, b), (a2, seen_b), (seen_a, b2), (seen_a, seen_b)]


def _summed_around(first: Spectrum, second: Spectrum, turns: int) -> Spectrum:
    """Return cross-spectra along the pipe (2 turns + 1, F) of columns (W, F), the second ones turned."""
    wide = np.concatenate([second[len(second) - turns :], second, second[:turns]])
    back = np.conj(first)
    return np.stack([(back * wide[k : k + len(back)]).sum(0) for k in range(2 * turns + 1)])


def _normalised(products: list[Float32], least: float) -> Float32:
    """Return the correlation by products, powers and the number of common samples; 0 below the ``least``."""
    product, power_a, power_b, common = products
    scale = np.sqrt(np.maximum(power_a * power_b, 1e-12))
    return np.asarray(np.where(common > least, product / scale, 0.0), np.float32)


def _shifts(count: int) -> Int:
    """Return the shifts (count,) of halved strips in the order of a Fourier transform, strip samples."""
    return np.asarray(2 * ((np.arange(count) + count // 2) % count - count // 2))
