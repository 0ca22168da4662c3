"""The folder of a run: claimed by one process at a time, with its store, its log and its published files."""

from __future__ import annotations

import fcntl
import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from pipeline.errors import InputError
from pipeline.files.disk import disk_errors_named
from pipeline.machine.store import Store

_INTERNAL = ".boresight"


@dataclass(frozen=True)
class RunFolder:
    """A folder that holds a run, or is to hold one."""

    path: Path

    @property
    def internal(self) -> Path:
        """Folder of everything that is not for users."""
        return self.path / _INTERNAL

    @property
    def store(self) -> Store:
        """Results of the stages."""
        return Store(self.internal)

    @property
    def log(self) -> Path:
        """Log of all calls, with the tracebacks of failures."""
        return self.internal / "run.log"


@contextmanager
def claimed(path: Path) -> Iterator[RunFolder]:
    """Create or take over a run folder for this process alone.

    Raises
    ------
    InputError
        When the folder holds something else, cannot be written, or another process is at work in it.
    """
    folder = RunFolder(path)
    _refuse_foreign(folder)
    with disk_errors_named(path):
        folder.internal.mkdir(parents=True, exist_ok=True)
    with _locked(folder):
        folder.store.sweep()
        yield folder


@contextmanager
def logged(folder: RunFolder) -> Iterator[logging.Logger]:
    """Yield a logger that appends to the run folder's log."""
    with disk_errors_named(folder.path):
        handler = _LogFile(folder.log, encoding="utf-8")
    handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(message)s"))
    logger = logging.getLogger("boresight.run")
    logger.setLevel(logging.INFO)
    logger.addHandler(handler)
    try:
        yield logger
    finally:
        logger.removeHandler(handler)
        with suppress(OSError):
            handler.close()


class _LogFile(logging.FileHandler):
    """A log that goes quiet on a full disk, so as not to hide the error that tells of it."""

    def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802  the name is logging's
        """Ignore."""


def _refuse_foreign(folder: RunFolder) -> None:
    if folder.path.exists() and not folder.path.is_dir():
        raise InputError(folder.path, "is a file", expected="a folder for the run")
    if folder.path.is_dir() and not folder.internal.is_dir() and any(folder.path.iterdir()):
        raise InputError(
            folder.path,
            "holds files that are not those of a boresight run",
            expected="a new or empty folder, or an earlier run",
            hint="give another folder with -o; results of an older boresight may also be moved away",
        )


@contextmanager
def _locked(folder: RunFolder) -> Iterator[None]:
    """Hold the folder's lock, which the system takes from a dead process, however it died."""
    path = folder.internal / "lock"
    with disk_errors_named(folder.path):
        stream = path.open("a+b", buffering=0)
    with stream:
        try:
            fcntl.lockf(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            stream.seek(0)
            holder = stream.read().decode("ascii", "replace").strip() or "unknown"
            raise InputError(
                folder.path,
                f"process {holder} is at work in this run folder",
                hint="wait until it has ended, or give another folder with -o",
            ) from error
        with disk_errors_named(folder.path):
            stream.truncate(0)
            stream.write(str(os.getpid()).encode())
        yield
