"""Finds the light in which each picture was taken, and the light that the rhythm of the lights predicts."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from pipeline.adjustment.robust import spread_about_median
from pipeline.arrays import Bool, Float, Int
from stages.premises.pictures import CLOSED, Pictures

# A picture whose brightness lies in the middle third between the two lights belongs to neither.
_MIDDLE = 1 / 3
# Two lights are distinguished if they differ by more than this many of their own spreads and hardly any
# picture lies between them: a single light that changes slowly would fill the middle.
_APART, _MOST_BETWEEN = 3.0, 0.05
# Two lights differ by at least this part of their brightness (chosen): two runs of open-3 that were joined,
# with one light, differ by 0.01.
_LEAST_APART = 0.05
# Dark pictures count as those of the laser only if more than this part of them shows its line.
_MOST_DARK = 0.5
# With fewer pictures in one light, its spread is not known.
_FEWEST_ALIKE = 3
# The brightness of each light is compared within this many frames on both sides, since lamps warm up.
_AROUND = 8
# The median of n normal values has a σ of √(π / 2) σ / √n (Huber 1981, § 1.2); beyond three times as much,
# values differ: by chance in one recording of 400.
_SIGMA_OF_MEDIAN, _SURE = 1.2533, 3.0
# Both lights are among these frames if their brightness spans at least this part of that in the whole run.
_BOTH_THERE = 0.4
# Longest context (preceding lights) that predicts the next one; share of more errors that a shorter one may
# make.
_LONGEST_MEMORY, _NEARLY = 6, 0.05


class Light(IntEnum):
    """What a picture shows."""

    UNKNOWN = -1
    LINE = 0  # dark, with a thin bright closed line
    WALL = 1  # the wall is lit, with or without line


def light_seen(pictures: Pictures) -> Int:
    """Return the `Light` (F,) of every picture; all unknown if the recording has only one light.

    It has only one if its dark pictures show no line. A picture is unknown if it cannot be decoded, lies
    between the lights, or is dark without a closed line (a covered lens, a lamp that failed).
    """
    out = np.full(len(pictures.brightness), Light.UNKNOWN, np.int64)
    seen = np.flatnonzero(pictures.seen)
    height = _height(pictures.brightness[seen]) if seen.size else None
    if height is None:
        return out
    dark, closed = height < (1 - _MIDDLE) / 2, pictures.closed[seen] > CLOSED
    if closed[dark].mean() > _MOST_DARK:
        out[seen[height > (1 + _MIDDLE) / 2]] = Light.WALL
        out[seen[dark & closed]] = Light.LINE
    return out


def look_the_same(pictures: Pictures, one: Bool, other: Bool) -> bool:
    """Return whether two sets (F,) of pictures, which the table labels differently, look the same.

    They do if neither brightness nor the share of a closed line differs between the sets by more than it
    varies within one of them, or if it continues smoothly where the table passes from one set to the other:
    over many frames in one light it drifts as well. With too few pictures, the sets count as different.
    """
    measures = (pictures.brightness, pictures.closed)
    if min((one & pictures.seen).sum(), (other & pictures.seen).sum()) < _FEWEST_ALIKE:
        return False
    one, other = one & pictures.seen, other & pictures.seen
    return not any(_differ(m[one], m[other]) and not _continues(m, one, other) for m in measures)


def _continues(value: Float, one: Bool, other: Bool) -> bool:
    """Return whether values (F,) change no more from one set (F,) to the other than within them.

    Medians are compared, so that one flash within a set does not make the sets look the same.
    """
    step = np.abs(np.diff(value))
    within = (one[:-1] & one[1:]) | (other[:-1] & other[1:])
    between = (one[:-1] & other[1:]) | (other[:-1] & one[1:])
    if between.sum() == 0 or within.sum() < _FEWEST_ALIKE * between.sum():
        return False
    sigma = _SIGMA_OF_MEDIAN * spread_about_median(step[within]) / np.sqrt(between.sum())
    return bool(np.median(step[between]) <= np.median(step[within]) + _SURE * sigma)


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


def _height(brightness: Float) -> Float | None:
    """Return where each picture (F,) lies between dark (0) and bright (1); None if there is only one light.

    It is measured against its neighbours if both lights are among them: daylight or a warming lamp brightens
    both, so that medians of the whole run would misjudge them. If the whole run does not show two lights,
    the neighbours of every picture may: towards the end of a pipe the lit pictures become ever darker.
    """
    darkest = minimum_filter1d(brightness, 2 * _AROUND + 1, mode="nearest")
    brightest = maximum_filter1d(brightness, 2 * _AROUND + 1, mode="nearest")
    split = _two_lights(brightness)
    if split is None:
        span = brightest - darkest
        height = (brightness - darkest) / np.maximum(span, 1e-9)
        everywhere = np.all(span > _LEAST_APART * brightest)
        return np.asarray(height) if everywhere and _two_lights(height) is not None else None
    low, high = split
    both: Bool = brightest - darkest > _BOTH_THERE * (high - low)
    below, above = np.where(both, darkest, low), np.where(both, brightest, high)
    return np.asarray((brightness - below) / (above - below))


def pattern_breaks(light: Int) -> Bool:
    """Return (F,) true where a picture's light is not the one predicted from the lights before it.

    The predicted light is the one that most often follows the same preceding lights (the context) in the
    recording, so that laser, led, ... and laser, laser, led, ... need no rules of their own. The context is
    the shortest that predicts nearly as well as the best one: a longer one has fewer cases to learn from.
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


def rhythm_of(light: Int) -> int:
    """Return the period of the lights in pictures, 1 if they are not distinguished."""
    if not np.any(light != Light.UNKNOWN):
        return 1
    agree = [float((light[p:] == light[:-p]).mean()) for p in range(1, min(13, len(light)))]
    # Twice the period agrees as well: the shortest one within 0.05 (chosen) of the best is taken.
    return 1 + next((k for k, a in enumerate(agree) if a >= max(agree) - 0.05), 0)
