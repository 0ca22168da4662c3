"""What a video file lists without being decoded, and which frames damage reaches."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import av
import numpy as np

from pipeline.recording.base import Int
from pipeline.recording.ffv1 import checksums_hold


@dataclass(frozen=True)
class VideoIndex:
    """A video's frames, numbered in order of presentation.

    Attributes
    ----------
    pts : (N,) int
        Times of presentation, ascending, in the stream's unit.
    unit_s : float
        That unit, s.
    coded : (N,) int
        Each frame's place in the order in which frames are coded.
    keyframes : (K,) int
        Numbers of the frames at which decoding can begin.
    reordered : int
        Over how many frames the order of presentation can differ from the order of coding.
    timed : bool
        Whether packets carry times of presentation; if not, frames are numbered as they come.
    broken : (B,) int
        Numbers of the frames whose checksum is wrong, where the coding has checksums.
    """

    pts: Int
    unit_s: float
    coded: Int
    keyframes: Int
    reordered: int
    timed: bool
    broken: Int

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
    packets: list[_Packet] = []
    checked = stream.codec_context.name == "ffv1"
    try:
        for packet in container.demux(stream):
            if packet.size:
                sound = checked and checksums_hold(bytes(packet))
                packets.append(_Packet(packet.pts, packet.is_keyframe, sound))
    except av.FFmpegError:
        pass  # the table of frames tells what is missing behind this place
    reordered = int(stream.codec_context.has_b_frames)
    # AVI keeps no times of presentation: with frames out of order, what it gives are times of decoding.
    timed = not (container.format.name == "avi" and reordered) and all(p.pts is not None for p in packets)
    pts = np.array([p.pts for p in packets] if timed else range(len(packets)), np.int64)
    order = np.argsort(pts, kind="stable")
    key = np.array([timed and p.key for p in packets], bool)[order]
    intact = np.array([p.sound for p in packets], bool)[order]
    return VideoIndex(
        pts=pts[order],
        unit_s=float(stream.time_base or 0),
        coded=order,
        keyframes=np.union1d(np.flatnonzero(key), [0]),
        reordered=reordered,
        timed=timed,
        broken=np.flatnonzero(~intact & intact.any()),
    )


class _Packet(NamedTuple):
    """A coded frame: time of presentation, whether decoding can begin there, whether its checksum holds."""

    pts: int | None
    key: bool
    sound: bool
