"""Recordings whose tables do not fit their pictures, made of good ones without encoding a picture again."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Image, Int
from pipeline.recording.base import FrameSource, FrameTable, Planes, Recording
from pipeline.recording.checks import CheckedFrames


@dataclass(frozen=True)
class KeptFrames:
    """Delivers, under new numbers, the frames ``kept`` (N,) of a source; some may come twice."""

    source: FrameSource
    kept: Int

    @property
    def image_size(self) -> tuple[int, int]:
        return self.source.image_size

    def read(self, frames: Sequence[int] | Int, planes: Planes) -> Iterator[tuple[int, Image | None]]:
        wanted = self.kept[np.asarray(frames)]
        images = self.source.read(np.unique(wanted), planes)
        held: tuple[int, Image | None] = (-1, None)
        for frame, number in zip(frames, wanted, strict=True):
            if held[0] != number:
                number_read, image = next(images)
                held = (number_read, None if image is None else image.copy())
            yield int(frame), held[1]


@dataclass(frozen=True)
class Spoiled:
    """A recording with a wrong table, and its right table."""

    recording: Recording
    right: FrameTable

    def wrong(self, found: CheckedFrames) -> tuple[int, int]:
        """Return in how many frames the light and the time are wrong.

        Errors up to a tenth of a period do not count.
        """
        tenth = 0.1 * float(np.median(np.diff(self.right.time_s)))
        lights = self.right.illumination[found.frame] != found.illumination
        times = np.abs(self.right.time_s[found.frame] - found.time_s) > tenth
        return int(lights.sum()), int(times.sum())


Spoiler = Callable[[Recording, np.random.Generator], Spoiled]


def first_frames(recording: Recording, count: int) -> Recording:
    """Return the beginning of a recording."""
    return replace(recording, frames=_rows(recording.frames, slice(count)), listed=None)


def unspoiled(recording: Recording, random: np.random.Generator) -> Spoiled:
    return Spoiled(recording, recording.frames)


def lost(count: int, *, together: bool = False, table_cut: bool = False) -> Spoiler:
    """Return a change that loses pictures while the table goes on; the table may end with the pictures."""

    def spoil(recording: Recording, random: np.random.Generator) -> Spoiled:
        frames = len(recording.frames.frame)
        inside = np.arange(10, frames - 10)
        first = int(random.choice(inside))
        gone = first + np.arange(count) if together else random.choice(inside, count, replace=False)
        return _kept(recording, np.setdiff1d(np.arange(frames), gone), table_cut=table_cut)

    return spoil


def lost_often(which: Callable[[Int, np.random.Generator], Int], *, spread: bool) -> Spoiler:
    """Return a change that loses pictures ``which`` selects of 0 … N−1, with a table made afterwards.

    Its times number the remaining pictures from the start, or ``spread`` them evenly up to the true end.
    """

    def spoil(recording: Recording, random: np.random.Generator) -> Spoiled:
        whole = recording.frames
        kept = np.setdiff1d(np.arange(len(whole.frame)), which(np.arange(1, len(whole.frame) - 1), random))
        right = replace(_rows(whole, kept), frame=np.arange(len(kept)))
        last_s = right.time_s[-1] if spread else whole.time_s[len(kept) - 1]
        table = replace(right, time_s=np.linspace(whole.time_s[0], last_s, len(kept)))
        source = KeptFrames(recording.source, kept)
        return Spoiled(replace(recording, frames=table, listed=table, source=source), right)

    return spoil


def _pairs(frame: Int, random: np.random.Generator) -> Int:
    return frame[frame // 2 % 6 == 3]


def _one_in_five(frame: Int, random: np.random.Generator) -> Int:
    return frame[frame % 5 == 4]


def _at_random(frame: Int, random: np.random.Generator) -> Int:
    return frame[random.random(len(frame)) < 0.1]


def repeated(recording: Recording, random: np.random.Generator) -> Spoiled:
    """Show one picture twice, while the table lists it once."""
    frames = len(recording.frames.frame)
    return _kept(recording, np.sort(np.append(np.arange(frames), random.integers(10, frames - 10))))


def cut_short(recording: Recording, random: np.random.Generator) -> Spoiled:
    """Keep only the first quarter of the pictures."""
    return _kept(recording, np.arange(len(recording.frames.frame) // 4))


def swapped_from(recording: Recording, random: np.random.Generator) -> Spoiled:
    """Exchange laser and led from some frame on."""
    frames = len(recording.frames.frame)
    return _relabelled(recording, np.arange(frames) >= random.integers(10, frames - 10))


def wrong_at_random(recording: Recording, random: np.random.Generator) -> Spoiled:
    """Make one light in ten wrong."""
    frames = len(recording.frames.frame)
    wrong = np.zeros(frames, bool)
    wrong[random.choice(frames, frames // 10, replace=False)] = True
    return _relabelled(recording, wrong)


def wrong_and_lost(recording: Recording, random: np.random.Generator) -> Spoiled:
    """Make one light in ten wrong and lose a picture."""
    wrong = wrong_at_random(recording, random).recording
    seen = lost(1)(wrong, random)
    kept = seen.recording.source.kept  # type: ignore[attr-defined]
    return replace(seen, right=_rows(recording.frames, kept))


def _relabelled(recording: Recording, wrong: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> Spoiled:
    light = recording.frames.illumination.astype("U8")
    other = np.where(light == "laser", "led", "laser")
    table = replace(recording.frames, illumination=np.where(wrong, other, light))
    return Spoiled(replace(recording, frames=table, listed=table), recording.frames)


def _kept(recording: Recording, kept: Int, *, table_cut: bool = False) -> Spoiled:
    listed, count = recording.frames, min(len(kept), len(recording.frames.frame))
    frames = _rows(listed, slice(count))
    source = KeptFrames(recording.source, kept)
    spoiled = replace(recording, frames=frames, listed=frames if table_cut else listed, source=source)
    right = replace(_rows(listed, kept[:count]), frame=np.arange(count))
    return Spoiled(spoiled, right)


def _rows(table: FrameTable, rows: slice | Int) -> FrameTable:
    return FrameTable(table.frame[rows], table.time_s[rows], table.illumination[rows])


SPOILERS: dict[str, Spoiler] = {
    "as it is": unspoiled,
    "1 frame lost, not shifted": lost(1),
    "5 frames lost, not shifted": lost(5),
    "2 neighbours lost, not shifted": lost(2, together=True),
    "1 frame lost, table cut": lost(1, table_cut=True),
    "labels swapped from a frame on": swapped_from,
    "10 % wrong at random": wrong_at_random,
    "10 % wrong and 1 frame lost": wrong_and_lost,
    "1 frame twice": repeated,
    "a quarter left": cut_short,
    "pairs lost evenly, times counted": lost_often(_pairs, spread=False),
    "pairs lost evenly, times spread": lost_often(_pairs, spread=True),
    "one in five lost, times spread": lost_often(_one_in_five, spread=True),
    "10 % lost, times counted": lost_often(_at_random, spread=False),
    "10 % lost, times spread": lost_often(_at_random, spread=True),
}
