"""The folder of a run: claimed by one process at a time, with its store, its log and its published files."""

from __future__ import annotations

import fcntl
import hashlib
import logging
import os
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any, Self, get_type_hints

from pipeline.errors import InputError
from pipeline.files.codec import canonical
from pipeline.files.disk import (
    FileRecord,
    disk_errors_named,
    record_of,
    remove,
    replace_json,
    sync_folder,
    sync_tree,
)
from pipeline.files.json_yaml import read_json
from pipeline.machine.plan import source_digest
from pipeline.machine.store import Store

_INTERNAL = ".boresight"


@dataclass(frozen=True)
class RunFolder:
    """A folder with a run, or for one."""

    path: Path

    @property
    def internal(self) -> Path:
        """Folder of all internal files."""
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
        When the folder holds something else, cannot be written, or another process is using it.
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
    """A log that ignores a full disk, in order not to hide the error that reports it."""

    def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802  the name is logging's
        """Ignore."""


def _refuse_foreign(folder: RunFolder) -> None:
    if folder.path.exists() and not folder.path.is_dir():
        raise InputError(folder.path, "is a file", expected="a folder for the run")
    if folder.path.is_dir() and not folder.internal.is_dir() and any(folder.path.iterdir()):
        raise InputError(
            folder.path,
            "holds files that do not belong to a boresight run",
            expected="a new or empty folder, or an earlier run",
            hint="state another folder with -o, or move the results of an older boresight away",
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
                f"process {holder} is using this run folder",
                hint="wait until it has ended, or state another folder with -o",
            ) from error
        with disk_errors_named(folder.path):
            stream.truncate(0)
            stream.write(str(os.getpid()).encode())
        yield


@dataclass(frozen=True)
class Exporter:
    """A writer of files for people.

    Attributes
    ----------
    name
        What it writes, for messages.
    write
        ``write(artefact, ..., folder)``: writes finished files into ``folder``. Arguments other than
        ``folder`` are artefacts or sources, wired by type as those of stages are.
    """

    name: str
    write: Callable[..., None] = field(repr=False)

    def inputs(self) -> dict[str, type]:
        """Return argument name to class, in the order of the function's signature."""
        hints = get_type_hints(self.write, include_extras=True)
        return {k: v for k, v in hints.items() if k not in ("folder", "return")}

    def key(self, keys: Mapping[type, str]) -> str:
        """Return the hash of its inputs, and of the program text that writes its files."""
        inputs = {name: keys[kind] for name, kind in self.inputs().items()}
        return hashlib.sha256(canonical([self.name, source_digest(self.write), dict(inputs)])).hexdigest()


def publish(exporter: Exporter, artefacts: Mapping[type, object], key: str, run: RunFolder) -> None:
    """Write an exporter's files and put each in place atomically.

    Raises
    ------
    InputError
        When the disk is full or cannot be written; existing files are not changed.
    """
    arguments = {name: artefacts[kind] for name, kind in exporter.inputs().items()}
    temporary = run.internal / f".new-{exporter.name}"
    with disk_errors_named(run.path):
        try:
            remove(temporary)
            temporary.mkdir()
            exporter.write(**arguments, folder=temporary)
            _put_in_place(exporter, temporary, key, run)
        finally:
            remove(temporary)


def is_published(exporter: Exporter, key: str, run: RunFolder) -> bool:
    """Return whether the existing files were made from ``key`` and are complete."""
    stated, files = _read_receipt(exporter, run)
    return stated == key and all(r.matches(run.path / name) for name, r in files.items())


def published_key(exporter: Exporter, run: RunFolder) -> str:
    """Return the key from which the existing files were made, empty when there are none."""
    return _read_receipt(exporter, run)[0]


def published_files(exporter: Exporter, run: RunFolder) -> dict[str, FileRecord]:
    """Return size and hash of an exporter's published files, by name."""
    return _read_receipt(exporter, run)[1]


def withdraw(exporter: Exporter, run: RunFolder) -> None:
    """Remove an exporter's files, so that a folder never mixes the results of two configurations."""
    _, files = _read_receipt(exporter, run)
    with disk_errors_named(run.path):
        for name in sorted({Path(n).parts[0] for n in files}):
            remove(run.path / name)
        remove(_receipt(exporter, run))


def _put_in_place(exporter: Exporter, temporary: Path, key: str, run: RunFolder) -> None:
    sync_tree(temporary)
    written = sorted(p for p in temporary.rglob("*") if p.is_file())
    files = {p.relative_to(temporary).as_posix(): asdict(record_of(p)) for p in written}
    for path in sorted(temporary.iterdir()):
        if path.is_dir():
            remove(run.path / path.name)
        path.replace(run.path / path.name)
    sync_folder(run.path)
    _receipt(exporter, run).parent.mkdir(exist_ok=True)
    replace_json(_receipt(exporter, run), {"key": key, "files": files})  # type: ignore[dict-item]


def _read_receipt(exporter: Exporter, run: RunFolder) -> tuple[str, dict[str, FileRecord]]:
    try:
        tree: dict[str, Any] = read_json(_receipt(exporter, run))
        return str(tree["key"]), {n: FileRecord(**r) for n, r in tree["files"].items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return "", {}


def _receipt(exporter: Exporter, run: RunFolder) -> Path:
    return run.internal / "exports" / f"{exporter.name}.json"


class Writer:
    """Writes exporters' files once each, in the order of the calls of `offer`.

    Leaving it as a context waits until all is written, and raises the error of a failed write.
    """

    def __init__(self, folder: RunFolder, logger: logging.Logger) -> None:
        self._folder, self._logger = folder, logger
        self._pool = ThreadPoolExecutor(1, "writer")
        self._writing: dict[str, Future[None]] = {}
        self.failed = ""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._pool.shutdown()
        if error is None:
            self.check()

    def offer(self, exporter: Exporter, key: str, artefacts: Mapping[type, object]) -> None:
        """Write an exporter's files from ``artefacts`` unless existing ones were made from ``key``."""
        if exporter.name not in self._writing:
            arguments = {kind: artefacts[kind] for kind in exporter.inputs().values()}
            self._writing[exporter.name] = self._pool.submit(self._write, exporter, key, arguments)

    def check(self) -> None:
        """Raise the error of a write that has failed, if any has."""
        for name, future in self._writing.items():
            if future.done() and future.exception() is not None:
                self.failed = f"writing {name}"
                future.result()

    def _write(self, exporter: Exporter, key: str, arguments: Mapping[type, object]) -> None:
        if not is_published(exporter, key, self._folder):
            start = time.monotonic()
            self._logger.info("writing %s", exporter.name)
            publish(exporter, arguments, key, self._folder)
            self._logger.info("wrote %s, %.1f s", exporter.name, time.monotonic() - start)
