"""Pictures whose loss leaves the rhythm of the lights whole: the wall then moves too far at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from pipeline.arrays import Bool, Float, Int
from pipeline.recording.base import Encoder, FrameTable
from stages.premises.light import Light
from stages.premises.pictures import Pictures

# A step of the wall stands out when it is so many robust σ above the steps around it: by noise alone once in
# 10^9 steps, were they normal; matching errs worse than that, and six is what outliers need everywhere here.
_SIGMAS = 6.0
# Where the table has rows too many, some pictures were lost: the likeliest places are as good as any.
_SIGMAS_LOST = 3.5
# Nine in ten of normal errors are smaller than so many σ; from them, since matching's are not normal.
_NINE_IN_TEN = 1.645
# Steps on either side from which the usual speed is taken.
_AROUND = 9
_LEAST_STEPS = 12
# The encoder is asked within so many frames whether the probe itself leapt.
_NEARBY = 10


@dataclass(frozen=True)
class Steps:
    """Motion of the lit wall from picture ``start`` to ``end`` (K,): ``size`` in pipe radii."""

    start: Int
    end: Int
    size: Float


def steps_of_wall(pictures: Pictures, light: Int) -> Steps:
    """Return the steps between pictures that both show the lit wall; all there are where light is unknown."""
    known = bool(np.any(light != Light.UNKNOWN))
    end = np.flatnonzero(pictures.partner >= 0)
    start = pictures.partner[end]
    use = ((light[end] == Light.WALL) & (light[start] == Light.WALL)) | np.full(len(end), not known)
    use &= np.isfinite(pictures.step[end])
    return Steps(start[use], end[use], pictures.step[end[use]])


def row_times(table: FrameTable, row: Int) -> Float:
    """Return the time of each row; rows beyond the table go on at its usual pace."""
    usual = float(np.median(np.diff(table.time_s))) if len(table.time_s) > 1 else 0.0
    beyond = np.maximum(row - (len(table.time_s) - 1), 0)
    return np.asarray(table.time_s[np.minimum(row, len(table.time_s) - 1)] + beyond * usual)


def rows_by_motion(row: Int, steps: Steps, rhythm: int, table: FrameTable, encoder: Encoder | None) -> Int:
    """Return ``row`` (F,) with more or fewer rows skipped where the wall moves by more or less than usual.

    The lights fix the number of lost pictures but for whole rhythms of theirs; the motion of the wall, at the
    usual speed of the steps around, counts these. A leap that the encoder shows too is the probe's own.
    """
    if len(steps.end) < _LEAST_STEPS:
        return row
    time = row_times(table, row)
    period = float(np.median(np.diff(time)))
    out, left = row.copy(), len(table.frame) - 1 - int(row[-1])
    for start, end, lost in _leaps(steps, time, rhythm, _SIGMAS_LOST if left > 0 else _SIGMAS):
        skips = np.diff(row[start : end + 1]) - 1
        believed = left >= lost or _encoder_was_steady(encoder, float(time[end]), period)
        if (lost > 0 and believed) or (lost < 0 and skips.max() + lost >= 0):
            first = int(np.argmax(skips)) + start + 1 if skips.max() > 0 else (start + end + 1) // 2
            out[first:] += lost
            left -= lost
    return out


def _leaps(steps: Steps, time_s: Float, rhythm: int, sigmas: float) -> list[tuple[int, int, int]]:
    """Return (start, end, pictures lost in whole rhythms) of the steps that stand out, the clearest first."""
    period_s = float(np.median(np.diff(time_s)))
    passed = np.maximum(time_s[steps.end] - time_s[steps.start], 1e-9)
    speed = median_filter(steps.size / passed, _AROUND, mode="nearest")
    excess = (steps.size - speed * passed) * np.sign(speed)
    sigma = float(np.quantile(np.abs(excess), 0.9)) / _NINE_IN_TEN + 1e-9
    one = np.maximum(np.abs(speed) * period_s * rhythm, 1e-9)
    lost = rhythm * np.rint(excess / one).astype(np.int64)
    stand_out = (np.abs(excess) > sigmas * sigma) & (lost != 0) & (one > sigmas * sigma / 2)
    clearest = sorted(np.flatnonzero(stand_out), key=lambda k: -abs(float(excess[k])))
    return [(int(steps.start[k]), int(steps.end[k]), int(lost[k])) for k in clearest]


def _encoder_was_steady(encoder: Encoder | None, time_s: float, period_s: float) -> bool:
    """Return whether the encoder goes on evenly about a time; False without one."""
    if encoder is None or not encoder.time_s[0] < time_s < encoder.time_s[-1]:
        return False
    at = time_s + period_s * np.arange(-_NEARBY, _NEARBY + 1)
    step = np.abs(np.diff(np.interp(at, encoder.time_s, encoder.distance_mm)))
    return bool(step.max() < 2 * np.median(step))


def rhythm_of(light: Int) -> int:
    """Return after how many pictures the lights repeat, 1 where they are not told apart."""
    if not np.any(light != Light.UNKNOWN):
        return 1
    agree = [float((light[p:] == light[:-p]).mean()) for p in range(1, min(13, len(light)))]
    return 1 + next((k for k, a in enumerate(agree) if a >= max(agree) - 0.05), 0)


def repeated(pictures: Pictures, light: Int) -> Bool:
    """Return (F,) true for pictures that differ from the one before by a quarter of what is usual at most."""
    follows = pictures.partner == np.arange(len(light)) - 1
    out = np.zeros(len(light), bool)
    for kind in (Light.LINE, Light.WALL):
        like = light == kind
        compared = like & (pictures.partner >= 0)
        if compared.any():
            out |= like & follows & (pictures.change < 0.25 * np.median(pictures.change[compared]))
    return out
