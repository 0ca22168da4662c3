"""Frames of a video file, selected by number, decoded in order."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

import av
import numpy as np

from pipeline.arrays import Image, Int
from pipeline.errors import InputError
from pipeline.recording.base import FrameTable, Planes, ascending, complete, in_background
from pipeline.recording.images import shown
from pipeline.recording.video_index import VideoIndex, list_frames

# Decoding of a sound file; fixed, so that the memory taken does not depend on the machine.
_THREADS = 4
# Restarting the decoder costs about as much as decoding this many frames.
_RESTART_FRAMES = 8
# A decoder holds back at most this many frames: 16 for reordering and one a thread.
_HELD_BACK = 16 + _THREADS
# Frames decoded ahead of the processed one, and the number from which a separate thread is worth it.
AHEAD, FEW = 12, 3
# Times of a frame in video and table are the same when they differ by less than this part of a period.
_SAME_TIME = 0.25


@dataclass(frozen=True)
class VideoSource:
    """Frames of a video file, which its index numbers in order of presentation.

    Attributes
    ----------
    path, index
    image_size : (int, int)
        Width and height, px.
    numbers : (N,) int
        Number of each frame of the file, ascending; see `numbered_by`.
    """

    path: Path
    index: VideoIndex
    image_size: tuple[int, int]
    numbers: Int

    @property
    def count(self) -> int:
        """One more than the highest number."""
        return int(self.numbers[-1]) + 1

    def numbered_by(self, table: FrameTable) -> VideoSource:
        """Return the source with numbers taken from a table of frames by their times.

        A file that lost frames while it was written has fewer than the table lists. If frames were numbered
        by counting, those after the gap would get the light of others. If the times do not agree, frames
        are numbered by counting nevertheless.
        """
        if not self.index.timed or self.numbers.size >= table.frame.size or table.frame.size < 2:
            return self
        shown_s = (self.index.pts - self.index.pts[0]) * self.index.unit_s
        listed_s = table.time_s - table.time_s[0]
        nearest = np.searchsorted((listed_s[1:] + listed_s[:-1]) / 2, shown_s)
        off_s = np.abs(shown_s - listed_s[nearest])
        agrees = off_s.max() < _SAME_TIME * float(np.median(np.diff(listed_s)))
        if not (agrees and np.all(np.diff(nearest) > 0)):
            return self
        numbers = table.frame[nearest]
        gaps = np.flatnonzero(np.diff(nearest) > 1) + 1
        return replace(self, numbers=numbers, index=self.index.with_gaps(gaps))

    def read(self, frames: Sequence[int] | Int, planes: Planes) -> Iterator[tuple[int, Image | None]]:
        """See `FrameSource.read`; frames that the file does not hold yield None."""
        wanted = ascending(frames)
        found = ((number, shown(frame, planes)) for number, frame in self.decoded(wanted))
        return found if wanted.size < FEW else in_background(found, AHEAD)

    def decoded(self, wanted: Int) -> Iterator[tuple[int, av.VideoFrame | None]]:
        """Yield the frames of ascending numbers as they are decoded; None where one cannot be trusted."""
        return complete(wanted, self._sound(np.flatnonzero(np.isin(self.numbers, wanted))))

    def _sound(self, places: Int) -> Iterator[tuple[int, av.VideoFrame]]:
        for stretch in _stretches(places, self.index):
            for place, frame in complete(stretch, self._decode(stretch)):
                if frame is not None:
                    yield int(self.numbers[place]), frame

    def _decode(self, wanted: Int) -> Iterator[tuple[int, av.VideoFrame]]:
        """Yield the frames that can be trusted, from the keyframe before the first wanted one on.

        A frame is held back until the frames that may be coded before it, but are shown later, are known to
        be sound.
        """
        damaged = set(self.index.broken.tolist())
        held: deque[tuple[int, av.VideoFrame]] = deque()
        for number, frame in self._numbered(wanted, damaged):
            held.append((number, frame))
            while held and (self.index.settled[held[0][0]] <= number or len(held) > _HELD_BACK):
                yield from self._trusted(*held.popleft(), damaged)
        for number, frame in held:
            yield from self._trusted(number, frame, damaged)

    def _trusted(
        self, number: int, frame: av.VideoFrame, damaged: set[int]
    ) -> Iterator[tuple[int, av.VideoFrame]]:
        if (frame.width, frame.height) == self.image_size and not self.index.reached(number, damaged):
            yield number, frame

    def _numbered(self, wanted: Int, damaged: set[int]) -> Iterator[tuple[int, av.VideoFrame]]:
        """Yield decoded frames in order with their numbers; ``damaged`` grows by those that are not sound.

        After the first damage, one thread decodes again from the keyframe before it: with several, it
        depends on their timing whether a frame predicted from the damaged one is marked as damaged too.
        """
        resumed = int(self.index.key_of[wanted[0]])
        for number, frame in self._in_order(wanted, resumed, _THREADS):
            if number is None or frame is None:
                break
            yield number, frame
            resumed = number + 1
        else:
            return
        for number, frame in self._in_order(wanted, resumed, 1):
            if frame is None:
                damaged.update(() if number is None else (number,))
            elif number is not None and number >= resumed:
                yield number, frame

    def _in_order(
        self, wanted: Int, first: int, threads: int
    ) -> Iterator[tuple[int | None, av.VideoFrame | None]]:
        """Yield decoded frames with their numbers, from the keyframe before ``first`` on.

        The frame is None where it is missing or damaged, its number as well where that is not known.
        """
        start = int(self.index.key_of[min(first, self.index.pts.size - 1)])
        needed = self.index.needed(wanted)
        only = set(self.index.pts[needed].tolist()) if self.index.timed else None
        listed, expected = set(needed.tolist()), start
        with self.opened_at(start) as (container, stream):
            stream.codec_context.thread_count = threads
            for frame in _decoded(container, stream, only):
                number = self._number(frame, expected)
                if number is None or number >= start:
                    yield from _missing(listed, expected, expected if number is None else number)
                    yield number, None if frame is None or frame.is_corrupt else frame
                    expected = expected if number is None else number + 1
        yield from _missing(listed, expected, self.index.pts.size)

    @contextmanager
    def opened_at(self, keyframe: int) -> Iterator[tuple[av.container.InputContainer, av.VideoStream]]:
        """Yield the opened file at a place from which the packets from a keyframe on can be read."""
        with opened(self.path, str(self.path)) as (container, stream):
            if keyframe > 0:
                container.seek(int(self.index.pts[keyframe]), stream=stream)
            yield container, stream

    def _number(self, frame: av.VideoFrame | None, expected: int) -> int | None:
        """Return a frame's number; None where it is not known."""
        if not self.index.timed:
            return expected
        if frame is None or frame.pts is None:
            return None
        return int(np.searchsorted(self.index.pts, frame.pts))


