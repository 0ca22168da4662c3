"""Stores decoded frames on the disk during a run, so that its stages decode a video only once."""

from __future__ import annotations

import os
import shutil
import threading
import weakref
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import IO, Literal, TypeVar

import av
import numpy as np
from av.video.reformatter import Colorspace

from pipeline.arrays import Byte, Image, Int
from pipeline.errors import InputError
from pipeline.machine.scratch import Scratch
from pipeline.recording.base import Illumination, Planes, Recording, ascending, in_background
from pipeline.recording.images import (
    FULL_CHROMA,
    SplitImage,
    bgr_444,
    halved,
    in_full_range,
    plane_of,
    shown,
    split,
)
from pipeline.recording.video import AHEAD, FEW, VideoSource

Made = TypeVar("Made")
Form = Literal["grey", "split", "bgr"]
_FORMS: tuple[Form, ...] = ("grey", "split", "bgr")
"""Stored part of a frame: luma; luma with chroma of half its size; all. Each can be made from a later
one."""
# Frames are stored as decoded, 2 to 6 MB each at 1600 x 1200: 4 GiB hold half a minute of such video. Frames
# beyond this are decoded again. A nearly full disk is reserved for the results.
_MOST_BYTES, _SHARE_OF_FREE = 4 << 30, 0.25
# Bytes reserved on the disk at a time: allocating block by block while writing costs twice the system time.
_GROWTH = 1 << 27


@dataclass(frozen=True)
class Kept:
    """Place and properties of a frame's planes in the file.

    Attributes
    ----------
    offset : int
        Offset of the first plane in the file, bytes.
    planes : tuple of (int, int)
        Height and width of the stored planes, one after the other.
    form : Form
        Stored part of the frame.
    size : (int, int)
        Width and height of the frame, px.
    pixel_format, color_range, colorspace
        Values of the decoder.
    """

    offset: int
    planes: tuple[tuple[int, int], ...]
    form: Form
    size: tuple[int, int]
    pixel_format: str
    color_range: int
    colorspace: int

    @property
    def splits_planes(self) -> bool:
        """Whether a `SplitImage` is made of its planes as they are."""
        return _splits_planes(self.pixel_format, self.colorspace)


@dataclass
class FrameStore:
    """Frames in an unnamed file, put and taken by several threads.

    Attributes
    ----------
    stream : file
    room : int
        Number of bytes that may still be written; 0 after the disk has refused one.
    """

    stream: IO[bytes]
    room: int
    _end: int = 0
    _taken: int = 0
    _kept: dict[int, Kept | None] = field(default_factory=dict)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def __post_init__(self) -> None:
        weakref.finalize(self, self.stream.close)

    def holds(self, number: int, form: Form) -> bool:
        """Return whether a frame is stored in that form or a richer one, or known to be unreadable."""
        kept = self._kept.get(number)
        return number in self._kept if kept is None else _FORMS.index(kept.form) >= _FORMS.index(form)

    def put(self, number: int, frame: av.VideoFrame | None, form: Form) -> None:
        """Store a frame in one form if its format, the limit and the disk allow it."""
        if frame is None:
            self._kept[number] = None
        elif _is_planar(frame) and not (form != "bgr" and self._kept.get(number)):
            if form == "split" and not _splits_planes(frame.format.name, int(frame.colorspace)):
                form = "bgr"
            self._write(number, frame, form)

    def take(self, number: int, planes: Planes) -> Image | None:
        """Return the pixels of a stored frame, as `pipeline.recording.images.pixels` gives them."""
        kept = self._kept[number]
        if kept is None:
            return None
        if planes == "grey":
            return self._read(kept, 1)[0]
        content = self._read(kept, len(kept.planes))
        if kept.pixel_format in FULL_CHROMA:
            return bgr_444(content, kept.pixel_format, kept.color_range, kept.colorspace)
        return shown(_rebuilt(kept, content), planes)

    def take_split(self, number: int) -> SplitImage | None:
        """Return a stored frame as `pipeline.recording.images.split` gives it."""
        kept = self._kept[number]
        if kept is None:
            return None
        content = self._read(kept, len(kept.planes))
        if kept.splits_planes:
            return SplitImage.of_planes(content, kept.pixel_format, kept.color_range, kept.colorspace)
        return split(_rebuilt(kept, content))

    def take_luma(self, number: int) -> Image | None:
        """Return the luma of `take_split`, without reading the colours where they are apart."""
        kept = self._kept[number]
        if kept is not None and kept.splits_planes:
            return in_full_range(self._read(kept, 1)[0], kept.pixel_format, kept.color_range)
        return luma_of(self.take_split(number))

    def _write(self, number: int, frame: av.VideoFrame, form: Form) -> None:
        planes = [plane_of(p) for p in (frame.planes[:1] if form == "grey" else frame.planes)]
        if form == "split":
            planes[1:] = [halved(p) for p in planes[1:]]
        planes = [np.ascontiguousarray(p) for p in planes]
        size = sum(p.nbytes for p in planes)
        with self._lock:
            offset = self._end
            if size > self.room:
                return
            self.room, self._end = self.room - size, offset + size
        try:
            self._take_room(offset + size)
            written = os.pwritev(self.stream.fileno(), [p.data for p in planes], offset)
        except OSError:  # the disk is full or refuses a file of this size: continue without it
            written = 0
        if written < size:
            self.room = 0
            return
        self._kept[number] = Kept(
            offset, tuple((p.shape[0], p.shape[1]) for p in planes), form,
            (frame.width, frame.height), frame.format.name, int(frame.color_range), int(frame.colorspace),
        )  # fmt: skip

    def _take_room(self, end: int) -> None:
        with self._lock:
            if end > self._taken:
                growth = max(min(_GROWTH, self.room), end - self._taken)
                os.posix_fallocate(self.stream.fileno(), self._taken, growth)
                self._taken += growth

    def _read(self, kept: Kept, count: int) -> list[Byte]:
        planes = [np.empty(shape, np.uint8) for shape in kept.planes[:count]]
        if os.preadv(self.stream.fileno(), [p.data for p in planes], kept.offset) < sum(
            p.nbytes for p in planes
        ):
            raise OSError("the file of decoded frames was cut short")
        return planes


