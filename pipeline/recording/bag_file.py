"""Messages of ROS 1 bags, ROS 2 bags and MCAP files behind one interface.

Only standard message types are decoded, by their published definitions, so bags without embedded
definitions can be read too.
"""

from __future__ import annotations

import sqlite3
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Protocol

from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.records import Schema
from mcap.summary import Summary
from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.interfaces import Connection
from rosbags.rosbag1 import ReaderError as Reader1Error
from rosbags.rosbag2 import ReaderError as Reader2Error
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

# Exceptions of the libraries on damaged files.
BAG_ERRORS = (
    AnyReaderError, Reader1Error, Reader2Error, SerdeError, McapError, sqlite3.Error, struct.error,
    OSError, EOFError, ValueError, TypeError, AttributeError, KeyError, IndexError, AssertionError,
)  # fmt: skip


class Bag(Protocol):
    """A file of timed messages on named topics."""

    @property
    def files(self) -> list[Path]:
        """All files that hold its content."""

    def topics(self) -> dict[str, str]:
        """Return each topic's message type, such as ``sensor_msgs/msg/Image``."""

    def messages(self, topic: str, start_ns: int = 0) -> Iterator[tuple[int, bytes]]:
        """Yield (time of recording in ns, coded message) from a time on, in order of time."""

    def decode(self, coded: bytes, message_type: str) -> Any:
        """Return a message as an object with the fields of its type."""


@dataclass(frozen=True)
class RosBag:
    """A ROS 1 bag (one file) or a ROS 2 bag (a folder with metadata.yaml, sqlite3 or MCAP storage)."""

    path: Path

    @property
    def files(self) -> list[Path]:
        """See `Bag.files`."""
        return bag_files(self.path)

    def topics(self) -> dict[str, str]:
        """See `Bag.topics`."""
        with self._open() as reader:
            return {c.topic: str(c.msgtype) for c in reader.connections}

    def messages(self, topic: str, start_ns: int = 0) -> Iterator[tuple[int, bytes]]:
        """See `Bag.messages`."""
        with self._open() as reader:
            chosen: list[Connection] = [c for c in reader.connections if c.topic == topic]
            for _, time_ns, coded in reader.messages(chosen, start=start_ns):
                yield time_ns, bytes(coded)

    def decode(self, coded: bytes, message_type: str) -> Any:
        """See `Bag.decode`."""
        return _decode(coded, message_type, ros1=self.path.is_file())

    def _open(self) -> AnyReader:
        return AnyReader([self.path], default_typestore=_typestore(Stores.LATEST))


@dataclass(frozen=True)
class McapFile:
    """An MCAP file on its own, with messages in ROS 1's (``ros1``) or ROS 2's (``cdr``) encoding."""

    path: Path
    encoding: str

    @property
    def files(self) -> list[Path]:
        """See `Bag.files`."""
        return bag_files(self.path)

    def topics(self) -> dict[str, str]:
        """See `Bag.topics`; topics in other encodings than ROS's are ignored."""
        summary = _mcap_summary(self.path)
        return {
            c.topic: _full_type(summary.schemas[c.schema_id])
            for c in summary.channels.values()
            if c.message_encoding == self.encoding and c.schema_id in summary.schemas
        }

    def messages(self, topic: str, start_ns: int = 0) -> Iterator[tuple[int, bytes]]:
        """See `Bag.messages`."""
        with self.path.open("rb") as opened:
            reader = make_reader(opened, validate_crcs=True)
            for _, _, message in reader.iter_messages([topic], starting_at=start_ns):
                yield message.log_time, message.data

    def decode(self, coded: bytes, message_type: str) -> Any:
        """See `Bag.decode`."""
        return _decode(coded, message_type, ros1=self.encoding == "ros1")


def bag_files(path: Path) -> list[Path]:
    """Return all files that hold the content of a bag: itself, or those of its folder."""
    if path.is_file():
        return [path]
    return sorted(f for f in path.iterdir() if f.suffix in (".yaml", ".db3", ".mcap", ".zstd"))


def open_mcap(path: Path) -> McapFile:
    """Return an MCAP file with the encoding of its messages; raises one of `BAG_ERRORS`."""
    found = {c.message_encoding for c in _mcap_summary(path).channels.values()}
    ours = sorted(found & {"cdr", "ros1"})
    if not ours:
        raise ValueError(f"messages are coded as {', '.join(sorted(found)) or 'nothing'}, not as cdr or ros1")
    return McapFile(path, ours[0])


def _mcap_summary(path: Path) -> Summary:
    with path.open("rb") as opened:
        summary = make_reader(opened).get_summary()
    if summary is None:
        raise ValueError("it has no summary at its end; it may be cut off")
    return summary


def _full_type(schema: Schema) -> str:
    """Return a type's name with the ``msg`` that ROS 1 leaves out."""
    package, _, name = schema.name.rpartition("/")
    return f"{package.removesuffix('/msg')}/msg/{name}"


def _decode(coded: bytes, message_type: str, *, ros1: bool) -> Any:
    if ros1:
        return _typestore(Stores.ROS1_NOETIC).deserialize_ros1(coded, message_type)
    return _typestore(Stores.LATEST).deserialize_cdr(coded, message_type)


@cache
def _typestore(distribution: Stores) -> Typestore:
    """Return a distribution's message types; cached, since each store compiles its decoders again."""
    return get_typestore(distribution)
