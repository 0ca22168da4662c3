"""Aligns the rows of the table of frames with the pictures.

The state at each picture is the number of rows skipped so far (pictures that were lost although the table
lists them), and whether the table has the two lights swapped. Each fault (a lost picture, a wrong label, a
swap) has a cost, and dynamic programming (Viterbi) finds the alignment of least cost. The rhythm of the
lights distinguishes lost pictures from wrong labels: a lost picture breaks it, a wrong label does not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Bool, Float, Int

# The cost of one fault: a wrong label, a loss, a swap, a loss that does not break the rhythm, or a break of
# the rhythm without a loss. The frequency of each is unknown, so all cost the same.
_FAULT = 1.0
# Of two losses that explain the same lights, the smaller is taken. A loss before the first picture does
# not break the rhythm, so that it could explain away wrong labels at no cost: each such picture costs more.
_EACH_LOST, _EACH_LOST_FIRST = 0.2, 0.5
# Rows that are left over when the pictures end cost half a fault: the video was cut short. So do missing rows
# where the table has as many rows as pictures: the table was cut. Elsewhere each missing row is a fault.
_ROWS_OFF = 0.5
# Most pictures that can be lost in all beyond those that the table has too many rows for.
_MOST_LOST = 12
_MOST_ROWS_OVER = 48
_IMPOSSIBLE = 1e9


@dataclass(frozen=True)
class Alignment:
    """The row (F,) of each picture, perhaps beyond the table, and where its lights are swapped (F,)."""

    row: Int
    swapped: Bool


@dataclass(frozen=True)
class Lights:
    """Lights to be aligned: those that pictures (F,) show (−1: unknown), and those that the N rows state.

    Attributes
    ----------
    breaks : (F,) bool
        Where the light is not the one predicted from the pictures before it.
    repeats : (F,) bool
        Pictures that repeat the one before.
    """

    picture: Int
    row: Int
    breaks: Bool
    repeats: Bool


def aligned(lights: Lights) -> Alignment:
    """Return the alignment of pictures and rows that has the least cost."""
    count, rows = len(lights.picture), len(lights.row)
    shifts = np.arange(-min(int(lights.repeats.sum()), _MOST_LOST), _most_lost(rows - count) + 1)
    cost = shifts[:, None] * _EACH_LOST_FIRST + (shifts != 0)[:, None] * _FAULT + [0.0, _FAULT]
    cost[shifts < 0] = _IMPOSSIBLE
    came_from = np.zeros((count, *cost.shape), np.int32)
    cost = cost + _wrong(lights, shifts, 0)
    for place in range(1, count):
        cost, came_from[place] = _advanced(cost, bool(lights.breaks[place]), bool(lights.repeats[place]))
        cost = cost + _wrong(lights, shifts, place)
    cost = cost + _rows_off(shifts, rows - count)[:, None]
    return _traced_back(cost, came_from, shifts)


def _rows_off(shifts: Int, left_over: int) -> Float:
    """Return the cost (S,), at each shift, of a table that does not end where the pictures end."""
    missing = np.maximum(shifts - left_over, 0) * (left_over != 0)
    return np.asarray(_ROWS_OFF * (shifts != left_over) + _FAULT * missing)


def _most_lost(left_over: int) -> int:
    return _MOST_LOST + min(max(left_over, 0), _MOST_ROWS_OVER)


def _wrong(lights: Lights, shifts: Int, place: int) -> Float:
    """Return the cost (S, 2) of one picture's label at each shift: as the table states it, and swapped."""
    seen, row = int(lights.picture[place]), place + shifts
    known = (row >= 0) & (row < len(lights.row)) & (seen >= 0)
    stated = lights.row[np.clip(row, 0, len(lights.row) - 1)]
    wrong = np.stack([stated != seen, stated == seen], -1)
    return np.where(known[:, None], wrong, False) * _FAULT


def _advanced(cost: Float, breaks: bool, repeats: bool) -> tuple[Float, Int]:
    """Return the least cost (S, 2) of the next picture's states, and the flat index each comes from."""
    index = np.arange(cost.size).reshape(cost.shape)
    stay = cost + _FAULT * breaks
    lost, lost_from = _cheapest_below(cost, index)
    lost = lost + _FAULT * (not breaks)
    best, source = np.minimum(stay, lost), np.where(stay <= lost, index, lost_from)
    if repeats:
        best, source = _less(best, source, _shifted_down(cost) + _FAULT, np.roll(index, -1, 0))
    swapped = stay[:, ::-1] + _FAULT
    return _less(best, source, swapped, index[:, ::-1])


def _less(cost: Float, source: Int, other: Float, other_source: Int) -> tuple[Float, Int]:
    return np.minimum(cost, other), np.where(cost <= other, source, other_source)


def _shifted_down(cost: Float) -> Float:
    return np.vstack([cost[1:], np.full((1, 2), _IMPOSSIBLE)])


def _cheapest_below(cost: Float, index: Int) -> tuple[Float, Int]:
    """Return the cost (S, 2) of reaching each shift from the best lower one, and the index of that."""
    level = np.arange(len(cost))[:, None] * _EACH_LOST
    out, source = np.full(cost.shape, _IMPOSSIBLE), index.copy()
    least = np.minimum.accumulate(cost - level, 0)
    first = np.where(cost - level <= least, np.arange(len(cost))[:, None], 0)
    at = np.maximum.accumulate(first, 0)
    out[1:] = least[:-1] + level[1:] + _FAULT
    source[1:] = np.take_along_axis(index, at[:-1], 0)
    return out, source


def _traced_back(cost: Float, came_from: Int, shifts: Int) -> Alignment:
    state = int(np.argmin(cost))
    states = np.empty(len(came_from), np.int64)
    for place in range(len(came_from) - 1, -1, -1):
        states[place] = state
        state = int(came_from[place].flat[state])
    return Alignment(np.arange(len(states)) + shifts[states // 2], states % 2 == 1)
