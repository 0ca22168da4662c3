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

# Fixed, so that which frames of a damaged file are given up does not depend on the machine.
_THREADS = 4
# Restarting the decoder costs about as much as decoding this many frames.
_RESTART_FRAMES = 8


@dataclass(frozen=True)
class VideoIndex:
    """Presentation times ``pts`` (N,) of all frames, ascending, and numbers of those that can be sought."""

    pts: Int
    keyframes: Int


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
        wanted = np.asarray(frames, np.int64)
        if wanted.size and (np.any(np.diff(wanted) <= 0) or wanted[0] < 0):
            raise ValueError("frame numbers must ascend")
        for stretch in _stretches(wanted[wanted < self.count], self.index.keyframes):
            yield from self._read_stretch(stretch, planes)
        for missing in wanted[wanted >= self.count]:
            yield int(missing), None

    def _read_stretch(self, wanted: Int, planes: Planes) -> Iterator[tuple[int, Image | None]]:
        """Yield the wanted frames, from the keyframe before the first of them."""
        pending = iter(wanted.tolist())
        next_wanted = next(pending, None)
        for number, frame in self._decode_from(int(wanted[0])):
            while next_wanted is not None and next_wanted < number:
                yield next_wanted, None
                next_wanted = next(pending, None)
            if number == next_wanted:
                yield number, None if frame is None else pixels(frame, planes)
                next_wanted = next(pending, None)
            if next_wanted is None:
                return
        while next_wanted is not None:
            yield next_wanted, None
            next_wanted = next(pending, None)

    def _decode_from(self, first: int) -> Iterator[tuple[int, av.VideoFrame | None]]:
        """Yield frames from the keyframe at or before ``first`` on; None where damage reaches a frame.

        After damage nothing is trusted before the next keyframe: later frames are predicted from it.
        """
        start = self.index.keyframes[np.searchsorted(self.index.keyframes, first, "right") - 1]
        keyframes = set(self.index.keyframes.tolist())
        expected, damaged = int(start), False
        with av.open(str(self.path)) as container:
            stream = _prepare(container)
            if start > 0:
                container.seek(int(self.index.pts[start]), stream=stream)
            for frame in _decoded(container, stream):
                if frame is None:
                    damaged = True
                    continue
                number = int(np.searchsorted(self.index.pts, frame.pts))
                if number < start:
                    continue
                damaged = (damaged or number > expected) and number not in keyframes
                expected = number + 1
                yield number, None if damaged or frame.is_corrupt else frame


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


def _prepare(container: av.container.InputContainer) -> av.VideoStream:
    """Return the first video stream, set to decode on several threads and to report damage."""
    if not container.streams.video:
        raise ValueError("no video stream in it")
    stream = container.streams.video[0]
    stream.codec_context.thread_type = "AUTO"
    stream.codec_context.thread_count = _THREADS
    stream.codec_context.options = {"err_detect": "explode"}
    return stream


def _list_frames(container: av.container.InputContainer, stream: av.VideoStream) -> VideoIndex:
    pts, key = [], []
    try:
        for packet in container.demux(stream):
            if packet.pts is not None and packet.size:
                pts.append(packet.pts)
                key.append(packet.is_keyframe)
    except av.FFmpegError:
        pass  # a damaged tail: what was listed so far stands, the table of frames tells what is missing
    order = np.argsort(np.array(pts, np.int64), kind="stable")
    keyframes = np.flatnonzero(np.array(key, bool)[order])
    return VideoIndex(np.array(pts, np.int64)[order], np.union1d(keyframes, [0]))


def _decoded(
    container: av.container.InputContainer, stream: av.VideoStream
) -> Iterator[av.VideoFrame | None]:
    """Yield decoded frames in order of presentation; None where the decoder met damage."""
    packets = container.demux(stream)
    while True:
        try:
            packet = next(packets, None)
            if packet is None:
                return
            yield from packet.decode()
        except av.FFmpegError:
            yield None


def _stretches(wanted: Int, keyframes: Int) -> list[Int]:
    """Split ascending frame numbers where seeking to a keyframe is quicker than decoding on."""
    if wanted.size == 0:
        return []
    key = keyframes[np.searchsorted(keyframes, wanted[1:], "right") - 1]
    return np.split(wanted, np.flatnonzero(key - wanted[:-1] > _RESTART_FRAMES) + 1)
