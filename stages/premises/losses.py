"""Finds lost pictures that the rhythm of the lights does not show, by longer steps of the wall."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Bool, Float, Int
from pipeline.recording.base import Encoder, FrameTable
from stages.premises.beside_encoder import Pace
from stages.premises.light import Light
from stages.premises.moving import lower_speed, usual_speed
from stages.premises.pictures import CLOSED, Pictures
from stages.premises.rhythm_of_steps import over_whole_periods

# A step of the wall stands out if it is this many robust σ above the steps around it. Normal noise does that
# once in 10^9 steps; matching has more outliers than normal noise (chosen).
_SIGMAS = 6.0
# Where the table has too many rows or the rhythm of the lights breaks, pictures were certainly lost, and less
# evidence is needed for their place, or for their number.
_SIGMAS_LOST = 3.5
# 0.9 quantile of normal errors in σ. It gives σ here, because errors of matching are not normal.
_NINE_IN_TEN = 1.645
# A step is compared if so many others are close by, and so many on either side (at the ends: see
# `_has_neighbours`). Chosen.
_AROUND_STEP, _ON_EACH_SIDE = 4, 2
_LEAST_STEPS = 12
# Steps that took more than so many usual times are no evidence of lost pictures: over 32 frames, of which 30
# were left out, phase correlation erred by the advance of 6 frames (open-1-field at half its size).
_LONGEST_STEP = 4.0
# The laser line jumps if it moves sideways so many times as far as it usually does, and at least half a
# pixel, in the time that would have passed. In open-1 to open-3, a01 and a09 it moves up to 3
# times as far, twice in a run more than 2.5; where all pictures of open-1 were moved by 4 px, 5.4 times.
_LINE_LEAPS, _LEAST_SWAY_PX = 2.5, 0.5
# The median of nine steps gives the usual speed if up to four of them were lengthened by a loss.
_MOST_OF_STEPS = 4 / 9
# If one in ten of the inner steps is a loss, the recorder loses pictures at the ends as well (chosen).
_OFTEN = 0.1
# The usual speed is estimated again, with the lost pictures counted, so many times.
_ROUNDS = 2
# Over a run, the wall's steps sum to the encoder's distance within this factor: single steps err by a tenth.
_MORE = 1.1
# Losses can be distinguished from errors of matching if nine in ten errors are below this part of a period.
# Errors that are as large as a period would be spread evenly over half of one, and the part would be .45. A
# single step that is farther than this from any number of lost pictures is no loss either: a noise filter
# holds texture back and then releases it.
_TOLD_APART = 1 / 3


@dataclass(frozen=True)
class _Leap:
    """A step (index into K steps) that is longer than usual by the advance of ``lost`` pictures."""

    step: int
    lost: int


@dataclass(frozen=True)
class Steps:
    """Motion of the lit wall from pictures ``start`` to pictures ``end`` (K,); ``size``: pipe radii or mm."""

    start: Int
    end: Int
    size: Float

    def of(self, use: Bool) -> Steps:
        """Return the steps in ``use`` (K,)."""
        return Steps(self.start[use], self.end[use], self.size[use])

    def by_encoder(self, encoder: Encoder, time_s: Float) -> Float:
        """Return the encoder's advance over each step (K,), in its own unit."""
        read = np.interp(time_s, encoder.time_s, encoder.distance_mm)
        return np.asarray(read[self.end] - read[self.start])


def steps_of_wall(pictures: Pictures, shown: Int, copy: Bool) -> Steps:
    """Return the steps between pictures of the lit wall, as the `Light` ``shown`` (F,) says.

    A ``copy`` (F,) has the place of the picture that it repeats.
    """
    end = np.flatnonzero((pictures.partner >= 0) & ~copy)
    start = pictures.partner[end]
    while np.any(copy[start]):
        start = np.where(copy[start], pictures.partner[start], start)
    use = (shown[end] == Light.WALL) & (shown[start] == Light.WALL) & np.isfinite(pictures.step[end])
    return Steps(start, end, pictures.step[end]).of(use)


def row_times(table: FrameTable, row: Int) -> Float:
    """Return the time of each row, s; rows beyond the table continue at its usual interval."""
    usual = float(np.median(np.diff(table.time_s))) if len(table.time_s) > 1 else 0.0
    beyond = np.maximum(row - (len(table.time_s) - 1), 0)
    return np.asarray(table.time_s[np.minimum(row, len(table.time_s) - 1)] + beyond * usual)


