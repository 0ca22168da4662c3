"""Finds where the wall moves, and its usual speed: where it stands, a comparison of steps is no evidence."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import binary_erosion, median_filter, percentile_filter

from pipeline.arrays import Bool, Float

# A wall stands if it moves by less than this part of its fast steps: that may be error of matching, up to a
# tenth of a step, and the ratio of two errors says nothing. Chosen.
_MOVES = 0.25
# Quantile that counts as the speed of fast steps: a probe may stand for nine tenths of a run, and jumps lie
# in the longest tenth.
_FAST = 0.9
# Steps around a place that give its speed, and their percentile that is the speed without losses, if
# pictures were lost in up to half of them.
_AROUND, _LOWER = 9, 25


def wall_moves(speed: Float, of_run: Float) -> Bool:
    """Return where the wall moves (K,) at a ``speed`` (K,), compared with all speeds ``of_run`` (N,)."""
    fast = float(np.quantile(np.abs(of_run), _FAST)) if len(of_run) else 0.0
    return np.asarray(np.abs(speed) > _MOVES * fast)


def usual_speed(speed: Float) -> Float:
    """Return the usual speed (K,) about each step; 0 where the wall stands.

    The first and the last step are not repeated beyond the ends, where they would outweigh all others.
    """
    usual = median_filter(speed, _AROUND, mode="mirror")
    return np.where(wall_moves(usual, speed), usual, 0.0)


def lower_speed(speed: Float) -> Float:
    """Return the speed (K,) about each step as if no pictures were lost; 0 where the wall stands.

    Lost pictures, however many, only make steps longer, so the shorter ones of the moving steps are taken.
    Steps in which the wall stands, stops or starts are shorter for another reason and are left out.
    """
    out = np.zeros(len(speed))
    moves = binary_erosion(wall_moves(speed, speed), border_value=True)
    if moves.any():
        sense = np.sign(median_filter(speed[moves], _AROUND, mode="nearest"))
        out[moves] = sense * percentile_filter(np.abs(speed[moves]), _LOWER, _AROUND, mode="nearest")
    return out
