"""Files as they were when a recording was opened: what is read later is known to be the same."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from pipeline.errors import InputError
from pipeline.files.disk import FileStamp, stamp_of

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
    """Return the SHA-256 over the files' own, in order."""
    return hashlib.sha256(b"".join(f.sha256 for f in files)).hexdigest()


def files_sha256(files: Iterable[Path]) -> str:
    """Return the SHA-256 over those of some files, in order.

    Raises
    ------
    InputError
        When one cannot be read.
    """
    return content_key(input_file(f) for f in files)


def _sha256(path: Path) -> bytes:
    with path.open("rb") as opened:
        return hashlib.file_digest(opened, "sha256").digest()