def sway_of_line(pictures: Pictures, light: Int) -> Float:
    """Return the laser line's sideways motion (F,) to its next picture, as a multiple of the usual one."""
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
    radius_mm: Float | float = np.nan,
    one_bore: bool = True,
) -> Int:
    """Return ``row`` (F,) with more or fewer rows skipped where the wall moves by more or less than usual.

    The lights give the number of lost pictures only up to whole periods of their rhythm. The wall's motion,
    compared with the steps around, gives the rest. A step is no evidence where the wall stands, where the
    encoder shows the same jump (the probe moved faster), over pictures that were left out (the speed is not
    known for so long), or where the line's ``sway`` (F,) jumps and the rhythm continues (the camera was
    knocked). Steps are compared in mm if the pipe's ``radius_mm`` (F,), or one for all pictures, is known: in
    another bore the same advance has another size in radii. If the encoder goes farther in all than the
    wall, a codec that repeats blocks holds usual steps back: then the encoder must agree with the loss
    rather than with the wall's step.
    """
    if len(steps.end) < _LEAST_STEPS:
        return row
    time, radius = row_times(table, row), np.broadcast_to(radius_mm, len(row))[steps.end]
    measured = bool(np.isfinite(radius).all())
    steps = replace(steps, size=steps.size * radius) if measured else steps
    period = float(np.median(np.diff(time)))
    out, left = row.copy(), len(table.frame) - 1 - int(row[-1])
    passed = np.maximum(time[steps.end] - time[steps.start], 1e-9) / period
    rhythm, over = over_whole_periods(np.rint(passed).astype(np.int64), steps.size, rhythm)
    sigmas = np.where(over > 0, _SIGMAS_LOST, _SIGMAS_LOST if left > 0 else _SIGMAS)
    leaps = _leaps(steps, passed, rhythm, over, sigmas, one_bore, left)
    leaps = [leap for leap in leaps if not _knocked(leap, steps, rhythm, sway)]
    pace = Pace.of(encoder, time, float(np.median(passed)))
    held_back = measured and _shows_more(encoder, time, steps)
    spare = set(_in_spare_rows(leaps, left))
    for leap in sorted(leaps, key=lambda one: one.step):
        start, end = int(steps.start[leap.step]), int(steps.end[leap.step])
        between_s = row_times(table, out[[start, end]])
        skips = np.diff(row[start : end + 1]) - 1
        believed = leap.lost > 0 or skips.max() + leap.lost >= 0
        believed &= _encoder_confirms(leap, pace, between_s, in_spare_rows=leap in spare)
        if held_back:
            way_mm = float(steps.size[leap.step])
            believed &= not _encoder_agrees(encoder, between_s, way_mm, _part(between_s / period, leap.lost))
        if believed:
            first = int(np.argmax(skips)) + start + 1 if skips.max() > 0 else (start + end + 1) // 2
            out[first:] += leap.lost
    return out


def _encoder_confirms(leap: _Leap, pace: Pace | None, between_s: Float, *, in_spare_rows: bool) -> bool:
    """Return whether the encoder allows a jump of the wall to be a loss, by not jumping itself.

    A loss for which the table has spare rows, or which takes back skipped rows, needs no encoder, but an
    encoder must not contradict it. Any other loss needs an encoder that is steady at all shifts of its clock
    by up to ten pictures, and known at a fifth of them.
    """
    known = in_spare_rows or leap.lost < 0
    if pace is None:
        return known
    shown = pace.excess(float(between_s[0]), float(between_s[1])) / leap.lost
    if known:
        return not shown[0] > 1 / 2
    steady = np.abs(shown[~np.isnan(shown)]) < 1 / 2
    return bool(5 * len(steady) >= len(shown) and steady.all())


def _part(between: Float, lost: int) -> float:
    """Return the share of a distance that is left if ``lost`` pictures between two times are not counted.

    ``between`` (2,) are these times, in pictures.
    """
    return 1 - lost / max(float(between[1] - between[0]) + lost, 1.0)


def _knocked(leap: _Leap, steps: Steps, rhythm: int, sway: Float) -> bool:
    """Return whether the camera was knocked: line and wall jump together, while the rhythm continues."""
    over = sway[int(steps.start[leap.step]) + 1 : int(steps.end[leap.step]) + 1]
    return bool(leap.lost % rhythm == 0 and over.max() >= _LINE_LEAPS * (1 + abs(leap.lost) / rhythm))


def _in_spare_rows(leaps: list[_Leap], left: int) -> list[_Leap]:
    """Return the jumps, given clearest first, that the rows ``left`` over in the table explain."""
    out = []
    for leap in leaps:
        if 0 < leap.lost <= left:
            out.append(leap)
            left -= leap.lost
    return out


