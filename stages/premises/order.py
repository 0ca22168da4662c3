"""Finds pictures that were stored in another order than taken, and pictures from outside the pipe."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Bool, Float, Int
from stages.premises.light import Light, pattern_breaks
from stages.premises.moving import lower_speed, usual_speed
from stages.premises.pictures import CLOSED, Pictures

# In usual steps. Over two exchanged pictures the wall goes two forwards, one back, and two forwards; the
# bounds lie half-way between these and one step, or none. A picture half a step off its place lies in that of
# another.
_ON, _BACK, _ASTRAY = 1.5, -0.5, 0.5
# Steps over two exchanged neighbours of one light.
_PAIR = 2
# Error of a leap over a block, as a share: leaps of 11 steps came out 2 too short and 2 too long (open-1 at
# half its size).
_LEAPS_ERR = 0.2
# Exchanged neighbours in two lights look like two losses in the rhythm, but the wall advances by its usual
# step and not, as over losses, by at least 1.5 times that; the bound is half-way.
_NO_LOSS = 1.25
# Pictures of the wall that show a usual step, and pictures within which an exchanged order must be right
# again.
_FEWEST, _BACK_WITHIN = 12, 9
# Two losses within so many pictures look like an exchange. If n breaks lie anywhere among N pictures, about
# so many times n² / N pairs of them are so close.
_CLOSE_BY = 3
# Pictures behind an exchange in which the rhythm is checked: as far as its memory reaches.
_BEHIND = 8
# Pictures before the first closed line, or behind the last, lie outside the pipe if they are more than so
# many times the usual number between two lines, and more than "a while": a few rings that do not close are no
# end.
_LONG, _A_WHILE, _LEAST_LINES = 4, 8, 3
# A line is smooth on a ray if it differs from the neighbouring ray by less than this part of its radius: 3 px
# of a ring of 400 px, which a ring 25 px off the centre does not reach. A line is sound if its share of
# smooth rays is at least this part of the recording's median: sound lines have .8 or more, noise that closed
# by chance half.
_SMOOTH, _LIKE_OTHERS = 0.01, 0.75


def out_of_order(pictures: Pictures, light: Int) -> Bool:
    """Return (F,) true for pictures exchanged with one of the same light, or with a neighbour of the other.

    It does not find single pictures of the laser line exchanged with each other, any pictures if the lights
    are not distinguished, nor the first and last picture of the wall, for whose place there is no evidence.
    Of whole blocks that were exchanged, all pictures are returned, with those beside them whose block is not
    known.
    """
    out = np.zeros(len(light), bool)
    place = np.flatnonzero((light == Light.WALL) & (pictures.partner >= 0) & np.isfinite(pictures.step))
    if len(place) < _FEWEST:
        return out
    size = pictures.step[place]
    step = _in_usual_steps(size)
    out[place] = _off_their_place(step)
    for first, behind in _exchanged_blocks(step):
        out[place[first - 1] + 1 : place[behind]] = True
    return out | _lights_exchanged(light, place, size)


def _in_usual_steps(size: Float) -> Float:
    """Return steps (K,) of the wall over those around them; 1 where it stands, which shows no order."""
    usual = usual_speed(size)
    return np.divide(size, usual, out=np.ones(len(size)), where=usual != 0)


def _off_their_place(step: Float) -> Bool:
    """Return which pictures (K,) do not lie where their neighbours' motion puts them.

    ``step`` (K,) is in usual steps. Over exchanged pictures the wall jumps ahead, goes back, and ends where
    it would have been at its usual speed. No probe moves so, and after lost pictures the wall stays ahead.
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


def _exchanged_blocks(step: Float) -> list[tuple[int, int]]:
    """Return where blocks of pictures that were exchanged begin, and the first step (of K) behind them.

    ``step`` (K,) is in usual steps. The wall leaps ahead over one block, goes back by both, and leaps ahead
    again to where it would have been. All steps between these three are usual ones, unlike those of a probe
    pulled by hand. Each leap ahead is as long as the block behind the other one.
    """
    out, odd = [], np.flatnonzero(np.abs(step - 1) > _ASTRAY)
    for first, back, last in zip(odd, odd[1:], odd[2:], strict=False):
        ahead = step[[first, back, last]] - 1
        lengths = np.array([last - back, first - last, back - first])
        fits = np.abs(ahead - lengths) < np.maximum(_ASTRAY, _LEAPS_ERR * np.abs(lengths))
        if first > 0 and last - first > _PAIR and fits.all():
            out.append((int(first), int(last)))
    return out


def _lights_exchanged(light: Int, place: Int, size: Float) -> Bool:
    """Return (F,) true for neighbours in two lights that break the rhythm, and would keep it if exchanged.

    Two pictures lost close to each other may look exchanged. So none are returned unless there are more pairs
    than the remaining breaks of the rhythm would make by chance.

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
    more_than_chance = int(out.sum()) // 2 > _CLOSE_BY * left**2 / len(light)
    return out if more_than_chance else np.zeros_like(out)


def _mends(light: Int, breaks: Bool, first: int) -> bool:
    """Return whether the rhythm continues unbroken after a picture is exchanged with the next."""
    other = light.copy()
    other[[first, first + 1]] = light[[first + 1, first]]
    behind = slice(first, first + _BEHIND)
    return int(pattern_breaks(other)[behind].sum()) <= int(breaks[behind].sum()) - 2


def off_the_pipe(pictures: Pictures, light: Int) -> Bool:
    """Return (F,) true for pictures before the first closed laser line and after the last, if many.

    Pictures that cannot be decoded do not count: they may well have shown a line. Where the `Light` (F,)
    of the pictures is known, lit ones do not count as lines: the rim of a pipe's end is a closed line, too.
    """
    out = np.zeros(len(pictures.closed), bool)
    closed = pictures.closed > CLOSED
    if np.any(light == Light.LINE):
        closed &= light != Light.WALL
    beside = np.abs(pictures.line_px - np.roll(pictures.line_px, 1, axis=1))
    smooth = np.mean(beside < _SMOOTH * pictures.line_px, axis=1)
    if closed.sum() < _LEAST_LINES:
        return out
    lines = np.flatnonzero(closed & (smooth > _LIKE_OTHERS * np.median(smooth[closed])))
    many = max(_LONG * float(np.median(np.diff(lines))), _A_WHILE)
    for end in (slice(0, lines[0]), slice(lines[-1] + 1, None)):
        out[end] = pictures.seen[end].sum() > many
    return out


def behind_the_end(pictures: Pictures, outside: Bool, light: Int) -> int:
    """Return how many of the last pictures, which are `off_the_pipe`, show that the pipe has ended.

    Where the lit wall still moves at least half as fast as usual in most of them, the pipe goes on, and only
    the laser was off. Pictures that are not lit show neither; if no `Light` (F,) is known, all are lit.
    """
    inside = np.flatnonzero(~outside)
    if not inside.size or inside[-1] == len(outside) - 1:
        return 0
    lit, step = (light == Light.WALL) | np.all(light == Light.UNKNOWN), np.abs(pictures.step)
    before, behind = step[lit & ~outside], step[inside[-1] + 1 :][lit[inside[-1] + 1 :]]
    if not behind.size or not np.any(np.isfinite(before)):
        return 0
    goes_on = np.mean(behind > np.nanmedian(before) / 2) > 0.5
    return 0 if goes_on else len(outside) - 1 - int(inside[-1])
