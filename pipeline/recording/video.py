"""Frames of a video file, selected by number, decoded in order."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import av
import numpy as np

from pipeline.errors import InputError
from pipeline.recording.base import Image, Int, Planes
from pipeline.recording.pixels import pixels
from pipeline.recording.selection import ascending, complete

# Fixed, so that which frames of a damaged file are given up does not depend on the machine.
_THREADS = 4
# Restarting the decoder costs about as much as decoding this many frames.
_RESTART_FRAMES = 8
# A decoder holds back at most this many frames: 16 for reordering and one a thread.
_HELD_BACK = 16 + _THREADS


@dataclass(frozen=True)
class VideoIndex:
    """What a file lists without being decoded.

    Attributes
    ----------
    pts : (N,) int
        Presentation times of all frames, ascending, in the stream's unit.
    keyframes : (K,) int
        Numbers of the frames at which decoding can begin.
    timed : bool
        Whether packets carry presentation times; if not, frames are numbered as they come, from the first.
    """

    pts: Int
    keyframes: Int
    timed: bool


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
        for stretch in _stretches(wanted[wanted < self.count], self.index.keyframes):
            for number, frame in complete(stretch, self._decode(stretch)):
                yield number, None if frame is None else pixels(frame, planes)
        yield from ((int(number), None) for number in wanted[wanted >= self.count])

    def _decode(self, wanted: Int) -> Iterator[tuple[int, av.VideoFrame]]:
        """Yield trusted frames from the keyframe before the first wanted one on.

        After damage nothing is trusted before the next keyframe, since later frames are predicted from it.
        """
        index = self.index
        start = int(index.keyframes[np.searchsorted(index.keyframes, wanted[0], "right") - 1])
        only = index.pts[wanted] if index.timed and index.keyframes.size == index.pts.size else None
        expected, damaged = start, False
        with av.open(str(self.path)) as container:
            stream = _prepare(container)
            if start > 0:
                container.seek(int(index.pts[start]), stream=stream)
            for frame in _decoded(container, stream, only):
                number = self._number(frame, expected)
                if number is None or frame is None or number < start:
                    damaged = True
                    continue
                gap = number > expected and only is None
                damaged = frame.is_corrupt or ((damaged or gap) and number not in index.keyframes)
                expected = number + 1
                if not damaged and _size(frame) == self.image_size:
                    yield number, frame

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
            index = _list_frames(container, stream)
    except (av.FFmpegError, OSError, ValueError) as error:
        raise InputError(
            path, f"cannot be opened as a video ({error.strerror if isinstance(error, OSError) else error})",
            expected="H.264, HEVC, MJPEG or FFV1 in a container that FFmpeg reads",
            hint="the copy may be incomplete: copy it again, or repair its container",
        )  from error  # fmt: skip
    if index.pts.size == 0 or min(size) <= 0:
        raise InputError(path, "holds no video frames", hint="the recording may have been stopped at once")
    return VideoSource(path, index, size)


def _size(frame: av.VideoFrame) -> tuple[int, int]:
    return frame.width, frame.height


def _prepare(container: av.container.InputContainer) -> av.VideoStream:
    """Return the first video stream, set to decode on several threads and to report damage."""
    if not container.streams.video:
        raise ValueError("no video stream in it")
    stream = container.streams.video[0]
    stream.codec_context.thread_type = "AUTO"
    stream.codec_context.thread_count = _THREADS
    stream.codec_context.options = {"err_detect": "crccheck+explode"}
    return stream


def _list_frames(container: av.container.InputContainer, stream: av.VideoStream) -> VideoIndex:
    pts: list[int | None] = []
    key: list[bool] = []
    try:
        for packet in container.demux(stream):
            if packet.size:
                pts.append(packet.pts)
                key.append(packet.is_keyframe)
    except av.FFmpegError:
        pass  # a damaged tail: what was listed so far stands, the table of frames tells what is missing
    known = [p for p in pts if p is not None]
    # AVI keeps no presentation times: with frames out of order, what it gives are times of decoding.
    reordered_avi = container.format.name == "avi" and stream.codec_context.has_b_frames
    if len(known) < len(pts) or reordered_avi:
        return VideoIndex(np.arange(len(pts)), np.zeros(1, np.int64), timed=False)
    order = np.argsort(np.array(known, np.int64), kind="stable")
    keyframes = np.flatnonzero(np.array(key, bool)[order])
    return VideoIndex(np.array(known, np.int64)[order], np.union1d(keyframes, [0]), timed=True)


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


def _stretches(wanted: Int, keyframes: Int) -> list[Int]:
    """Split ascending frame numbers where seeking to a keyframe is quicker than decoding on."""
    if wanted.size == 0:
        return []
    key = keyframes[np.searchsorted(keyframes, wanted[1:], "right") - 1]
    return np.split(wanted, np.flatnonzero(key - wanted[:-1] > _RESTART_FRAMES) + 1)
