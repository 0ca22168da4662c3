"""The part of an inspection's ring residuals that does not repeat on other wall, every ring counted once."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Float, Int
from stages.diagnose.gauge.heldout import at_one_azimuth, turns_apart

# Weight of a pair of an end with what is beyond it, negligible unless its rings have no other pair.
_ELSE = 1e-6
_ROUNDS = 100


def unrepeated(value: Float, azimuth_rad: Float, frame: Int, along_mm: Float) -> float:
    """Return the variance of the part of ring bins (M,) that does not repeat at one azimuth on other wall.

    Bins near an end have a partner on one side only. Pairs are weighted so that all bins count equally, since
    noise may be larger at the ends. An effect that begins near an end would be in every pair of that end with
    the rest of the run: bins there are compared with one another, half as far apart. NaN without pairs.
    """
    turn, apart = turns_apart(frame, along_mm)
    half, last = max(apart // 2, 1), int(turn.max(initial=0))
    end = np.where(turn < 2 * half, 1, np.where(turn > last - 2 * half, 2, 0))
    near = at_one_azimuth(azimuth_rad, turn, half, 2 * half)
    far = [at_one_azimuth(azimuth_rad, turn, places, 2 * apart) for places in (apart, 2 * apart)]
    first, second = (np.concatenate(each) for each in zip(near, *far, strict=True))
    is_near = np.arange(len(first)) < len(near[0])
    wanted = (end[first] == end[second]) & ((end[first] > 0) == is_near)
    weight = np.where(wanted, 1.0, np.where(is_near, 0.0, _ELSE))
    if not weight.any():
        return float("nan")
    weight = _each_once(first, second, weight, len(value))
    return float(np.average((value[second] - value[first]) ** 2, weights=weight)) / 2


def _each_once(first: Int, second: Int, weight: Float, count: int) -> Float:
    """Return weights (P,) of pairs such that all bins in any pair count equally (Sinkhorn & Knopp 1967)."""
    each = np.ones(count)
    for _ in range(_ROUNDS):
        both = weight * each[first] * each[second]
        total = np.bincount(first, both, count) + np.bincount(second, both, count)
        each /= np.sqrt(np.where(total > 0, total, 1.0))
    return np.asarray(weight * each[first] * each[second])
