"""Lists the frames of a video without decoding it, and finds the frames affected by damage.

Coded pictures state whether others are predicted from them (H.264), and by checksums whether they are
complete (FFV1).
"""

from __future__ import annotations

import zlib
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import av
import numpy as np

from pipeline.arrays import Bool, Int

# H.264: types of NAL units that hold a slice (ITU-T H.264, table 7-1); the first byte of a description whose
# units carry their length (ISO/IEC 14496-15). FFV1: bytes of the footer of each slice (RFC 9043).
_SLICES = (1, 2, 3, 4, 5)
_LENGTH_PREFIXED = 1
_FOOTER_BYTES = 8
_MIRRORED = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))


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
    timed : bool
        Whether packets carry times of presentation; if not, frames are numbered as they come.
    broken : (B,) int
        Numbers of unreliable frames: with a wrong checksum, or predicted from frames that the file lacks.
    expendable : (N,) bool
        Frames that no other frame is predicted from: they need not be decoded unless they are wanted.
    predicted : bool
        Whether a lossy codec predicts frames from others, so that they may repeat light of these.
    """

    pts: Int
    unit_s: float
    coded: Int
    keyframes: Int
    timed: bool
    broken: Int
    expendable: Bool
    predicted: bool

    @property
    def intra(self) -> bool:
        """Whether every frame is coded without reference to others."""
        return self.timed and self.keyframes.size == self.pts.size

    @cached_property
    def settled(self) -> Int:
        """(N,) Highest number among each frame and all frames that are coded before it."""
        return np.asarray(np.maximum.accumulate(np.argsort(self.coded))[self.coded])

    @cached_property
    def key_of(self) -> Int:
        """(N,) Number of the keyframe from which each frame can be decoded."""
        return self.keyframes[np.searchsorted(self.keyframes, np.arange(self.pts.size), "right") - 1]

    def needed(self, wanted: Int) -> Int:
        """Return the numbers of the frames to be decoded for the ``wanted`` ones, ascending."""
        return np.union1d(wanted, np.flatnonzero(~self.expendable))

    def reached(self, number: int, damaged: Collection[int]) -> bool:
        """Return whether one of the damaged frames may be part of the prediction of a frame.

        Prediction refers to frames coded before, and to none shown before the frame's keyframe.
        """
        if self.intra:
            return number in damaged
        key, place = self.key_of[number], self.coded[number]
        return any(key <= d and self.coded[d] <= place for d in damaged)

    def with_gaps(self, gaps: Int) -> VideoIndex:
        """Return the index of a file from which frames are missing right before the frames ``gaps``.

        Up to the next keyframe, frames shown after the gap may be predicted from the missing ones; so may
        frames that are shown before it by no more than the decoder reorders.
        """
        if self.intra:
            return self
        place = np.arange(self.pts.size)
        reordered = int((self.settled - place).max())
        hit = [np.flatnonzero((self.key_of == self.key_of[g - 1]) & (place >= g - reordered)) for g in gaps]
        spoiled = np.concatenate([self.broken, *hit]).astype(np.int64)
        return replace(self, broken=np.setdiff1d(spoiled, self.keyframes))


def list_frames(container: av.container.InputContainer, stream: av.VideoStream) -> VideoIndex:
    """List a stream's packets; those after damage of the container are left out."""
    return index_of(list_packets(container, stream), container, stream)


def list_packets(container: av.container.InputContainer, stream: av.VideoStream) -> list[Packet]:
    """Return the properties of a stream's packets, in the order of the file."""
    packets: list[Packet] = []
    codec = stream.codec_context
    checked = codec.name == "ffv1"
    length_size = length_bytes(codec.extradata) if codec.name == "h264" else 0
    try:
        for packet in container.demux(stream):
            if packet.size:
                sound = checked and checksums_hold(bytes(packet))
                needed = not length_size or is_reference(bytes(packet), length_size)
                place = -1 if packet.pos is None else packet.pos
                packets.append(Packet(packet.pts, packet.is_keyframe, sound, needed, place))
    except av.FFmpegError:
        pass  # the table of frames shows what is missing after this place
    return packets


def index_of(
    packets: Sequence[Packet], container: av.container.InputContainer, stream: av.VideoStream
) -> VideoIndex:
    """Return the index of a stream's packets."""
    # AVI stores no times of presentation: with frames out of order, its times are those of decoding.
    times_kept = not (container.format.name == "avi" and stream.codec_context.has_b_frames)
    timed = times_kept and all(p.pts is not None for p in packets)
    pts = np.array([p.pts for p in packets] if timed else range(len(packets)), np.int64)
    order = np.argsort(pts, kind="stable")
    codec = stream.codec_context.codec
    key = np.array([timed and p.key for p in packets], bool)[order]
    free = np.array([not p.reference for p in packets], bool)[order]
    intact = np.array([p.sound for p in packets], bool)[order]
    return VideoIndex(
        pts=pts[order],
        unit_s=float(stream.time_base or 0),
        coded=order,
        keyframes=np.union1d(np.flatnonzero(key), [0]),
        timed=timed,
        broken=np.flatnonzero(~intact & intact.any()),
        expendable=free | bool(key.all()),
        predicted=codec.lossy and not codec.intra_only and not key.all(),
    )


class Packet(NamedTuple):
    """A coded frame.

    Attributes
    ----------
    pts
        Time of presentation, in the stream's unit.
    key
        Whether decoding can begin there.
    sound
        Whether its checksum holds.
    reference
        Whether others may be predicted from it.
    place
        Offset of its first byte; −1 if unknown.
    """

    pts: int | None
    key: bool
    sound: bool
    reference: bool
    place: int


def checksums_hold(packet: bytes) -> bool:
    """Return whether a coded frame is a sequence of slices with right checksums.

    Each slice ends with its length (3 bytes), a status (1) and bytes that make the CRC of the slice 0 (4).
    Frames coded without checksums do not pass either.
    """
    end = len(packet)
    while end >= _FOOTER_BYTES:
        length = int.from_bytes(packet[end - 8 : end - 5], "big") + _FOOTER_BYTES
        if length > end or _remainder(packet[end - length : end]):
            return False
        end -= length
    return end == 0 and len(packet) > 0


def _remainder(data: bytes) -> int:
    """Return the CRC-32 of RFC 9043, which has the opposite bit order of zlib and starts from 0."""
    return zlib.crc32(data.translate(_MIRRORED), 0xFFFFFFFF) ^ 0xFFFFFFFF


def length_bytes(extradata: bytes | None) -> int:
    """Return the number of bytes of the length before each unit (ISO/IEC 14496-15); 0 without one."""
    if not extradata or len(extradata) < 5 or extradata[0] != _LENGTH_PREFIXED:
        return 0
    return (extradata[4] & 3) + 1


def is_reference(packet: bytes, length_size: int) -> bool:
    """Return whether others may be predicted from a coded picture, by its first slice; True if unknown."""
    at = 0
    while length_size and at + length_size < len(packet):
        length = int.from_bytes(packet[at : at + length_size], "big")
        header = packet[at + length_size]
        if header & 31 in _SLICES:
            return header >> 5 & 3 != 0
        at += length_size + length
    return True
