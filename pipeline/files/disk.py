"""Files written whole, and files known to be as they were.

Writing leaves after a power cut the old file or the new one, never half of either. An `InputFile` is a file
as it was when it was opened: what is read of it later is known to be the same.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from pipeline.errors import InputError
from pipeline.files.codec import Json

_CHUNK = 1 << 20
_UNFINISHED = ".unfinished"
_GO_ON = "free space or give another folder with -o; the same command then continues"


@dataclass(frozen=True)
class FileRecord:
    """Size and SHA-256 by which a file is known to be whole."""

    bytes: int
    sha256: str

    def matches(self, path: Path) -> bool:
        """Return whether the file at ``path`` is there and has this size and content."""
        return self.has_size_of(path) and record_of(path) == self

    def has_size_of(self, path: Path) -> bool:
        """Return whether the file at ``path`` is there and has this size: quick, for big files."""
        return path.is_file() and path.stat().st_size == self.bytes


@dataclass(frozen=True)
class FileStamp:
    """What differs after a file was changed; compare for equality only, since clocks may be set back.

    The time of the last change of the inode, which no program can set, is part of it.
    """

    bytes: int
    changed_ns: int
    inode_changed_ns: int
    inode: int


class HashingWriter:
    """A binary stream that passes everything on and keeps count and hash of it."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream, self._hash, self._bytes = stream, hashlib.sha256(), 0

    def write(self, data: Any) -> int:
        """Write ``data``, any bytes-like object."""
        self._hash.update(data)
        self._bytes += memoryview(data).nbytes
        return self._stream.write(data)

    def record(self) -> FileRecord:
        """Return size and hash of what was written so far."""
        return FileRecord(self._bytes, self._hash.hexdigest())


def record_of(path: Path) -> FileRecord:
    """Return size and hash of a file."""
    total, size = hashlib.sha256(), 0
    with path.open("rb") as stream:
        while chunk := stream.read(_CHUNK):
            total.update(chunk)
            size += len(chunk)
    return FileRecord(size, total.hexdigest())


def stamp_of(path: Path) -> FileStamp:
    """Return a file's stamp; raises OSError when it is not there."""
    found = path.stat()
    return FileStamp(found.st_size, found.st_mtime_ns, found.st_ctime_ns, found.st_ino)


def write_synced(path: Path, fill: Callable[[HashingWriter], object]) -> FileRecord:
    """Let ``fill`` write the file, force it to the disk, return its record."""
    with path.open("wb") as stream:
        writer = HashingWriter(stream)
        fill(writer)
        stream.flush()
        os.fsync(stream.fileno())
    return writer.record()


def replace_text(path: Path, text: str) -> None:
    """Replace a text file at one stroke."""
    temporary = path.with_name(f".{path.name}.new")
    write_synced(temporary, lambda w: w.write(text.encode()))
    temporary.replace(path)
    sync_folder(path.parent)


def replace_json(path: Path, tree: Json) -> None:
    """Replace a JSON file at one stroke."""
    replace_text(path, json.dumps(tree, indent=1, ensure_ascii=False, allow_nan=False) + "\n")


def sync_folder(folder: Path) -> None:
    """Force a folder's entries to the disk."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def sync_tree(folder: Path) -> None:
    """Force every file and folder below ``folder`` to the disk."""
    for path in sorted(folder.rglob("*")):
        if path.is_dir():
            sync_folder(path)
        else:
            with path.open("rb") as stream:
                os.fsync(stream.fileno())
    sync_folder(folder)


def remove(path: Path) -> None:
    """Remove a file or a folder with all below it, if it is there."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def require_writable(folder: Path) -> None:
    """Try to write in a folder for results, before work is put into what would go there; leave nothing.

    Raises
    ------
    InputError
        When it cannot be made or written.
    """
    with disk_errors_named(folder):
        made = [p for p in (folder, *folder.parents) if not p.exists()]
        folder.mkdir(parents=True, exist_ok=True)
        trial = folder / _UNFINISHED
        remove(trial)
        trial.mkdir()
        for empty in (trial, *made):
            empty.rmdir()


@contextmanager
def written_together(folder: Path, last: str) -> Iterator[Path]:
    """Lend a folder for files that belong together, which take their places in ``folder`` at the end.

    The file ``last`` is taken away first and put there last: where it is, all of them are, and all of one
    call. A call that fails or is killed before it takes ``last`` away leaves what an earlier one wrote.

    Raises
    ------
    InputError
        When the disk is full or cannot be written.
    """
    with disk_errors_named(folder):
        folder.mkdir(parents=True, exist_ok=True)
        unfinished = folder / _UNFINISHED
        remove(unfinished)
        unfinished.mkdir()
        try:
            yield unfinished
            sync_tree(unfinished)
            (folder / last).unlink(missing_ok=True)
            sync_folder(folder)
            for file in sorted(unfinished.iterdir(), key=lambda f: (f.name == last, f.name)):
                file.replace(folder / file.name)
            sync_folder(folder)
        finally:
            shutil.rmtree(unfinished, ignore_errors=True)


@contextmanager
def disk_errors_named(folder: Path, hint: str = _GO_ON) -> Iterator[None]:
    """Turn the operating system's refusals into an `InputError` about ``folder``."""
    try:
        yield
    except OSError as error:
        raise InputError(
            folder,
            f"cannot be written: {error.strerror or f'{error}; is the disk full?'}",
            expected="a folder that can be written, on a disk with room",
            hint=hint,
        ) from error


_EXPECTED = "the file as it was at the start"
_HINT = "let the copy or the recorder finish, then give the same command again: what is complete is kept"


@dataclass(frozen=True)
class InputFile:
    """A file as it was: its stamp, taken first, and the SHA-256 of its bytes."""

    path: Path
    stamp: FileStamp
    sha256: bytes

    def refuse_changed(self) -> None:
        """Raise `InputError` when the file is gone or its bytes are others; they are read if it was touched.

        The stamp only spares reading: a clock set back, or a file touched or linked, changes nothing.
        """
        try:
            same = stamp_of(self.path) == self.stamp or _sha256(self.path) == self.sha256
        except OSError as error:
            problem = f"cannot be read any more ({error.strerror})"
            raise InputError(self.path, problem, expected=_EXPECTED, hint=_HINT) from error
        if not same:
            raise InputError(self.path, "was changed while it was in use", expected=_EXPECTED, hint=_HINT)


def input_file(path: Path) -> InputFile:
    """Return a file as it is; to be called before anything is taken from it.

    Raises
    ------
    InputError
        When it cannot be read.
    """
    try:
        return InputFile(path, stamp_of(path), _sha256(path))
    except OSError as error:
        raise InputError(
            path, f"cannot be read ({error.strerror})", expected="a file that this user may read",
            hint="copy the whole recording again, or mend its permissions",
        ) from error  # fmt: skip


def content_key(files: Iterable[InputFile]) -> str:
    """Return the SHA-256 of the files' SHA-256 hashes, in order."""
    return hashlib.sha256(b"".join(f.sha256 for f in files)).hexdigest()


def files_sha256(files: Iterable[Path]) -> str:
    """Return the SHA-256 of the SHA-256 hashes of some files, in order.

    Raises
    ------
    InputError
        When one cannot be read.
    """
    return content_key(input_file(f) for f in files)


def _sha256(path: Path) -> bytes:
    with path.open("rb") as opened:
        return hashlib.file_digest(opened, "sha256").digest()
