"""Differences between a recording's tables and its pictures, and the warnings about them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Bool, Float, Int
from pipeline.errors import UnusableError
from pipeline.machine.stage import Context
from pipeline.recording.base import FrameTable
from stages.premises.light import Light
from stages.premises.pictures import Pictures

_SHOWN = 8
# A picture counts as combed if the difference of neighbouring rows is this many times that of rows two apart,
# and a recording as interlaced if at least this share of its pictures is combed. The ratio is 1.0 ± 0.06 in
# noise, .3 to .4 in lit pictures of open-1 to open-3, a01 and a05, and 1.7 to 5 where every second row is
# from two frames later. Pictures of the laser line are never combed: the line moves too little.
_COMBED, _MANY_COMBED = 1.3, 0.25


@dataclass(frozen=True)
class Changes:
    """Differences between the stated frames of a recording and its pictures."""

    frames: FrameTable
    label: NDArray[np.str_]
    row: Int
    time_s: Float

    @property
    def relabelled(self) -> Bool:
        """(F,) true where the light differs from the stated one."""
        return np.asarray(self.label != self.frames.illumination)

    @property
    def retimed(self) -> Bool:
        """(F,) true where the time differs from the stated one."""
        return np.asarray(self.time_s != self.frames.time_s)

    @property
    def rows_later(self) -> Int:
        """(F,) how many rows of the table later than its own a frame belongs to; negative: earlier."""
        return self.row - np.arange(len(self.row))

    def lost(self) -> list[tuple[int, int]]:
        """Return (frame, number of pictures lost before it) for every frame after a loss."""
        skipped = np.diff(self.row, prepend=-1) - 1
        return [(int(self.frames.frame[k]), int(skipped[k])) for k in np.flatnonzero(skipped > 0)]


def warn_of_frames(
    changes: Changes, pictures: Pictures, light: Int, table: FrameTable, context: Context
) -> None:
    """Warn of lost pictures, wrong labels, a video that ends early and pictures that show nothing."""
    frame = changes.frames.frame
    _warn_of_lost(changes, context)
    _warn_of_lights(changes, context)
    _warn_of_repeats(changes, table, context)
    warn_of(frame[~pictures.seen], "that cannot be decoded", "copy the video again", context)
    dark = (light == Light.UNKNOWN) & pictures.seen & np.any(light != Light.UNKNOWN)
    warn_of(
        frame[dark], "that show neither a laser line in the dark nor a lit wall; their stated light is used",
        "look at them: the lens was covered, a lamp failed, or daylight came in", context,
    )  # fmt: skip


def _warn_of_lost(changes: Changes, context: Context) -> None:
    lost = changes.lost()
    if lost:
        context.warn(
            f"{_pictures(sum(n for _, n in lost))} lost that the times in frames.csv do not show: before "
            f"{_listed([f'frame {f} ({n})' for f, n in lost])}. "
            f"The {(changes.rows_later > 0).sum()} frames after them now have the times and lights of the "
            "rows that belong to them. What to do: nothing, if the recorder is known to drop frames; else "
            "correct frames.csv"
        )


def _warn_of_lights(changes: Changes, context: Context) -> None:
    wrong = changes.frames.frame[changes.relabelled & (changes.rows_later == 0)]
    if wrong.size:
        context.warn(
            f"{_pictures(len(wrong))} in another light than frames.csv states: frame {_listed(wrong)}. The "
            "light that the pictures show is used. What to do: correct the column illumination"
        )


def _warn_of_repeats(changes: Changes, table: FrameTable, context: Context) -> None:
    """Warn of a video that ends before its table, and of pictures that repeat the one before."""
    repeats = np.diff(changes.row, prepend=-1) < 1
    left = len(table.frame) - 1 - int(changes.row[-1]) - int(repeats.sum())
    if left > 0:
        context.warn(
            f"the video ends early: it lacks the last {left} of the {len(table.frame)} frames in frames.csv. "
            "Only the frames in the video are measured. What to do: copy the video again, it may be cut off"
        )
    earlier = int(((changes.rows_later < 0) & ~repeats).sum())
    hint = (
        f"check whether the recorder inserts pictures: the {earlier} frames after them now have the times of "
        "earlier rows. If it inserts none, correct frames.csv"
    )
    what = "left out, since they repeat the picture before"
    warn_of(
        changes.frames.frame[repeats], what, hint if earlier else "nothing, or repair the recorder", context
    )


def interlaced(pictures: Pictures) -> bool:
    """Return whether odd and even rows were taken at different times, or in different light."""
    return bool(np.mean(pictures.combing > _COMBED) > _MANY_COMBED)


def refuse_or_warn_of_interlacing(mend: bool, context: Context) -> None:
    """Warn that only even rows are used.

    Raises
    ------
    UnusableError
        When ``mend`` is false, so that interlaced pictures are refused.
    """
    what = "the pictures are interlaced: odd and even rows differ in time or in light"
    hint = "set camera and recorder to progressive"
    if not mend:
        raise UnusableError("premises", what, hint=f"{hint}, or let premises.mend be true")
    context.warn(f"{what}. Only even rows are used, which halves the vertical resolution. What to do: {hint}")


def refuse_unmended(changes: Changes, mend: bool) -> None:
    """Refuse a recording whose lights or times would have to be corrected.

    Raises
    ------
    UnusableError
        When ``mend`` is false and some are wrong.
    """
    wrong = changes.frames.frame[changes.relabelled | changes.retimed]
    if wrong.size and not mend:
        raise UnusableError(
            "premises",
            f"from frame {wrong[0]} on, lights or times of frames.csv do not belong to the pictures",
            frames=wrong.tolist(),
            hint="correct frames.csv, or let premises.mend be true",
        )


@dataclass(frozen=True)
class LeftOut:
    """Pictures that are left out, by reason; each (F,) bool.

    Attributes
    ----------
    outside
        Pictures taken before the first laser line, or after the last.
    astray
        Pictures stored in another order than they were taken.
    copy
        Pictures that repeat an earlier one.
    """

    outside: Bool
    astray: Bool
    copy: Bool

    @property
    def any(self) -> Bool:
        """(F,) true where a picture is left out."""
        return np.asarray(self.outside | self.astray | self.copy)

    def warn(self, frame: Int, context: Context) -> None:
        """Warn which of the frames (F,) are left out, and why."""
        warn_of(
            frame[self.outside], "left out: taken before the first laser line or after the last",
            "nothing, if the probe was outside the pipe there; else find out why the laser was off", context,
        )  # fmt: skip
        warn_of(
            frame[self.astray], "left out: stored in another order than taken",
            "check whether the recorder, or the program that cut the video, reorders pictures", context,
        )  # fmt: skip
        warn_of(
            frame[self.copy],
            "left out, since the recorder hung, or the codec repeated the picture before",
            "nothing, if the wall passed meanwhile need not be inspected; else record again", context,
        )  # fmt: skip


def warn_of(frame: Int, what: str, hint: str, context: Context) -> None:
    """Warn ``what`` is wrong with the pictures of these frames, and what to do (``hint``); not if empty."""
    if frame.size:
        context.warn(f"{_pictures(len(frame))} {what}: frame {_listed(frame)}. What to do: {hint}")


def _pictures(count: int) -> str:
    return f"{count} picture{'s' * (count != 1)}"


def _listed(names: Sequence[str] | Int) -> str:
    more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    return ", ".join(map(str, names[:_SHOWN])) + more
