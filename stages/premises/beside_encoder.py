"""Checks whether the encoder also shows a faster probe for a moment: then no pictures were lost there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from pipeline.arrays import Float
from pipeline.recording.base import Encoder
from stages.premises.moving import usual_speed

# Shifts of the encoder's clock, in pictures, over which the encoder must be steady: after losses that were
# not found, its clock is off by as many pictures (chosen: a third of a second at 30 pictures a second).
_SHIFTS = np.arange(-10, 11)
# The usual speed is the median over nine steps, as for the wall, and over at least five changes of the count,
# so that more than half of them lie outside of the step that is examined.
_STEPS, _COUNTS = 9, 5


@dataclass(frozen=True)
class Pace:
    """An encoder's distance over time, and its usual speed.

    Attributes
    ----------
    time_s, distance : (N,)
        Time and distance midway between two readings that differ, and those at both ends. At such a change
        the distance is known to within the time between two readings, however coarse the count; between
        changes it is not.
    grid_s, usual : (M,)
        Times, and the usual advance per picture there, including the jitter of a standing encoder.
    period_s, least : float
        Time from picture to picture, and the smallest advance in that time of an encoder that moves.
    """

    time_s: Float
    distance: Float
    grid_s: Float
    usual: Float
    period_s: float
    least: float

    @classmethod
    def of(cls, encoder: Encoder | None, pictures_s: Float, step_pictures: float) -> Pace | None:
        """Return the pace of an encoder over the times of pictures (F,), s.

        ``step_pictures`` is the usual number of pictures in a step. None without an encoder, or if it
        stands or changes too seldom.
        """
        period_s = float(np.median(np.diff(pictures_s)))
        k = np.empty(0, np.int64) if encoder is None else np.flatnonzero(np.diff(encoder.distance_mm))
        if encoder is None or len(k) < _COUNTS:
            return None
        time_s, mm = (
            np.concatenate([v[:1], (v[k] + v[k + 1]) / 2, v[-1:]])
            for v in (encoder.time_s, encoder.distance_mm)
        )
        # One reading may have a wild time.
        beside_s = float(np.ptp(pictures_s)) + _SHIFTS[-1] * period_s
        first_s, last_s = pictures_s[0] - beside_s, pictures_s[-1] + beside_s
        grid_s = np.arange(max(time_s[0], first_s), min(time_s[-1], last_s), period_s)
        speed = np.diff(np.interp(grid_s, time_s, mm))
        steady = np.abs(usual_speed(speed))
        if len(speed) < _STEPS or not steady.any():
            return None
        slow = _COUNTS * float(np.median(np.diff(time_s))) / period_s
        usual = median_filter(speed, 2 * round(max(_STEPS * step_pictures, slow) / 2) + 1, mode="nearest")
        least = float(steady[steady > 0].min())
        return cls(time_s, mm, grid_s[1:] - period_s / 2, usual, period_s, least)

    def excess(self, begin_s: float, end_s: float) -> Float:
        """Return by how many pictures (21,) more than usual the encoder advances from one time to another.

        There is a value for each assumed shift of its clock, the first one without a shift. The distance is
        taken between the changes of the count that enclose the times, so that a slow or coarse count is
        compared over as long as it needs. NaN where no changes enclose the times, infinite where the encoder
        stands or turns back.
        """
        shifts_s = self.period_s * np.r_[0, _SHIFTS[_SHIFTS != 0]]
        sense = float(np.sign(np.interp((begin_s + end_s) / 2, self.grid_s, self.usual)))
        return np.array([self._excess(begin_s + s, end_s + s, sense) for s in shifts_s])

    def _excess(self, begin_s: float, end_s: float, sense: float) -> float:
        begin = int(np.searchsorted(self.time_s, begin_s, side="right")) - 1
        end = int(np.searchsorted(self.time_s, end_s))
        if begin < 0 or end >= len(self.time_s):
            return float("nan")
        span_s, way = (float(v[end] - v[begin]) for v in (self.time_s, self.distance))
        usual = float(np.interp((self.time_s[begin] + self.time_s[end]) / 2, self.grid_s, self.usual))
        if usual * sense < 0 or sense == 0:
            return float("inf")
        return sense * (way - usual * span_s / self.period_s) / max(abs(usual), self.least)
