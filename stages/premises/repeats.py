"""Frames that show an earlier picture again, because the recorder hung or a converter repeated it."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import label, median_filter, rank_filter

from pipeline.arrays import Bool, Float, Int
from pipeline.recording.base import Encoder, FrameTable
from stages.premises.light import Light
from stages.premises.losses import Steps, row_times
from stages.premises.pictures import Pictures

# A picture repeats the one before if it differs from it by less than this part of the usual change. A step of
# less than 1.5 usual ones counts as one step, a longer one as two.
_STANDS, _ONE_STEP = 0.25, 1.5
# Steps on either side from which the usual speed is taken.
_AROUND_STEP = 9
# A picture is a copy if it changes far less than the second smallest change around it that is no copy's. The
# smallest is not used: where all pictures tremble, two that happen to be displaced equally change as little.
_LEAST_OF_AROUND = 1
# Other rows are believed if by them the encoder departs from the wall by less than half of the variance, over
# so many steps (chosen): the departures at repeated pictures are then gone, and only errors of matching are
# left.
_FOLLOWS, _LEAST_STEPS = 0.5, 12


def rows_of_repeats(row: Int, pictures: Pictures) -> Int:
    """Return the ``row`` (F,) of every picture; in one light, a repeated one gets the row before its own.

    A picture is repeated if the wall does not move for one picture, but does before and after it. If the next
    step is a usual one, the table does not list the repetition, and all later pictures move up by a row. If
    it is twice as long, the repetition replaces a lost picture, and the later rows are correct.
    """
    size = np.abs(np.nan_to_num(pictures.step))
    usual = median_filter(size, _AROUND_STEP, mode="nearest")
    stands = (pictures.partner == np.arange(len(row)) - 1) & (size < _STANDS * usual)
    stands &= pictures.change < _STANDS * np.nanmedian(pictures.change)
    moves = size > 2 * _STANDS * usual
    again = stands[1:-1] & moves[:-2] & moves[2:]
    out = row.copy()
    for k in np.flatnonzero(again) + 1:
        counted = size[k + 1] < _ONE_STEP * usual[k + 1]
        out[k : None if counted else k + 1] -= 1
    return out


def rows_that_follow_encoder(
    row: Int, again: Bool, table: FrameTable, steps: Steps, encoder: Encoder | None
) -> Int:
    """Return rows (F,) that move up behind pictures put in, or do not, as the encoder follows the wall.

    Lights that take turns tell that a picture is there ``again`` (F,), but not whether it was put in or
    replaced another, nor whether clock and encoder were read at every stored picture. Of rows that move up
    behind all such pictures, or behind none, those are returned by which the encoder follows the wall better;
    or ``row`` itself, unless they follow it much better than that.
    """
    if encoder is None or not again.any():
        return row
    as_stored = row + np.cumsum(np.diff(row, prepend=-1) < 1)
    put_in = np.maximum(as_stored - np.cumsum(again), 0)
    return best_followed((row, as_stored, put_in), table, steps, encoder)


def best_followed(rows: tuple[Int, ...], table: FrameTable, steps: Steps, encoder: Encoder | None) -> Int:
    """Return those of several rows (F,) by which the encoder follows the wall much better than by the first.

    Without such rows, or without evidence, the first are returned.
    """
    if encoder is None:
        return rows[0]
    times = [row_times(table, r) for r in rows]
    known = steps.of(np.all([_in_table(steps, encoder, t) for t in times], 0))
    if len(known.end) < _LEAST_STEPS:
        return rows[0]
    off = [_off_the_wall(known, encoder, t) for t in times]
    best = int(np.argmin(off))
    return rows[best] if off[best] < _FOLLOWS * off[0] else rows[0]


def _in_table(steps: Steps, encoder: Encoder, time_s: Float) -> Bool:
    """Return which steps (K,) the encoder's table covers: beyond its ends no reading is known."""
    covered = (time_s >= encoder.time_s[0]) & (time_s <= encoder.time_s[-1])
    return np.asarray(covered[steps.start] & covered[steps.end])


def _off_the_wall(steps: Steps, encoder: Encoder, time_s: Float) -> float:
    """Return the share of the encoder's squared advance that the wall's, scaled to fit, does not explain."""
    read = steps.by_encoder(encoder, time_s)
    scale = float(read @ steps.size) / max(float(steps.size @ steps.size), 1e-12)
    left = read - scale * steps.size
    return float(left @ left) / max(float(read @ read), 1e-12)


