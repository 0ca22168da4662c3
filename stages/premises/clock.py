"""Checks the camera's clock: its rate, and jumps in its times that neither wall nor encoder shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Float, Int
from pipeline.machine.stage import Context
from pipeline.recording.base import Encoder, FrameTable, Recording
from stages.premises.losses import Steps

# A gap of more frame times than this may be a jump of the clock; lost pictures that the table shows make
# shorter gaps.
_GAP = 4.0
# Two advances agree within this factor, since steps err by a tenth. The clock jumped if the wall's step over
# the gap agrees with a usual one, and the encoder's step agrees with it only after the gap is removed.
_LIKE = 2.0
# Frame rates that differ by a larger factor are reported: recorders round 29.97 to 30 (chosen).
_OTHER_RATE = 1.2
_FEWEST = 8
# Times count as even if their steps differ by less than this part: tables round to a millisecond or finer.
_EVEN = 0.1


@dataclass(frozen=True)
class ClockJump:
    """The clock jumped by ``by_s`` before picture ``place``."""

    place: int
    by_s: float


def clock_jumps(time_s: Float, steps: Steps, encoder: Encoder | None) -> list[ClockJump]:
    """Return the gaps in the times (F,) of pictures over which the wall moved by only a usual step.

    If the encoder also shows a usual step after the gap is removed, and not with the stated times, the clock
    jumped. If it shows one with the stated times, the probe stood meanwhile and the times are right.
    """
    period = float(np.median(np.diff(time_s))) if len(time_s) > 1 else 0.0
    if encoder is None or len(steps.end) < _FEWEST:
        return []
    gap = np.flatnonzero(np.diff(time_s) > _GAP * period) + 1
    found = [ClockJump(int(k), float(time_s[k] - time_s[k - 1] - period)) for k in gap]
    return [jump for jump in found if _jumped(jump, time_s, steps, encoder)]


def without_jumps(time_s: Float, jumps: list[ClockJump]) -> Float:
    """Return times (F,) without the jumps of the clock."""
    out = time_s.copy()
    for jump in jumps:
        out[jump.place :] -= jump.by_s
    return out


def without_stretch(time_s: Float, row: Int, table: FrameTable, frame_rate: float) -> Float:
    """Return times (F,) of pictures, corrected if some were lost and the table spaces the others evenly.

    Such a table begins and ends with the video and has the mean rate of the remaining pictures; its times are
    spread over the rows that were found. A table that only counts pictures has the camera's own
    ``frame_rate`` and ends too early; its times are returned unchanged.
    """
    step_s, last = np.diff(table.time_s), int(row[-1])
    if last < len(table.time_s) or len(step_s) == 0 or np.ptp(step_s) > _EVEN * np.median(step_s):
        return time_s
    span_s = float(table.time_s[-1] - table.time_s[0])
    rates = np.array([len(step_s), last]) / span_s
    if abs(np.log(rates[1] / frame_rate)) > abs(np.log(rates[0] / frame_rate)):
        return time_s
    return np.asarray(table.time_s[0] + span_s / last * row)


def _jumped(jump: ClockJump, time_s: Float, steps: Steps, encoder: Encoder) -> bool:
    over = (steps.start < jump.place) & (steps.end >= jump.place)
    usual = float(np.median(steps.size[~over])) if not over.all() else 0.0
    if not over.any() or usual == 0:
        return False
    by_encoder = steps.by_encoder(encoder, time_s)
    moving = ~over & (steps.size / usual > 1 / _LIKE)
    mm_per_radius = float(np.median(by_encoder[moving] / steps.size[moving]))
    wall = float(np.median(steps.size[over])) * mm_per_radius
    stated = float(np.median(by_encoder[over]))
    mended = float(np.median(steps.by_encoder(encoder, without_jumps(time_s, [jump]))[over]))
    return _alike(wall, usual * mm_per_radius) and not _alike(stated, wall) and _alike(mended, wall)


def _alike(one: float, other: float) -> bool:
    return bool(one * other > 0 and 1 / _LIKE < one / other < _LIKE)


def warn_of_clock(jumps: list[ClockJump], time_s: Float, recording: Recording, context: Context) -> None:
    """Warn of jumps of the clock, and of a frame rate that differs from the stated one."""
    for jump in jumps:
        context.warn(
            f"the clock of frames.csv jumps by {jump.by_s:.3g} s before frame "
            f"{recording.frames.frame[jump.place]}: wall and encoder go on as from one picture to the next. "
            "The jump is removed from the times. What to do: nothing, or find out what set the clock"
        )
    if len(time_s) < 2:
        return
    rate = 1 / float(np.median(np.diff(time_s)))
    if max(rate / recording.frame_rate, recording.frame_rate / rate) > _OTHER_RATE:
        context.warn(
            f"frames.csv has {rate:.3g} frames per second, recording.yaml states "
            f"{recording.frame_rate:g}. What to do: check the unit (s) of time_s; speeds and the encoder's "
            "alignment with the pictures depend on it"
        )
