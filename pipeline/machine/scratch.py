"""Storage for arrays too large for memory: unnamed files, which vanish when no array needs them."""

from __future__ import annotations

import os
import tempfile
import weakref
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from pipeline.files.disk import disk_errors_named

# From 32 MiB on an array is mapped from a file.
_MAP_FROM_BYTES = 1 << 25


@dataclass(frozen=True)
class Scratch:
    """Storage for large intermediate arrays.

    The files have no name, so that nothing is left behind however the program ends.

    Attributes
    ----------
    folder : Path or None
        A folder on a disk with free space; None for the system's temporary folder.
    """

    folder: Path | None = None

    @property
    def place(self) -> Path:
        """The folder, whichever it is."""
        return self.folder if self.folder is not None else Path(tempfile.gettempdir())

    def zeros(self, shape: Sequence[int], dtype: DTypeLike) -> NDArray[Any]:
        """Return an array of zeros: in memory if it is small, else mapped from a file."""
        kind = np.dtype(dtype)
        size = int(np.prod(shape, dtype=np.int64)) * kind.itemsize
        if size < _MAP_FROM_BYTES:
            return np.zeros(shape, kind)
        with self.file() as stream:
            # Space is reserved now: if the disk fills under a mapped file, the system kills the program.
            with disk_errors_named(self.place):
                os.posix_fallocate(stream.fileno(), 0, size)
            return _mapped(stream, kind, tuple(shape))

    def full(self, shape: Sequence[int], value: float, dtype: DTypeLike) -> NDArray[Any]:
        """Return an array of one value, as `zeros` does; filled piece by piece."""
        out = self.zeros(shape, dtype)
        for start in range(0, len(out), 4096):
            out[start : start + 4096] = value
        return out

    def spool(self, dtype: DTypeLike, record: tuple[int, ...] = ()) -> Spool:
        """Return an empty list of records, each of a shape, that grows on the disk."""
        return Spool(np.dtype(dtype), record, self.file(), self.place)

    def file(self) -> IO[bytes]:
        """Return an empty file without a name; raises `InputError` where the disk refuses it."""
        with disk_errors_named(self.place):
            self.place.mkdir(exist_ok=True)
            return tempfile.TemporaryFile(dir=self.place)


@dataclass
class Spool:
    """Records of one kind, appended at the end and read back in stretches.

    Attributes
    ----------
    dtype : numpy.dtype
    record : tuple of int
        Shape of a record.
    count : int
        Records so far.
    """

    dtype: np.dtype[Any]
    record: tuple[int, ...]
    stream: IO[bytes] = field(repr=False)
    place: Path = field(repr=False)
    count: int = 0

    def __post_init__(self) -> None:
        weakref.finalize(self, self.stream.close)

    def append(self, records: NDArray[Any]) -> None:
        """Append records (N,)."""
        with disk_errors_named(self.place):
            self.stream.write(np.ascontiguousarray(records, self.dtype).data)
        self.count += len(records)

    def part(self, first: int, last: int) -> NDArray[Any]:
        """Return a copy of records ``first`` to ``last`` (exclusive)."""
        self._flush()
        here = self.stream.tell()
        size = self.dtype.itemsize * int(np.prod(self.record, dtype=np.int64))
        self.stream.seek(first * size)
        content = self.stream.read((last - first) * size)
        self.stream.seek(here)
        return np.frombuffer(content, self.dtype).reshape(-1, *self.record).copy()

    def parts(self, records: int) -> Iterator[NDArray[Any]]:
        """Yield all records, so many at a time."""
        for first in range(0, self.count, records):
            yield self.part(first, min(first + records, self.count))

    def array(self) -> NDArray[Any]:
        """Return all records, mapped from the file."""
        self._flush()
        return _mapped(self.stream, self.dtype, (self.count, *self.record))

    def _flush(self) -> None:
        with disk_errors_named(self.place):
            self.stream.flush()


def _mapped(stream: IO[bytes], kind: np.dtype[Any], shape: tuple[int, ...]) -> NDArray[Any]:
    if 0 in shape:
        return np.zeros(shape, kind)
    return np.asarray(np.memmap(stream, kind, "r+", shape=shape))