def repeated(pictures: Pictures, light: Int) -> Bool:
    """Return (F,) true for pictures that differ from the one before by less than a quarter of the usual."""
    follows = pictures.partner == np.arange(len(light)) - 1
    out = np.zeros(len(light), bool)
    for kind in (Light.LINE, Light.WALL):
        like = light == kind
        compared = like & (pictures.partner >= 0)
        if compared.any():
            out |= like & follows & (pictures.change < _STANDS * np.median(pictures.change[compared]))
    return out


def copies(
    pictures: Pictures, light: Int, stated: Int, row: Int, time_s: Float, encoder: Encoder | None
) -> Bool:
    """Return (F,) true for frames that show an earlier picture again in place of their own.

    A recorder that hangs stores one picture for several frames, while the table goes on. Where lights take
    turns, such a run of copies contradicts the light that is ``stated`` (F,) by the ``row`` (F,) of each
    picture. Where the probe only stands still, each light repeats its own picture, which contradicts nothing.
    A picture that repeats the last one of its light while those around it change is a copy too, and so is a
    run of them (`_hung`). ``time_s`` (F,) are the times at which the pictures were taken.
    """
    again = repeated(pictures, light) & (np.diff(row, prepend=-1) > 0)
    runs, _ = label(again)
    contradicted = np.unique(runs[again & (light != stated)])
    alone = _repeated_alone(pictures, light) | _hung(pictures, light, time_s, encoder)
    return np.asarray((again & np.isin(runs, contradicted)) | alone)


def _repeated_alone(pictures: Pictures, light: Int) -> Bool:
    """Return (F,) true for pictures that repeat the last one of their light while those around change."""
    out = np.zeros(len(light), bool)
    for kind in (Light.LINE, Light.WALL):
        place = np.flatnonzero((light == kind) & (pictures.partner >= 0))
        if len(place) < _AROUND_STEP:
            continue
        change = pictures.change[place]
        usual = median_filter(change, _AROUND_STEP, mode="mirror")
        others = np.where(change < _STANDS * usual, np.inf, change)
        least = rank_filter(others, _LEAST_OF_AROUND, _AROUND_STEP, mode="mirror")
        changes = np.pad(change > 2 * _STANDS * usual, 1, constant_values=True)
        out[place] = (change < _STANDS * least) & changes[:-2] & changes[2:]
    return out


def _hung(pictures: Pictures, light: Int, time_s: Float, encoder: Encoder | None) -> Bool:
    """Return (F,) true where each light repeats its own last picture for a while, and the wall then jumps.

    A probe that stands still repeats them too, but moves on by a usual step, and its encoder stands as well.
    """
    out = np.zeros(len(light), bool)
    wall = np.flatnonzero((light == Light.WALL) & (pictures.partner >= 0))
    still = _unchanged(pictures, wall)
    runs, count = label(still)
    for run in range(1, count + 1):
        inside = np.flatnonzero(runs == run)
        behind = int(inside[-1]) + 1
        if len(inside) < 2 or behind == len(wall) or not _leaps(pictures.step[wall], ~still, behind):
            continue
        first, last = int(pictures.partner[wall[inside[0]]]), int(wall[inside[-1]])
        if encoder is None or _went_on(encoder, time_s, first, last):
            out |= _still_between(pictures, light, first, int(wall[behind]))
    return out


def _unchanged(pictures: Pictures, place: Int) -> Bool:
    """Return which pictures (K,) of one light change by less than a quarter of the usual change."""
    change = pictures.change[place]
    return np.asarray(change < _STANDS * np.median(change)) if len(place) else np.zeros(0, bool)


def _leaps(step: Float, moving: Bool, behind: int) -> bool:
    """Return whether the step at index ``behind`` (of K) is longer than others around it, or reversed."""
    near = np.abs(np.arange(len(step)) - behind) <= _AROUND_STEP
    usual = step[near & moving & np.isfinite(step) & (np.arange(len(step)) != behind)]
    if not usual.size or not np.isfinite(step[behind]):
        return bool(usual.size)
    return not 0 <= step[behind] / float(np.median(usual)) < _ONE_STEP


def _went_on(encoder: Encoder, time_s: Float, first: int, last: int) -> bool:
    """Return whether the encoder went on from one picture to another at half of its usual speed or more."""
    read = np.abs(np.diff(np.interp(time_s, encoder.time_s, encoder.distance_mm)))
    usual = float(np.median(read[read > 0])) if read.any() else 0.0
    return bool(read[first:last].mean() > usual / 2 > 0)


def _still_between(pictures: Pictures, light: Int, first: int, behind: int) -> Bool:
    """Return (F,) true for the pictures of both lights between two that repeat the last of their light."""
    out = np.zeros(len(light), bool)
    for kind in (Light.LINE, Light.WALL):
        place = np.flatnonzero((light == kind) & (pictures.partner >= 0))
        out[place] = _unchanged(pictures, place) & (place > first) & (place < behind)
    return out