def _missing(listed: set[int], begin: int, end: int) -> list[tuple[int, None]]:
    """Return the listed frames from number ``begin`` up to ``end``, which did not come."""
    return [(number, None) for number in range(begin, end) if number in listed]


class Readable(Protocol):
    """Bytes that are read one after the other."""

    def read(self, size: int) -> bytes:
        """Return at most ``size`` bytes, none at the end."""


def open_video(path: Path) -> VideoSource:
    """Open a video and list its frames without decoding them.

    Raises
    ------
    InputError
        When the file cannot be opened or holds no video frames.
    """
    with opened(path, str(path)) as (container, stream):
        size = (stream.codec_context.width, stream.codec_context.height)
        index = list_frames(container, stream)
    refuse_empty(path, index, size)
    return VideoSource(path, index, size, np.arange(index.pts.size))


def refuse_empty(path: Path, index: VideoIndex, size_px: tuple[int, int]) -> None:
    """Raise `InputError` where a video holds no frames."""
    if index.pts.size == 0 or min(size_px) <= 0:
        raise InputError(path, "holds no video frames", hint="the recording may have been stopped at once")


@contextmanager
def opened(
    path: Path, content: str | Readable
) -> Iterator[tuple[av.container.InputContainer, av.VideoStream]]:
    """Yield container and stream of a video's ``content``; raises `InputError` naming ``path``."""
    try:
        with av.open(content, "r") as container:
            yield container, _prepare(container)
    except (av.FFmpegError, OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError | av.FFmpegError) else error
        raise InputError(
            path, f"cannot be opened as a video ({reason})",
            expected="H.264, HEVC, MJPEG or FFV1 in a container that FFmpeg reads",
            hint="the copy may be incomplete: copy it again, or repair its container",
        )  from error  # fmt: skip


def _prepare(container: av.container.InputContainer) -> av.VideoStream:
    """Return the first video stream, set to report damage."""
    if not container.streams.video:
        raise ValueError("no video stream in it")
    stream = container.streams.video[0]
    # PyAV gives no context for a codec that FFmpeg does not know.
    if stream.codec_context is None:
        raise ValueError("a codec that FFmpeg does not know")
    stream.codec_context.thread_type = "AUTO"
    stream.codec_context.options = {"err_detect": "crccheck+explode"}
    return stream


def _decoded(
    container: av.container.InputContainer, stream: av.VideoStream, only: set[int] | None
) -> Iterator[av.VideoFrame | None]:
    """Yield decoded frames in order of presentation; None where the decoder met damage.

    Only packets whose time of presentation is in ``only`` are decoded; all where times are not known.
    """
    packets = container.demux(stream)
    while (packet := _next_packet(packets)) is not None:
        if only is None or packet.pts is None or packet.pts in only:
            yield from _decode_packet(stream, packet)
    for _ in range(_HELD_BACK):
        yield from _decode_packet(stream, None)


def _next_packet(packets: Iterator[av.Packet[av.VideoStream]]) -> av.Packet[av.VideoStream] | None:
    """Return the next packet with content; None at the end of what can be read."""
    try:
        return next((p for p in packets if p.size), None)
    except av.FFmpegError:
        return None


def _decode_packet(
    stream: av.VideoStream, packet: av.Packet[av.VideoStream] | None
) -> list[av.VideoFrame | None]:
    try:
        return list(stream.decode(packet))
    except av.EOFError:
        return []
    except av.FFmpegError:
        return [None]


def _stretches(wanted: Int, index: VideoIndex) -> list[Int]:
    """Split ascending frame numbers where seeking to a keyframe is faster than decoding further."""
    if wanted.size == 0:
        return []
    return np.split(wanted, np.flatnonzero(index.key_of[wanted[1:]] - wanted[:-1] > _RESTART_FRAMES) + 1)
