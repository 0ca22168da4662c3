"""Which light each picture was taken in, learned from the recording's own pictures."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from pipeline.adjustment.robust import spread_about_median
from pipeline.arrays import Bool, Float, Int
from stages.premises.pictures import CLOSED, Pictures

# A picture between the two lights, in the middle third of the way, is called neither.
_MIDDLE = 1 / 3
# Two lights are told apart where they lie further apart than this many of their own spreads, and where hardly
# any picture lies between them: a single light that slowly changes fills the middle.
_APART, _MOST_BETWEEN = 3.0, 0.05
# Dark pictures are those of the laser only where more than this part of them shows its line.
_MOST_DARK = 0.5
# The brightness of either light is followed over so many frames on both sides, as lamps warm up.
_AROUND = 8
# Least distance within these frames, as a part of that in the whole run, at which both lights are among them.
_BOTH_THERE = 0.4
# Lights that are remembered to foretell the next, and surprises by which a memory may be worse than the best.
_LONGEST_MEMORY, _NEARLY = 6, 0.05


class Light(IntEnum):
    """What a picture shows."""

    UNKNOWN = -1
    LINE = 0  # dark, with a thin bright closed line
    WALL = 1  # the wall is lit, with or without line


def light_seen(pictures: Pictures) -> Int:
    """Return the `Light` (F,) of every picture; all unknown where the recording has only one light.

    So they are where its dark pictures show no line. A picture that cannot be decoded, that lies between the
    lights, or that is dark without a closed line (a covered lens, a lamp that failed) is unknown.
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

    They do when neither brightness nor the closed line differs between them by more than it varies in all.
    """
    measures = (pictures.brightness, pictures.closed)
    return not any(_differ(m[one & pictures.seen], m[other & pictures.seen]) for m in measures)


def _differ(one: Float, other: Float) -> bool:
    if min(len(one), len(other)) == 0:
        return False
    spread = spread_about_median(np.concatenate([one, other]))
    return bool(abs(np.median(one) - np.median(other)) > 2 * spread)


def _two_lights(brightness: Float) -> tuple[float, float] | None:
    """Return the medians of the dark and the bright pictures, None where they are no two kinds."""
    bright = brightness > _otsu(brightness)
    if bright.all() or not bright.any():
        return None
    low, high = float(np.median(brightness[~bright])), float(np.median(brightness[bright]))
    spread = max(spread_about_median(brightness[~bright]), spread_about_median(brightness[bright]))
    place = (brightness - low) / (high - low)
    between = float((np.abs(place - 0.5) < _MIDDLE / 2).mean())
    return (low, high) if high - low > _APART * spread and between < _MOST_BETWEEN else None


def _otsu(value: Float) -> float:
    """Return the threshold that parts values best (Otsu 1979), without a histogram."""
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

    Expected is what most often follows the same lights elsewhere in the recording; so laser, led, ... and
    laser, laser, led, ... need no rule of their own. The memory is the shortest
    that predicts nearly as well as the best: a longer one knows fewer cases of each kind.
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
