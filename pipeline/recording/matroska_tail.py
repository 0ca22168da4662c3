"""The end of a Matroska file that is still being written, read as a separate file.

Clusters do not depend on each other. So the head of the file (what comes before its first cluster), followed
by everything from any later cluster on, is again a Matroska file (RFC 9559, § 5.1.3), and the new part can be
read alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

_CLUSTER = b"\x1f\x43\xb6\x75"
_TIMESTAMP, _CRC32 = 0xE7, 0xBF
_CRC32_BYTES = 6
_LONGEST_START = 4 + 8 + _CRC32_BYTES + 1
# The first cluster is searched in so many bytes from the start (heads have some kB), and the last one in
# pieces of so many bytes from the end.
_HEAD_BYTES = 1 << 20
_AT_ONCE = 1 << 20


@dataclass(frozen=True)
class MatroskaTail:
    """A Matroska file whose head ends at a known byte."""

    path: Path
    head_bytes: int

    def since(self, cluster: int) -> HeadAndTail:
        """Return the file's head, and everything from byte ``cluster`` on, at which a cluster begins."""
        return HeadAndTail(self, cluster)

    def place_of(self, place: int, cluster: int) -> int:
        """Return the place in the file of a byte that `since` returns at ``place``."""
        return place - self.head_bytes + cluster

    def last_cluster(self, after: int) -> int:
        """Return the beginning of the last cluster, or ``after``, that of an earlier one."""
        with self.path.open("rb") as file:
            end = file.seek(0, 2)
            while end > after:
                begin = max(after, end - _AT_ONCE)
                file.seek(begin)
                found = _last_cluster_in(file.read(end - begin + _LONGEST_START))
                if found >= 0:
                    return begin + found
                end = begin
        return after


def matroska_tail(path: Path) -> MatroskaTail | None:
    """Return a file's head and tail; None if it is not a Matroska file with a cluster."""
    with path.open("rb") as file:
        start = file.read(_HEAD_BYTES)
    place = start.find(_CLUSTER)
    while place >= 0 and not _is_cluster(start, place):
        place = start.find(_CLUSTER, place + 1)
    is_matroska = start.startswith(b"\x1a\x45\xdf\xa3")
    return MatroskaTail(path, place) if is_matroska and place > 0 else None


def _last_cluster_in(content: bytes) -> int:
    """Return the beginning of the last cluster in ``content``, −1 without one."""
    place = content.rfind(_CLUSTER)
    while place >= 0 and not _is_cluster(content, place):
        place = content.rfind(_CLUSTER, 0, place)
    return place


def _is_cluster(content: bytes, place: int) -> bool:
    """Return whether an identifier is a cluster's: its size and timestamp follow, maybe its checksum."""
    place += len(_CLUSTER)
    if place >= len(content) or content[place] == 0:
        return False
    place += 9 - content[place].bit_length()  # the size is as many bytes long as its first has leading zeros
    if place < len(content) and content[place] == _CRC32:
        place += _CRC32_BYTES
    return place < len(content) and content[place] == _TIMESTAMP


class HeadAndTail:
    """Bytes of the head, then those from a cluster on; a stream that can be read once, without seeking."""

    def __init__(self, tail: MatroskaTail, cluster: int) -> None:
        self._file = tail.path.open("rb")
        self._head_left, self._cluster = tail.head_bytes, cluster

    def read(self, size: int) -> bytes:
        """Return at most ``size`` bytes, none at the end."""
        if self._head_left == 0:
            return self._file.read(size)
        content = self._file.read(min(size, self._head_left))
        self._head_left -= len(content)
        if self._head_left == 0:
            self._file.seek(self._cluster)
        return content

    def __enter__(self) -> HeadAndTail:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()
