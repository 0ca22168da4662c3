"""Lost pictures that the rhythm of the lights does not show: the wall leaps on over them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from pipeline.arrays import Bool, Float, Int
from pipeline.recording.base import Encoder, FrameTable
from stages.premises.light import Light
from stages.premises.pictures import CLOSED, Pictures

# A step of the wall stands out when it is so many robust σ above the steps around it: by noise alone once in
# 10^9 steps, were they normal; matching errs worse than that, and six is what outliers need everywhere here.
_SIGMAS = 6.0
# Where the table has too many rows or the rhythm of the lights breaks, pictures were surely lost, and less
# evidence is needed for where, or for how many.
_SIGMAS_LOST = 3.5
# 0.9 quantile of normal errors in σ. It gives σ here, because errors of matching are not normal.
_NINE_IN_TEN = 1.645
# Steps on either side from which the usual speed is taken.
_AROUND_STEP = 9
_LEAST_STEPS = 12
# Steps that took more than so many usual times tell nothing of lost pictures: over 32 frames, of which 30
# were left out, phase correlation erred by the advance of 6 frames (open-1-field at half its size).
_LONGEST_STEP = 4.0
# The laser line leaps where it moves across so many times as far as it usually does, of at least half a
# pixel, in the time that would have passed. In open-1 to open-3, a01 and a09 it moves up to 3
# times as far, twice in a run more than 2.5; where all pictures of open-1 were moved by 4 px, 5.4 times.
_LINE_LEAPS, _LEAST_SWAY_PX = 2.5, 0.5
# The usual speed is taken anew, with the lost pictures counted, so many times.
_ROUNDS = 2
# Over a run, the wall's steps make the encoder's way within this factor: single steps err by a tenth.
_MORE = 1.1
# Errors of matching beyond whole periods are told from lost pictures where nine in ten are below this part of
# a period: if they were anything, they would be spread evenly over half a period, and .45 would be the part.
_TOLD_APART = 1 / 3
# The encoder is looked at over so many frames on either side of a leap.
_NEARBY = 10


@dataclass(frozen=True)
class Steps:
    """Motion of the lit wall from picture ``start`` to ``end`` (K,): ``size`` in pipe radii."""

    start: Int
    end: Int
    size: Float

    def by_encoder(self, encoder: Encoder, time_s: Float) -> Float:
        """Return by how much the encoder advances over each step (K,), in its own unit."""
        read = np.interp(time_s, encoder.time_s, encoder.distance_mm)
        return np.asarray(read[self.end] - read[self.start])


def steps_of_wall(pictures: Pictures, shown: Int, copy: Bool) -> Steps:
    """Return the steps between pictures that are ``shown`` (F,) to be of the lit wall, or are stated to be.

    A picture that is a ``copy`` (F,) has the place of the one that it repeats.
    """
    end = np.flatnonzero((pictures.partner >= 0) & ~copy)
    start = pictures.partner[end]
    while np.any(copy[start]):
        start = np.where(copy[start], pictures.partner[start], start)
    use = (shown[end] == Light.WALL) & (shown[start] == Light.WALL) & np.isfinite(pictures.step[end])
    return Steps(start[use], end[use], pictures.step[end[use]])


def row_times(table: FrameTable, row: Int) -> Float:
    """Return the time of each row; rows beyond the table go on at its usual pace."""
    usual = float(np.median(np.diff(table.time_s))) if len(table.time_s) > 1 else 0.0
    beyond = np.maximum(row - (len(table.time_s) - 1), 0)
    return np.asarray(table.time_s[np.minimum(row, len(table.time_s) - 1)] + beyond * usual)


def sway_of_line(pictures: Pictures, light: Int) -> Float:
    """Return how far (F,) the laser line moves sideways to its next picture, in multiples of the usual."""
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
    radius_mm: float = np.nan,
    one_bore: bool = True,
) -> Int:
    """Return ``row`` (F,) with more or fewer rows skipped where the wall moves by more or less than usual.

    The lights give the number of lost pictures only up to whole periods of their rhythm. How far the wall
    moved, compared with the steps around, gives the rest. Steps tell nothing where the encoder shows the
    same leap (the probe moved faster), over pictures that were left out (the speed is not known for so long),
    where the line's ``sway`` (F,) leaps and the rhythm goes on (the camera was knocked), or where the encoder
    agrees with the wall, by the pipe's ``radius_mm``, rather than with the loss. That is asked where half the
    way or more would be missing, and of all where the encoder shows more in all: a codec that repeats blocks
    holds back usual steps.
    """
    if len(steps.end) < _LEAST_STEPS:
        return row
    time = row_times(table, row)
    period = float(np.median(np.diff(time)))
    out, left = row.copy(), len(table.frame) - 1 - int(row[-1])
    held_back = _shows_more(encoder, time, steps, radius_mm)
    passed = np.maximum(time[steps.end] - time[steps.start], 1e-9) / period
    rhythm, over = _over_whole_periods(np.rint(passed).astype(np.int64), rhythm)
    sigmas = np.where(over > 0, _SIGMAS_LOST, _SIGMAS_LOST if left > 0 else _SIGMAS)
    for start, end, lost, size in _leaps(steps, passed, rhythm, over, sigmas, one_bore):
        skips = np.diff(row[start : end + 1]) - 1
        believed = left >= lost or _encoder_was_steady(encoder, float(time[end]), period)
        part = 1 - lost / max((time[end] - time[start]) / period + lost, 1.0)
        # No error of the pipe's radius makes the wall's way twice the encoder's.
        if held_back or part <= 1 / 2:
            believed &= not _encoder_agrees(encoder, time[[start, end]], size * radius_mm, part)
        if lost % rhythm == 0:
            believed &= sway[start + 1 : end + 1].max() < _LINE_LEAPS * (1 + abs(lost) / rhythm)
        if (lost > 0 and believed) or (lost < 0 and skips.max() + lost >= 0):
            first = int(np.argmax(skips)) + start + 1 if skips.max() > 0 else (start + end + 1) // 2
            out[first:] += lost
            left -= lost
    return out


def _over_whole_periods(pictures: Int, rhythm: int) -> tuple[int, Int]:
    """Return the rhythm, and how many lost pictures (K,) make steps over so many whole periods of it.

    Where most steps span the same number of pictures, two or more, one picture in each period shows the wall.
    """
    counts, often = np.unique(pictures, return_counts=True)
    usual = int(counts[np.argmax(often)])
    return (usual, -pictures % usual) if usual > 1 else (rhythm, np.zeros_like(pictures))


def _leaps(
    steps: Steps, passed: Float, rhythm: int, over: Int, sigmas: Float, one_bore: bool
) -> list[tuple[int, int, int, float]]:
    """Return (start, end, lost pictures, size) of steps that stand out by ``sigmas`` (K,), clearest first.

    ``passed`` (K,) is how many pictures they took by their times, to which ``over`` (K,) or a number of
    whole periods more is to be added. The error of matching is what is then left: losses do not widen it,
    however many there are. Where the rhythm breaks, a loss has only to fit better than none. Without
    ``one_bore`` steps of one speed differ as the bores of a gauge do: what looks like losses is error, too.
    """
    excess = steps.size / _usual_speed(steps.size / passed, over == 0) - passed
    for _ in range(_ROUNDS):
        lost = over + rhythm * np.rint((excess - over) / rhythm).astype(np.int64)
        speed = steps.size / np.maximum(passed + lost, 0.5)
        excess = steps.size / _usual_speed(speed, np.ones(len(lost), bool)) - passed
    error = np.quantile(np.abs(excess - lost * one_bore), 0.9)
    stand_out = (
        (np.abs(excess) > sigmas * (error / _NINE_IN_TEN + 1e-9))
        & (lost != 0)
        & (error < _TOLD_APART * rhythm)
    )
    # Where most breaks of the rhythm are losses, the others are likely to be losses, too.
    breaks = over > 0
    if np.sum(stand_out & breaks) > np.sum(breaks) / 2:
        stand_out |= breaks & (lost != 0)
    stand_out &= passed < _LONGEST_STEP * np.median(passed)
    clearest = sorted(np.flatnonzero(stand_out), key=lambda k: -abs(float(excess[k])))
    return [(int(steps.start[k]), int(steps.end[k]), int(lost[k]), float(steps.size[k])) for k in clearest]


def _usual_speed(speed: Float, known: Bool) -> Float:
    """Return the usual speed about each step (K,) by those ``known`` (K,); where it is 0, none compares."""
    at = np.flatnonzero(known) if known.sum() >= _LEAST_STEPS else np.arange(len(speed))
    usual = np.interp(np.arange(len(speed)), at, median_filter(speed[at], _AROUND_STEP, mode="nearest"))
    return np.where(usual == 0, np.inf, usual)


def _shows_more(encoder: Encoder | None, time_s: Float, steps: Steps, radius_mm: float) -> bool:
    """Return whether the encoder advances by more than the wall over all steps: matching held them back."""
    if encoder is None or not np.isfinite(radius_mm):
        return False
    shown = steps.by_encoder(encoder, time_s).sum()
    return bool(abs(shown) > _MORE * radius_mm * abs(steps.size.sum()))


def _encoder_agrees(encoder: Encoder | None, time_s: Float, way_mm: float, part: float) -> bool:
    """Return whether the encoder advances between two times by ``way_mm`` rather than by ``part`` of it."""
    if encoder is None or time_s[0] < encoder.time_s[0] or time_s[1] > encoder.time_s[-1]:
        return False
    shown_mm = float(np.diff(np.interp(time_s, encoder.time_s, encoder.distance_mm))[0])
    return abs(shown_mm - way_mm) < abs(shown_mm - part * way_mm)


def _encoder_was_steady(encoder: Encoder | None, time_s: float, period_s: float) -> bool:
    """Return whether the encoder advances evenly around a time; False where it is not known."""
    if encoder is None or not encoder.time_s[0] < time_s < encoder.time_s[-1]:
        return False
    at = time_s + period_s * np.arange(-_NEARBY, _NEARBY + 1)
    step = np.diff(np.interp(at, encoder.time_s, encoder.distance_mm))
    usual = float(np.median(step))
    # A probe that turns back moves as fast as before, but not evenly.
    return bool(np.abs(step).max() < 2 * abs(usual) and np.all(step * usual >= 0))
