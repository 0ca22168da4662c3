"""Finds the rhythm of the lights at the time of recording from the wall's steps between lit pictures."""

from __future__ import annotations

from math import gcd

import numpy as np
from scipy.ndimage import median_filter

from pipeline.arrays import Float, Int

# A number of pictures belongs to the pattern if at least one in ten of all steps, and at least six, span it:
# an incomplete last step or a single loss does not count. Chosen.
_SHARE, _FEWEST = 0.1, 6
# Sizes of steps are compared with the median of so many steps around them that span the usual number.
_AROUND = 9
# The true numbers of pictures in steps are whole within this part of one (chosen: steps err by a tenth),
# and a recorder loses one in two at most in a pattern.
_WHOLE, _LONGEST = 0.25, 2


def over_whole_periods(pictures: Int, size: Float, rhythm: int) -> tuple[int, Int]:
    """Return the rhythm, and the number of lost pictures (K,) that completes each step to whole periods.

    An example: steps alternate over 1 and 3 pictures, and the latter go twice as far. Then they were taken
    over 2 and 4 pictures, since no other numbers fit. The evidence is the numbers of ``pictures`` (K,) that
    many steps span, and the median size of such steps; single steps decide nothing. If no whole numbers fit,
    the period is the number that more than half of the steps span. If there is none, or if steps are as long
    as their numbers of pictures, the ``rhythm`` of the lights is returned.
    """
    span, often = np.unique(pictures, return_counts=True)
    pattern = span[often >= max(_SHARE * len(pictures), _FEWEST)]
    usual = int(span[np.argmax(often)])
    if usual not in pattern:
        return rhythm, np.zeros_like(pictures)
    taken = _taken_over(pattern, _sizes(pictures, size, pattern, usual), usual)
    if taken is None:
        pattern = taken = np.array([usual if 2 * often.max() > len(pictures) else 1])
    period = gcd(*map(int, taken))
    if period == 1 or (len(pattern) > 1 and np.array_equal(taken, pattern)):
        return rhythm, np.zeros_like(pictures)
    over = -pictures % period
    for one, true in zip(pattern, taken, strict=True):
        over[pictures == one] = true - one
    return period, over


def _sizes(pictures: Int, size: Float, pattern: Int, usual: int) -> Float:
    """Return the median size (P,) of steps of a pattern, relative to steps over the ``usual`` number."""
    same = np.flatnonzero(pictures == usual)
    beside = median_filter(np.abs(size[same]), _AROUND, mode="mirror")
    around = np.interp(np.arange(len(size)), same, beside)
    relative = np.abs(size) / np.where(around > 0, around, np.inf)
    return np.array([float(np.median(relative[pictures == one])) for one in pattern])


def _taken_over(pattern: Int, size: Float, usual: int) -> Int | None:
    """Return the numbers of pictures (P,) in the steps of a pattern: the smallest that fit their sizes."""
    for first in range(usual, _LONGEST * usual + 1):
        taken = np.rint(first * size).astype(np.int64)
        if np.all(np.abs(first * size - taken) < _WHOLE) and np.all(taken >= pattern):
            return taken
    return None
