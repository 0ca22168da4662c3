"""A recording that is still being written: every call of `look` reads the new part of its folder.

Only the last cluster of a Matroska video, which may be incomplete, is read again. Other kinds of video, and
bags, are read again as a whole. Files are not hashed: the display of a growing recording is not a result.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import av
import numpy as np

from pipeline.arrays import Int
from pipeline.errors import InputError
from pipeline.files.json_yaml import Section
from pipeline.recording import open_recording
from pipeline.recording.base import Encoder, FrameTable, Recording
from pipeline.recording.folder import (
    DESCRIPTION,
    FolderParts,
    assembled,
    described_in,
    inside,
    recognise,
    required_file,
    table_files,
)
from pipeline.recording.images import ImageSequence, is_pattern, open_images
from pipeline.recording.matroska_tail import MatroskaTail, matroska_tail
from pipeline.recording.tables import LARGEST_BYTES, encoder_readings, frame_table
from pipeline.recording.video import VideoSource, open_video, opened, refuse_empty
from pipeline.recording.video_index import Packet, index_of, list_packets


class GrowingRecording:
    """A recording that is read repeatedly while it grows."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._begin()

    def look(self) -> Recording:
        """Return the current state of the recording.

        Raises
        ------
        InputError
            When it cannot be opened yet.
        """
        if recognise(self.path) is not None:
            return open_recording(self.path)
        try:
            return self._folder()
        except _StartedAnewError:
            self._begin()
            return self._folder()
        except OSError as error:
            raise InputError(self.path, f"cannot be read ({error.strerror})") from error

    def _begin(self) -> None:
        self._frames, self._encoder, self._video = _GrowingFrames(), _GrowingEncoder(), _GrowingVideo()

    def _folder(self) -> Recording:
        section = described_in(self.path / DESCRIPTION)
        named = table_files(section)
        table = self._frames.table(named.frames)
        encoder = self._encoder.readings(named.encoder) if named.encoder is not None else None
        # A growing recording is shown, not measured: its poses do not use the IMU.
        parts = FolderParts(table, encoder, None, self._source(section, table), named.warnings, ())
        return assembled(section, named.frames, parts)

    def _source(self, section: Section, table: FrameTable) -> VideoSource | ImageSequence:
        if is_pattern(section.text("video")):
            inside(section, "video")
            return open_images(section.file.parent, section.text("video"))
        return self._video.source(required_file(section, "video")).numbered_by(table)


class _StartedAnewError(Exception):
    """A file is shorter than its part that was read, or was replaced: the recorder started again."""


@dataclass(frozen=True)
class _Lines:
    """Reading position in a growing CSV file, of which only complete lines are used."""

    read_bytes: int = 0
    inode: int = -1
    head: bytes = b""

    def new(self, file: Path, least: int) -> tuple[str, _Lines]:
        """Return the first line and the new ones, none if fewer than ``least``, and the new position."""
        inode = _same(file, self.inode, self.read_bytes)
        with file.open("rb") as stream:
            stream.seek(self.read_bytes)
            content = stream.read(LARGEST_BYTES)
        content = content[: content.rfind(b"\n") + 1]
        head = self.head or content[: content.find(b"\n") + 1]
        lines = content if self.head else content[len(head) :]
        if lines.count(b"\n") < least:
            return "", self
        text = (head + lines).decode("utf-8-sig", "replace")
        return text, _Lines(self.read_bytes + len(content), inode, head)


class _GrowingFrames:
    """A growing table of frames."""

    def __init__(self) -> None:
        self._lines, self._table = _Lines(), FrameTable(np.empty(0, int), np.empty(0), np.empty(0, str))

    def table(self, file: Path) -> FrameTable:
        """Return all rows so far."""
        text, lines = self._lines.new(file, 1)
        if text:
            old, new = self._table, frame_table(file, text)
            self._table = FrameTable(
                np.append(old.frame, new.frame), np.append(old.time_s, new.time_s),
                np.append(old.illumination, new.illumination),
            )  # fmt: skip
        self._lines = lines
        if self._table.frame.size == 0:
            raise InputError(file, "lists no frames yet")
        return self._table


class _GrowingEncoder:
    """Growing readings of an encoder."""

    def __init__(self) -> None:
        self._lines, self._readings = _Lines(), Encoder(np.empty(0), np.empty(0))

    def readings(self, file: Path) -> Encoder | None:
        """Return all readings so far, None without any."""
        text, lines = self._lines.new(file, 2)
        if text:
            old, new = self._readings, encoder_readings(file, text)
            self._readings = Encoder(
                np.append(old.time_s, new.time_s), np.append(old.distance_mm, new.distance_mm)
            )
        self._lines = lines
        return self._readings if self._readings.time_s.size else None


@dataclass
class _GrowingVideo:
    """A growing Matroska file: its packets up to the last cluster, and where clusters begin."""

    tail: MatroskaTail | None = None
    packets: list[Packet] = field(default_factory=list)
    clusters: list[int] = field(default_factory=list)
    inode: int = -1

    def source(self, path: Path) -> VideoSource:
        """Return the frames written so far."""
        self.inode = _same(path, self.inode, self.clusters[-1] if self.clusters else 0)
        self.tail = self.tail or matroska_tail(path)
        if self.tail is None:
            return open_video(path)
        begin = self.clusters[-1] if self.clusters else self.tail.head_bytes
        last = self.tail.last_cluster(begin)
        with self.tail.since(begin) as content, opened(path, content) as (container, stream):
            size = (stream.codec_context.width, stream.codec_context.height)
            new = [
                p._replace(place=self.tail.place_of(p.place, begin)) for p in list_packets(container, stream)
            ]
            packets = [*self.packets, *new]
            index = index_of(packets, container, stream)
        refuse_empty(path, index, size)
        self.packets += [p for p in new if p.place < last]
        self.clusters += [c for c in (begin, last) if c not in self.clusters[-1:]]
        places = np.array([p.place for p in packets], np.int64)[index.coded]
        numbers = np.arange(index.pts.size)
        return _TailSource(path, index, size, numbers, self.tail, tuple(self.clusters), places)


@dataclass(frozen=True)
class _TailSource(VideoSource):
    """A video that is read from the cluster on in which decoding has to begin.

    Attributes
    ----------
    tail, clusters
        Known beginnings of clusters, ascending.
    places : (N,) int
        Places of the frames in the file.
    """

    tail: MatroskaTail
    clusters: tuple[int, ...]
    places: Int

    @contextmanager
    def opened_at(self, keyframe: int) -> Iterator[tuple[av.container.InputContainer, av.VideoStream]]:
        """See `VideoSource.opened_at`; frames before the keyframe may come too."""
        cluster = self.clusters[max(bisect_right(self.clusters, int(self.places[keyframe])) - 1, 0)]
        with self.tail.since(cluster) as content, opened(self.path, content) as found:
            yield found


def _same(file: Path, inode: int, read_bytes: int) -> int:
    """Return a file's inode; raises if the file was replaced or is shorter than before."""
    now = file.stat()
    if now.st_size < read_bytes or inode not in (-1, now.st_ino):
        raise _StartedAnewError
    return now.st_ino
