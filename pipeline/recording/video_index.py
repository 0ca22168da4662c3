"""What a video file lists without being decoded, and which frames damage reaches."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import av
import numpy as np

from pipeline.recording.base import Int


@dataclass(frozen=True)
class VideoIndex:
    """A video's frames, numbered in order of presentation.

    Attributes
    ----------
    pts : (N,) int
        Times of presentation, ascending, in the stream's unit.
    coded : (N,) int
        Each frame's place in the order in which frames are coded.
    keyframes : (K,) int
        Numbers of the frames at which decoding can begin.
    reordered : int
        Over how many frames the order of presentation can differ from the order of coding.
    timed : bool
        Whether packets carry times of presentation; if not, frames are numbered as they come.
    """

    pts: Int
    coded: Int
    keyframes: Int
    reordered: int
    timed: bool

    @property
    def intra(self) -> bool:
        """Whether every frame stands for itself."""
        return self.timed and self.keyframes.size == self.pts.size

    @cached_property
    def key_of(self) -> Int:
        """(N,) Number of the keyframe from which each frame can be decoded."""
        return self.keyframes[np.searchsorted(self.keyframes, np.arange(self.pts.size), "right") - 1]

    def reached(self, number: int, damaged: Iterable[int]) -> bool:
        """Tell whether one of the damaged frames may be part of the prediction of a frame.

        Prediction refers to frames coded before, back to the keyframe at or before the frame.
        """
        key, place = self.coded[self.key_of[number]], self.coded[number]
        return any(key <= self.coded[d] <= place for d in damaged)


def list_frames(container: av.container.InputContainer, stream: av.VideoStream) -> VideoIndex:
    """List a stream's packets; what lies behind damage of the container is left out."""
    packets: list[tuple[int | None, bool]] = []
    try:
        for packet in container.demux(stream):
            if packet.size:
                packets.append((packet.pts, packet.is_keyframe))
    except av.FFmpegError:
        pass  # the table of frames tells what is missing behind this place
    reordered = int(stream.codec_context.has_b_frames)
    # AVI keeps no times of presentation: with frames out of order, what it gives are times of decoding.
    if any(pts is None for pts, _ in packets) or (container.format.name == "avi" and reordered):
        count = np.arange(len(packets))
        return VideoIndex(count, count, np.zeros(1, np.int64), reordered, timed=False)
    pts = np.array([pts for pts, _ in packets], np.int64)
    order = np.argsort(pts, kind="stable")
    keyframes = np.flatnonzero(np.array([key for _, key in packets], bool)[order])
    return VideoIndex(pts[order], order, np.union1d(keyframes, [0]), reordered, timed=True)