@dataclass(frozen=True)
class DecodedOnce:
    """Frames of a video; each is decoded at its first use and stored for the next stage.

    Attributes
    ----------
    video : VideoSource
    store : FrameStore
    dim, lit : frozenset of int
        Frames in the laser's light, of which only the luma is stored, and in the lamps', whose chroma is
        stored at half size until more is requested: a run does not need more, and writing costs time.
    """

    video: VideoSource
    store: FrameStore
    dim: frozenset[int]
    lit: frozenset[int] = frozenset()

    @property
    def image_size(self) -> tuple[int, int]:
        """Width and height, px."""
        return self.video.image_size

    def read(self, frames: Sequence[int] | Int, planes: Planes) -> Iterator[tuple[int, Image | None]]:
        """See `FrameSource.read`."""
        wanted = ascending(frames)
        found = self._found(
            wanted.tolist(), planes, lambda n: self.store.take(n, planes), lambda f: shown(f, planes)
        )
        return found if wanted.size < FEW else in_background(found, AHEAD)

    def read_split(self, frames: Sequence[int] | Int) -> Iterator[tuple[int, SplitImage | None]]:
        """Yield frames as `read` does, each as luma and colours of half its size."""
        found = self._found(ascending(frames).tolist(), "split", self.store.take_split, split)
        return in_background(found, AHEAD)

    def read_luma(self, frames: Sequence[int] | Int) -> Iterator[tuple[int, Image | None]]:
        """Yield the luma of frames that `read_split` yields."""
        numbers = ascending(frames).tolist()
        found = self._found(numbers, "split", self.store.take_luma, lambda f: luma_of(split(f)))
        return in_background(found, AHEAD)

    def _found(
        self,
        wanted: list[int],
        form: Form,
        take: Callable[[int], Made],
        make: Callable[[av.VideoFrame | None], Made],
    ) -> Iterator[tuple[int, Made]]:
        missing = [n for n in wanted if not self.store.holds(n, form)]
        decoded, due = self.video.decoded(np.array(missing, np.int64)), set(missing)
        for number in wanted:
            if number not in due:
                yield number, take(number)
                continue
            _, frame = next(decoded)
            self.store.put(number, frame, self._kept_form(number, form))
            yield number, make(frame)

    def _kept_form(self, number: int, asked: Form) -> Form:
        if number in self.dim:
            return "grey"
        return "split" if number in self.lit and asked != "bgr" else "bgr"


def read_split(recording: Recording, frames: Sequence[int] | Int) -> Iterator[tuple[int, SplitImage | None]]:
    """Yield frames as luma and colours of half their size; None where one cannot be decoded."""
    if isinstance(recording.source, DecodedOnce):
        return recording.source.read_split(frames)
    read = recording.read(frames, "bgr")
    return ((number, None if image is None else SplitImage.of(image)) for number, image in read)


def read_luma(recording: Recording, frames: Sequence[int] | Int) -> Iterator[tuple[int, Image | None]]:
    """Yield the luma of frames that `read_split` yields, which is faster if colours are stored apart."""
    if isinstance(recording.source, DecodedOnce):
        return recording.source.read_luma(frames)
    return ((number, luma_of(image)) for number, image in read_split(recording, frames))


def luma_of(image: SplitImage | None) -> Image | None:
    """Return the luma of a picture; None where there is none."""
    return None if image is None else image.luma


def decoded_once(recording: Recording, scratch: Scratch) -> Recording:
    """Return the recording with frames that are decoded once, however many stages ask for them.

    Their bytes are those of the video's frames, so that results do not change. A recording of single images,
    or one for which the disk has no space, is returned unchanged.
    """
    if not isinstance(recording.source, VideoSource):
        return recording
    try:
        stream = scratch.file()
    except InputError:  # the stages' own results will say so
        return recording
    room = int(min(_MOST_BYTES, _SHARE_OF_FREE * shutil.disk_usage(scratch.place).free))
    dim, lit = (frozenset(recording.frames.of(i).tolist()) for i in (Illumination.LASER, Illumination.LED))
    return replace(recording, source=DecodedOnce(recording.source, FrameStore(stream, room), dim, lit))


def _splits_planes(pixel_format: str, colorspace: int) -> bool:
    """Return whether `SplitImage.of_planes` takes such a frame."""
    return pixel_format in FULL_CHROMA and colorspace != Colorspace.ITU709


def _is_planar(frame: av.VideoFrame) -> bool:
    """Return whether every plane is one of bytes, as in almost all videos."""
    name, bits = frame.format.name, frame.format.components[0].bits
    return bits == 8 and (name == "gray" or (name.startswith("yuv") and name.endswith("p")))


def _rebuilt(kept: Kept, planes: list[Byte]) -> av.VideoFrame:
    frame = av.VideoFrame(*kept.size, kept.pixel_format)
    for plane, content in zip(frame.planes, planes, strict=True):
        plane_of(plane)[:] = content
    frame.color_range, frame.colorspace = kept.color_range, kept.colorspace
    return frame