def _leaps(
    steps: Steps, passed: Float, rhythm: int, over: Int, sigmas: Float, one_bore: bool, left: int
) -> list[_Leap]:
    """Return the steps that stand out by ``sigmas`` (K,), clearest first.

    ``passed`` (K,) is the number of pictures that the steps took by their times; ``over`` (K,) more are
    added, or whole periods beyond that. The remainder is the error of matching, which losses do not widen,
    however many there are. It counts as a part of a picture's advance or as a length, whichever is more,
    since a slow wall errs by a larger part of its advance. Where the rhythm breaks, a loss only has to fit
    better than none. Without ``one_bore``, steps of one speed differ as the bores of a gauge do, so that
    apparent losses count as error too. The table has ``left`` rows more than there are pictures. Where the
    wall stands, no step stands out.
    """
    speed = steps.size / (passed + over)
    lost, usual = _counted(steps.size, passed, rhythm, over, lower_speed(speed))
    if not usual.any():
        return []
    if np.mean(lost[usual != 0] > over[usual != 0]) < _MOST_OF_STEPS:
        lost, usual = _counted(steps.size, passed, rhythm, over, usual_speed(speed))
    moves, excess = usual != 0, _excess(steps.size, usual, passed)
    if moves.sum() < _LEAST_STEPS:
        return []
    off = np.abs(excess - lost * one_bore)
    error = np.quantile(off[moves], 0.9)
    by_speed = np.quantile((off * np.abs(usual))[moves], 0.9) / np.where(moves, np.abs(usual), 1.0)
    stand_out = (
        moves
        & (np.abs(excess) > sigmas * (np.maximum(error, by_speed) / _NINE_IN_TEN + 1e-9))
        & (lost != 0)
        & (error < _TOLD_APART * rhythm)
        & ((over > 0) | (np.abs(excess - lost) < _TOLD_APART * np.maximum(np.abs(lost), rhythm)))
    )
    # Where most breaks of the rhythm are losses, the others are likely to be losses, too.
    breaks = (over > 0) & moves
    if np.sum(stand_out & breaks) > np.sum(breaks) / 2:
        stand_out |= breaks & (lost != 0)
    stand_out &= passed < _LONGEST_STEP * np.median(passed)
    often = np.mean(stand_out[_ON_EACH_SIDE:-_ON_EACH_SIDE]) > _OFTEN
    stand_out &= _has_neighbours(steps, passed, breaks | often | ((lost > 0) & (lost <= left)))
    clearest = sorted(np.flatnonzero(stand_out), key=lambda k: -abs(float(excess[k])))
    return [_Leap(int(k), int(lost[k])) for k in clearest]


def _has_neighbours(steps: Steps, passed: Float, believed: Bool) -> Bool:
    """Return which steps (K,) have four others close by, and two on either side unless ``believed`` (K,).

    Where steps are missing, as at the end of a gauge, the speed may have changed meanwhile: steps farther off
    than one and a half times the span of four steps are not compared. At the ends of a run a loss looks like
    a probe that speeds up. There it counts only if the rhythm breaks as well, the table has rows for it, or
    pictures are lost all the time.
    """
    middle, own = (steps.start + steps.end) / 2, np.arange(len(steps.end))
    far = 1.5 * _AROUND_STEP * np.median(passed)  # half as many again
    before = own - np.searchsorted(middle, middle - far)
    behind = np.searchsorted(middle, middle + far, side="right") - own - 1
    beside = believed | (np.minimum(before, behind) >= _ON_EACH_SIDE)
    return np.asarray(beside & (before + behind >= _AROUND_STEP))


def _counted(size: Float, passed: Float, rhythm: int, over: Int, usual: Float) -> tuple[Int, Float]:
    """Return the number of lost pictures (K,), and the usual speed (K,) after these are counted.

    ``usual`` (K,) is the speed to start from.
    """
    for _ in range(_ROUNDS):
        excess = _excess(size, usual, passed)
        lost = over + rhythm * np.rint((excess - over) / rhythm).astype(np.int64)
        lost = np.where(usual != 0, lost, 0)
        usual = usual_speed(size / np.maximum(passed + lost, 0.5))
    return lost, usual


def _excess(size: Float, usual: Float, passed: Float) -> Float:
    """Return the pictures (K,) by which steps are longer than at the usual speed; 0 where the wall stands."""
    return np.where(usual != 0, size / np.where(usual != 0, usual, 1.0) - passed, 0.0)


def _shows_more(encoder: Encoder | None, time_s: Float, steps: Steps) -> bool:
    """Return whether the encoder goes farther than the wall over all steps: a codec holds the wall back."""
    if encoder is None:
        return False
    shown = steps.by_encoder(encoder, time_s).sum()
    return bool(abs(shown) > _MORE * abs(steps.size.sum()))


def _encoder_agrees(encoder: Encoder | None, time_s: Float, way_mm: float, part: float) -> bool:
    """Return whether the encoder's advance between two times is nearer to ``way_mm`` than to ``part`` of it.

    Its sign may not be known yet.
    """
    if encoder is None or time_s[0] < encoder.time_s[0] or time_s[1] > encoder.time_s[-1]:
        return False
    shown_mm = float(np.diff(np.interp(time_s, encoder.time_s, encoder.distance_mm))[0])
    return abs(abs(shown_mm) - abs(way_mm)) < abs(abs(shown_mm) - abs(part * way_mm))
