"""Frames of a video file, selected by number, decoded in order."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import av
import numpy as np

from pipeline.errors import InputError
from pipeline.recording.base import Image, Int, Planes
from pipeline.recording.pixels import pixels
from pipeline.recording.selection import ascending, complete
from pipeline.recording.video_index import VideoIndex, list_frames

# Fixed, so that which frames of a damaged file are given up does not depend on the machine.
_THREADS = 4
# Restarting the decoder costs about as much as decoding this many frames.
_RESTART_FRAMES = 8
# A decoder holds back at most this many frames: 16 for reordering and one a thread.
_HELD_BACK = 16 + _THREADS


@dataclass(frozen=True)
class VideoSource:
    """Frames of a video file; frame n is the n-th in order of presentation.

    Attributes
    ----------
    path, index
    image_size : (int, int)
        Width and height, px.
    """

    path: Path
    index: VideoIndex
    image_size: tuple[int, int]

    @property
    def count(self) -> int:
        """How many frames the file holds, decodable or not."""
        return self.index.pts.size

    def read(self, frames: Sequence[int] | Int, planes: Planes) -> Iterator[tuple[int, Image | None]]:
        """See `FrameSource.read`; frames beyond the end of the file yield None."""
        wanted = ascending(frames)
        for stretch in _stretches(wanted[wanted < self.count], self.index):
            for number, frame in complete(stretch, self._decode(stretch)):
                yield number, None if frame is None else pixels(frame, planes)
        yield from ((int(number), None) for number in wanted[wanted >= self.count])

    def _decode(self, wanted: Int) -> Iterator[tuple[int, av.VideoFrame]]:
        """Yield the frames that can be trusted, from the keyframe before the first wanted one on.

        A frame is held back until the frames that may be coded before it, but are shown later, are known to
        be sound.
        """
        damaged: set[int] = set()
        held: deque[tuple[int, av.VideoFrame]] = deque()
        for number, frame in self._numbered(wanted, damaged):
            held.append((number, frame))
            while held and held[0][0] < number - self.index.reordered:
                yield from self._trusted(*held.popleft(), damaged)
        for number, frame in held:
            yield from self._trusted(number, frame, damaged)

    def _trusted(
        self, number: int, frame: av.VideoFrame, damaged: set[int]
    ) -> Iterator[tuple[int, av.VideoFrame]]:
        if (frame.width, frame.height) == self.image_size and not self.index.reached(number, damaged):
            yield number, frame

    def _numbered(self, wanted: Int, damaged: set[int]) -> Iterator[tuple[int, av.VideoFrame]]:
        """Yield decoded frames in order with their numbers; ``damaged`` grows by those that are not sound."""
        start = int(self.index.key_of[wanted[0]])
        only = self.index.pts[wanted] if self.index.intra else None
        expected = start
        with av.open(str(self.path)) as container:
            stream = _prepare(container)
            if start > 0:
                container.seek(int(self.index.pts[start]), stream=stream)
            for frame in _decoded(container, stream, only):
                number = self._number(frame, expected)
                if number is None or number < start:
                    continue
                damaged.update(range(expected, number))
                if frame is None or frame.is_corrupt:
                    damaged.add(number)
                if frame is not None:
                    yield number, frame
                expected = number + 1
            damaged.update(range(expected, self.count))

    def _number(self, frame: av.VideoFrame | None, expected: int) -> int | None:
        """Return a frame's number; None where it is not known."""
        if not self.index.timed:
            return expected
        if frame is None or frame.pts is None:
            return None
        return int(np.searchsorted(self.index.pts, frame.pts))


def open_video(path: Path) -> VideoSource:
    """Open a video and list its frames without decoding them.

    Raises
    ------
    InputError
        When the file cannot be opened or holds no video frames.
    """
    try:
        with av.open(str(path)) as container:
            stream = _prepare(container)
            size = (stream.codec_context.width, stream.codec_context.height)
            index = list_frames(container, stream)
    except (av.FFmpegError, OSError, ValueError) as error:
        raise InputError(
            path, f"cannot be opened as a video ({error.strerror if isinstance(error, OSError) else error})",
            expected="H.264, HEVC, MJPEG or FFV1 in a container that FFmpeg reads",
            hint="the copy may be incomplete: copy it again, or repair its container",
        )  from error  # fmt: skip
    if index.pts.size == 0 or min(size) <= 0:
        raise InputError(path, "holds no video frames", hint="the recording may have been stopped at once")
    return VideoSource(path, index, size)


def _prepare(container: av.container.InputContainer) -> av.VideoStream:
    """Return the first video stream, set to decode on several threads and to report damage."""
    if not container.streams.video:
        raise ValueError("no video stream in it")
    stream = container.streams.video[0]
    stream.codec_context.thread_type = "AUTO"
    stream.codec_context.thread_count = _THREADS
    stream.codec_context.options = {"err_detect": "crccheck+explode"}
    return stream


def _decoded(
    container: av.container.InputContainer, stream: av.VideoStream, only: Int | None
) -> Iterator[av.VideoFrame | None]:
    """Yield decoded frames in order of presentation; None where the decoder met damage.

    Where every frame stands for itself, just the packets presented at the times ``only`` are decoded.
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
    """Split ascending frame numbers where seeking to a keyframe is quicker than decoding on."""
    if wanted.size == 0:
        return []
    return np.split(wanted, np.flatnonzero(index.key_of[wanted[1:]] - wanted[:-1] > _RESTART_FRAMES) + 1)
