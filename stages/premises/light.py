"""Which light each picture was taken in, and lost pictures that the rhythm of the lights does not show."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from scipy.ndimage import maximum_filter1d, median_filter, minimum_filter1d

from pipeline.adjustment.robust import spread_about_median
from pipeline.arrays import Bool, Float, Int
from pipeline.recording.base import Encoder, FrameTable
from stages.premises.pictures import CLOSED, Pictures

# A picture whose brightness lies in the middle third between the two lights belongs to neither.
_MIDDLE = 1 / 3
# Two lights are told apart where they differ by more than this many of their own spreads, and where hardly
# any picture lies between them: a single light that changes slowly would fill the middle.
_APART, _MOST_BETWEEN = 3.0, 0.05
# Two lights differ by at least this part of their brightness (chosen): two runs of open-3 that were joined,
# with one light, differ by 0.01.
_LEAST_APART = 0.05
# Dark pictures are those of the laser only where more than this part of them shows its line.
_MOST_DARK = 0.5
# With fewer pictures in one light, its spread is not known.
_FEWEST_ALIKE = 3
# Brightness of each light is compared within so many frames on both sides, since lamps warm up.
_AROUND = 8
# Both lights are among these frames if their brightness spans at least this part of that in the whole run.
_BOTH_THERE = 0.4
# Longest context (preceding lights) that predicts the next one; share of more errors that a shorter one may
# make.
_LONGEST_MEMORY, _NEARLY = 6, 0.05
# A step of the wall stands out when it is so many robust σ above the steps around it: by noise alone once in
# 10^9 steps, were they normal; matching errs worse than that, and six is what outliers need everywhere here.
_SIGMAS = 6.0
# Where the table has too many rows, pictures were surely lost, and less evidence is needed for where.
_SIGMAS_LOST = 3.5
# 0.9 quantile of normal errors in σ. It gives σ here, because errors of matching are not normal.
_NINE_IN_TEN = 1.645
# Steps on either side from which the usual speed is taken.
_AROUND_STEP = 9
_LEAST_STEPS = 12
# Steps that took more than so many usual times tell nothing of lost pictures: over 32 frames, of which 30
# were left out, phase correlation erred by the advance of 6 frames (open-1-field at half its size).
_LONGEST_STEP = 4.0
# The laser line leaps where it moves across so many times as far as it usually does, of at least half a
# pixel, in the time that would have passed. In open-1 to open-3, a01 and a09 it moves up to 3
# times as far, twice in a run more than 2.5; where all pictures of open-1 were moved by 4 px, 5.4 times.
_LINE_LEAPS, _LEAST_SWAY_PX = 2.5, 0.5
# Two advances agree within this part: steps of the wall err by a tenth, a lost picture makes one 1.5 times as
# long.
_AGREES = 0.25
# The encoder is looked at over so many frames on either side of a leap.
_NEARBY = 10


class Light(IntEnum):
    """What a picture shows."""

    UNKNOWN = -1
    LINE = 0  # dark, with a thin bright closed line
    WALL = 1  # the wall is lit, with or without line


def light_seen(pictures: Pictures) -> Int:
    """Return the `Light` (F,) of every picture; all unknown where the recording has only one light.

    It has only one where its dark pictures show no line. A picture is unknown that cannot be decoded, lies
    between the lights, or is dark without a closed line (a covered lens, a lamp that failed).
    """
    out = np.full(len(pictures.brightness), Light.UNKNOWN, np.int64)
    seen = np.flatnonzero(pictures.seen)
    split = _two_lights(pictures.brightness[seen]) if seen.size else None
    if split is None:
        return out
    height = _height(pictures.brightness[seen], *split)
    dark, closed = height < (1 - _MIDDLE) / 2, pictures.closed[seen] > CLOSED
    if closed[dark].mean() > _MOST_DARK:
        out[seen[height > (1 + _MIDDLE) / 2]] = Light.WALL
        out[seen[dark & closed]] = Light.LINE
    return out


def alike(pictures: Pictures, one: Bool, other: Bool) -> bool:
    """Return whether two sets (F,) of pictures that the table tells apart look the same.

    They do if neither brightness nor the share of a closed line differs between the sets by more than it
    varies within one of them. With too few pictures they are taken to differ.
    """
    measures = (pictures.brightness, pictures.closed)
    if min((one & pictures.seen).sum(), (other & pictures.seen).sum()) < _FEWEST_ALIKE:
        return False
    return not any(_differ(m[one & pictures.seen], m[other & pictures.seen]) for m in measures)


def _differ(one: Float, other: Float) -> bool:
    if min(len(one), len(other)) == 0:
        return False
    spread = max(spread_about_median(one), spread_about_median(other))
    return bool(abs(np.median(one) - np.median(other)) > 2 * spread)


def _two_lights(brightness: Float) -> tuple[float, float] | None:
    """Return the median brightness of dark and of bright pictures; None where there is only one kind."""
    bright = brightness > _otsu(brightness)
    if bright.all() or not bright.any():
        return None
    low, high = float(np.median(brightness[~bright])), float(np.median(brightness[bright]))
    spread = max(spread_about_median(brightness[~bright]), spread_about_median(brightness[bright]))
    place = (brightness - low) / (high - low)
    between = float((np.abs(place - 0.5) < _MIDDLE / 2).mean())
    apart = high - low > max(_APART * spread, _LEAST_APART * high)
    return (low, high) if apart and between < _MOST_BETWEEN else None


def _otsu(value: Float) -> float:
    """Return the threshold that separates values best (Otsu 1979), without a histogram."""
    ordered = np.sort(value)
    count = np.arange(1, len(ordered))
    below = np.cumsum(ordered)[:-1] / count
    above = (ordered.sum() - np.cumsum(ordered)[:-1]) / (len(ordered) - count)
    variance = count * (len(ordered) - count) * (above - below) ** 2
    best = int(np.argmax(variance)) if variance.size else 0
    return float(ordered[best : best + 2].mean())


def _height(brightness: Float, low: float, high: float) -> Float:
    """Return where each picture lies between dark (0) and bright (1), by its neighbours if it can be.

    Where daylight or a warming lamp lifts both lights, medians of the whole run would mistake them.
    """
    darkest = minimum_filter1d(brightness, 2 * _AROUND + 1, mode="nearest")
    brightest = maximum_filter1d(brightness, 2 * _AROUND + 1, mode="nearest")
    both: Bool = brightest - darkest > _BOTH_THERE * (high - low)
    below, above = np.where(both, darkest, low), np.where(both, brightest, high)
    return np.asarray((brightness - below) / (above - below))


def pattern_breaks(light: Int) -> Bool:
    """Return (F,) true where a picture's light is not the one that the lights before it lead to expect.

    Expected is the light that most often follows the same preceding lights (the context) in the recording, so
    that laser, led, ... and laser, laser, led, ... need no rules of their own. The context is the shortest
    that predicts nearly as well as the best one: a longer one has fewer cases to learn from.
    """
    found = [_unexpected(light, memory) for memory in range(1, _LONGEST_MEMORY + 1)]
    fewest = min(int(f.sum()) for f in found)
    return next(f for f in found if f.sum() <= fewest + 2 + _NEARLY * len(light))


def _unexpected(light: Int, memory: int) -> Bool:
    context = np.full(len(light), -1)
    for back in range(1, memory + 1):
        context[memory:] = 3 * (context[memory:] + 1) + light[memory - back : len(light) - back] + 1
    out = np.zeros(len(light), bool)
    for one in np.unique(context[memory:]):
        places = np.flatnonzero((context == one) & (np.arange(len(light)) >= memory) & (light >= 0))
        walls = float(light[places].mean()) if places.size else 0.5
        if max(walls, 1 - walls) > 2 / 3:
            out[places] = light[places] != round(walls)
    return out


@dataclass(frozen=True)
class Steps:
    """Motion of the lit wall from picture ``start`` to ``end`` (K,): ``size`` in pipe radii."""

    start: Int
    end: Int
    size: Float


def steps_of_wall(pictures: Pictures, shown: Int, copy: Bool) -> Steps:
    """Return the steps between pictures that are ``shown`` (F,) to be of the lit wall, or are stated to be.

    A picture that is a ``copy`` (F,) has the place of the one that it repeats.
    """
    end = np.flatnonzero((pictures.partner >= 0) & ~copy)
    start = pictures.partner[end]
    while np.any(copy[start]):
        start = np.where(copy[start], pictures.partner[start], start)
    use = (shown[end] == Light.WALL) & (shown[start] == Light.WALL) & np.isfinite(pictures.step[end])
    return Steps(start[use], end[use], pictures.step[end[use]])


def row_times(table: FrameTable, row: Int) -> Float:
    """Return the time of each row; rows beyond the table go on at its usual pace."""
    usual = float(np.median(np.diff(table.time_s))) if len(table.time_s) > 1 else 0.0
    beyond = np.maximum(row - (len(table.time_s) - 1), 0)
    return np.asarray(table.time_s[np.minimum(row, len(table.time_s) - 1)] + beyond * usual)


def sway_of_line(pictures: Pictures, light: Int) -> Float:
    """Return how far (F,) the laser line moves sideways to its next picture, in multiples of the usual."""
    out, line = np.zeros(len(light)), np.flatnonzero((light == Light.LINE) & (pictures.closed > CLOSED))
    if len(line) < _LEAST_STEPS:
        return out
    moved, azimuth = np.diff(pictures.line_px[line], axis=0), pictures.azimuth_rad
    ahead = [[np.cos(azimuth - turn) > np.sqrt(0.5) for turn in (a, a + np.pi)] for a in (0, np.pi / 2)]
    across = [[np.median(moved[:, side], axis=1) for side in sides] for sides in ahead]
    way = np.hypot(*((one - other) / 2 for one, other in across))
    way /= max(float(np.median(way)), _LEAST_SWAY_PX)
    out[line[0] + 1 : line[-1] + 1] = np.repeat(way, np.diff(line))
    return out


def rows_by_motion(
    row: Int,
    steps: Steps,
    rhythm: int,
    table: FrameTable,
    encoder: Encoder | None,
    sway: Float,
    radius_mm: float = np.nan,
) -> Int:
    """Return ``row`` (F,) with more or fewer rows skipped where the wall moves by more or less than usual.

    The lights give the number of lost pictures only up to whole periods of their rhythm. How far the wall
    moved, compared with the steps around, gives the number of periods. Steps tell nothing where the encoder
    shows the same leap (the probe moved faster), over pictures that were left out (the speed is not known for
    so long), where the line's ``sway`` (F,) leaps (the camera was knocked), or where the encoder agrees with
    the wall, by the pipe's ``radius_mm``: then the usual steps are wrong, because a codec repeated blocks.
    """
    if len(steps.end) < _LEAST_STEPS:
        return row
    time = row_times(table, row)
    period = float(np.median(np.diff(time)))
    out, left = row.copy(), len(table.frame) - 1 - int(row[-1])
    for start, end, lost, size in _leaps(steps, time, rhythm, _SIGMAS_LOST if left > 0 else _SIGMAS):
        skips = np.diff(row[start : end + 1]) - 1
        believed = left >= lost or _encoder_was_steady(encoder, float(time[end]), period)
        believed &= not _encoder_agrees(encoder, time[[start, end]], size * radius_mm)
        believed &= sway[start + 1 : end + 1].max() < _LINE_LEAPS * (1 + abs(lost) / rhythm)
        if (lost > 0 and believed) or (lost < 0 and skips.max() + lost >= 0):
            first = int(np.argmax(skips)) + start + 1 if skips.max() > 0 else (start + end + 1) // 2
            out[first:] += lost
            left -= lost
    return out


def _leaps(steps: Steps, time_s: Float, rhythm: int, sigmas: float) -> list[tuple[int, int, int, float]]:
    """Return (start, end, lost pictures in whole periods, size) of steps that stand out, clearest first."""
    period_s = float(np.median(np.diff(time_s)))
    passed = np.maximum(time_s[steps.end] - time_s[steps.start], 1e-9)
    speed = median_filter(steps.size / passed, _AROUND_STEP, mode="nearest")
    excess = (steps.size - speed * passed) * np.sign(speed)
    sigma = float(np.quantile(np.abs(excess), 0.9)) / _NINE_IN_TEN + 1e-9
    one = np.maximum(np.abs(speed) * period_s * rhythm, 1e-9)
    lost = rhythm * np.rint(excess / one).astype(np.int64)
    stand_out = (np.abs(excess) > sigmas * sigma) & (lost != 0) & (one > sigmas * sigma / 2)
    stand_out &= passed < _LONGEST_STEP * np.median(passed)
    clearest = sorted(np.flatnonzero(stand_out), key=lambda k: -abs(float(excess[k])))
    return [(int(steps.start[k]), int(steps.end[k]), int(lost[k]), float(steps.size[k])) for k in clearest]


def _encoder_agrees(encoder: Encoder | None, time_s: Float, way_mm: float) -> bool:
    """Return whether the encoder advances by ``way_mm`` between two times; False where it is not known."""
    if encoder is None or time_s[0] < encoder.time_s[0] or time_s[1] > encoder.time_s[-1]:
        return False
    shown_mm = float(np.diff(np.interp(time_s, encoder.time_s, encoder.distance_mm))[0])
    return abs(shown_mm - way_mm) < _AGREES * abs(way_mm)


def _encoder_was_steady(encoder: Encoder | None, time_s: float, period_s: float) -> bool:
    """Return whether the encoder advances evenly around a time; False where it is not known."""
    if encoder is None or not encoder.time_s[0] < time_s < encoder.time_s[-1]:
        return False
    at = time_s + period_s * np.arange(-_NEARBY, _NEARBY + 1)
    step = np.abs(np.diff(np.interp(at, encoder.time_s, encoder.distance_mm)))
    return bool(step.max() < 2 * np.median(step))


def rhythm_of(light: Int) -> int:
    """Return the period of the lights in pictures, 1 where they are not told apart."""
    if not np.any(light != Light.UNKNOWN):
        return 1
    agree = [float((light[p:] == light[:-p]).mean()) for p in range(1, min(13, len(light)))]
    # Twice the period agrees as well: the shortest one within 0.05 (chosen) of the best is taken.
    return 1 + next((k for k, a in enumerate(agree) if a >= max(agree) - 0.05), 0)
