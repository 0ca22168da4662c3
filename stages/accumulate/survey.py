"""A first look at every ring: where it lies, and by how much its pose puts it off the pipe's axis."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Bool, Float, Int
from stages.accumulate.centring import first_harmonic, slow
from stages.accumulate.samples import RingsOnWall, WallSamples

_AT_ONCE = 512


@dataclass(frozen=True)
class RingSurvey:
    """What is known of each ring (F,) without holding its samples.

    Attributes
    ----------
    shift_mm : (F, 2)
        By how much it lies off the axis, to be taken out.
    nearest_mm, middle_mm, farthest_mm : (F,)
        Least, median and largest distance of its samples; NaN where it has none.
    seen : (F,)
        Share of the circle that it shows.
    count : (F,) int
        Its valid samples.
    """

    shift_mm: Float
    nearest_mm: Float
    middle_mm: Float
    farthest_mm: Float
    seen: Float
    count: Int

    def near(self, first_mm: float, last_mm: float) -> Int:
        """Return the rings (n,), in the order of frames, that reach between two distances."""
        known = self.count > 0
        return np.flatnonzero(known & (self.farthest_mm >= first_mm) & (self.nearest_mm <= last_mm))


def survey_of(rings: RingsOnWall) -> RingSurvey:
    """Look at all rings, some at a time."""
    every, azimuths = np.arange(len(rings.rings.frame)), len(rings.rings.azimuth_rad)
    parts = [_of(rings.samples(rows)) for rows in some_at_a_time(every)]
    harmonic, nearest, middle, farthest, count = (np.concatenate(p) for p in zip(*parts, strict=True))
    share = count / azimuths
    return RingSurvey(slow(harmonic), nearest, middle, farthest, share, count.astype(np.int64))


def some_at_a_time(rows: Int) -> Iterator[Int]:
    """Yield rows in batches that memory bears."""
    for start in range(0, len(rows), _AT_ONCE):
        yield rows[start : start + _AT_ONCE]


def _of(samples: WallSamples) -> tuple[Float, ...]:
    s, any_seen = np.where(samples.valid, samples.distance_mm, np.nan), np.asarray(samples.valid.any(1))
    return (
        first_harmonic(samples), *(_over(f, s, any_seen) for f in (np.nanmin, np.nanmedian, np.nanmax)),
        samples.valid.sum(1).astype(float),
    )  # fmt: skip


def _over(summary: Callable[..., Float], s: Float, any_seen: Bool) -> Float:
    out = np.full(len(s), np.nan)
    out[any_seen] = summary(s[any_seen], axis=1)
    return out
