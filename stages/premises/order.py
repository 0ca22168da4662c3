"""Pictures that were stored in another order than taken, and pictures from outside the pipe."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Bool, Float, Int
from stages.premises.light import Light, pattern_breaks
from stages.premises.moving import lower_speed, usual_speed
from stages.premises.pictures import CLOSED, Pictures

# In usual steps: two pictures exchanged go on by two, back by one, on by two. The middle between these and
# one step on, or none; half a step off its place is a picture in another's.
_ON, _BACK, _ASTRAY = 1.5, -0.5, 0.5
# Neighbours in two lights that were exchanged look like two losses, of which the wall shows nothing: it goes
# on by 1 in place of 1.5 times the usual way at least.
_NO_LOSS = 1.25
# Fewer pictures of the wall show no usual step. Those that were exchanged come back to their order within so
# many pictures.
_FEWEST, _BACK_WITHIN = 12, 9
# Breaks that lie anywhere in a run follow each other within so many pictures n² / N times as often: there two
# losses look like an exchange.
_CLOSE_BY = 3
# The rhythm is looked at as far behind an exchange as its memory reaches.
_BEHIND = 8
# A run begins at its first closed line and ends at its last where none is seen for so many times as long as
# is usual between two, and for a while: some rings in which nothing closes are no end.
_LONG, _A_WHILE, _LEAST_LINES = 4, 8, 3
# On neighbouring rays a line differs by less than this part of its radius: 3 px of a ring of 400, which one
# 25 px off the centre does not reach. The share of such rays is like that of the recording's other lines:
# sound ones have .8 of their median or more, noise that "closed" by chance half of it.
_SMOOTH, _LIKE_OTHERS = 0.01, 0.75


def out_of_order(pictures: Pictures, light: Int) -> Bool:
    """Return (F,) true for pictures exchanged with one of the same light, or with a neighbour of the other.

    Those of the laser among themselves do not show it, and where lights are not told apart nothing does. Nor
    is it told of the first or the last picture of the wall: nothing shows where it would have lain.
    """
    out = np.zeros(len(light), bool)
    place = np.flatnonzero((light == Light.WALL) & (pictures.partner >= 0) & np.isfinite(pictures.step))
    if len(place) < _FEWEST:
        return out
    size = pictures.step[place]
    out[place] = _off_their_place(_in_usual_steps(size))
    return out | _lights_exchanged(light, place, size)


def _in_usual_steps(size: Float) -> Float:
    """Return steps (K,) of the wall over those around them; 1 where it stands, which tells no order."""
    usual = usual_speed(size)
    return np.divide(size, usual, out=np.ones(len(size)), where=usual != 0)


def _off_their_place(step: Float) -> Bool:
    """Return which pictures (K,) do not lie where their neighbours' motion puts them, by steps in usual ones.

    The wall leaps on, goes back, and comes to where it would have been at its usual speed: no probe moves so,
    nor do lost pictures, behind which it stays ahead.
    """
    out, ahead = np.zeros(len(step), bool), np.cumsum(step - 1)
    for first in np.flatnonzero(step > _ON):
        near = slice(first, first + _BACK_WITHIN)
        astray = np.abs(ahead[near] - ahead[first] + step[first] - 1) > _ASTRAY
        went_back = np.logical_or.accumulate(step[near] < _BACK)
        again = np.flatnonzero((step[near] > _ON) & went_back & ~astray)
        if again.size:
            out[first : first + again[0]] = astray[: again[0]]
    return out


def _lights_exchanged(light: Int, place: Int, size: Float) -> Bool:
    """Return (F,) true for neighbours in two lights that break the rhythm, and would not the other way round.

    Two pictures that are lost close by may look exchanged. None are told unless there are more of them than
    the breaks that are left, if they lay anywhere, would make by chance.

    Parameters
    ----------
    light : (F,)
    place, size : (K,)
        Pictures that show the wall, and its motion since the one before.
    """
    out, back = np.zeros(len(light), bool), light.copy()
    breaks = pattern_breaks(light)
    way = np.cumsum(size)
    speed = lower_speed(size / np.diff(place, prepend=place[0] - 1))
    for first in np.flatnonzero(breaks[:-1] & (light[:-1] != light[1:])):
        last = int(np.searchsorted(place, first)) - 1
        after = int(np.searchsorted(place, first + 1, side="right"))
        if last < 0 or after >= len(place) or speed[after] == 0:
            continue
        usual = speed[after] * (place[after] - place[last])
        if 0 < (way[after] - way[last]) / usual < _NO_LOSS and _mends(light, breaks, int(first)):
            out[first : first + 2] = True
            back[[first, first + 1]] = back[[first + 1, first]]
    left = int(pattern_breaks(back).sum())
    told = int(out.sum()) // 2 > _CLOSE_BY * left**2 / len(light)
    return out if told else np.zeros_like(out)


def _mends(light: Int, breaks: Bool, first: int) -> bool:
    """Return whether the rhythm is whole behind a picture that is exchanged with the next."""
    other = light.copy()
    other[[first, first + 1]] = light[[first + 1, first]]
    behind = slice(first, first + _BEHIND)
    return int(pattern_breaks(other)[behind].sum()) <= int(breaks[behind].sum()) - 2


def off_the_pipe(pictures: Pictures) -> Bool:
    """Return (F,) true for pictures before the first closed laser line and behind the last, if many.

    Pictures that cannot be decoded do not count: they may well have shown a line.
    """
    out = np.zeros(len(pictures.closed), bool)
    closed = pictures.closed > CLOSED
    beside = np.abs(pictures.line_px - np.roll(pictures.line_px, 1, axis=1))
    smooth = np.mean(beside < _SMOOTH * pictures.line_px, axis=1)
    if closed.sum() < _LEAST_LINES:
        return out
    lines = np.flatnonzero(closed & (smooth > _LIKE_OTHERS * np.median(smooth[closed])))
    many = max(_LONG * float(np.median(np.diff(lines))), _A_WHILE)
    for end in (slice(0, lines[0]), slice(lines[-1] + 1, None)):
        out[end] = pictures.seen[end].sum() > many
    return out
