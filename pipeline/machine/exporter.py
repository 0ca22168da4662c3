"""What an exporter is, how its files reach the run folder whole, and the thread that writes them."""

from __future__ import annotations

import hashlib
import logging
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import asdict, dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any, Self, get_type_hints

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
from pipeline.files.json_file import read_json
from pipeline.machine.run_folder import RunFolder
from pipeline.machine.source_code import source_digest


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
        """Return the hash of what its files are made from, and of the program text that writes them."""
        inputs = {name: keys[kind] for name, kind in self.inputs().items()}
        return hashlib.sha256(canonical([self.name, source_digest(self.write), dict(inputs)])).hexdigest()


def publish(exporter: Exporter, artefacts: Mapping[type, object], key: str, run: RunFolder) -> None:
    """Write an exporter's files and put each in place whole.

    Raises
    ------
    InputError
        When the disk is full or cannot be written; files already in place stay as they were.
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
    """Return whether the files in place are those made from ``key``, whole."""
    stated, files = _read_receipt(exporter, run)
    return stated == key and all(r.matches(run.path / name) for name, r in files.items())


def published_key(exporter: Exporter, run: RunFolder) -> str:
    """Return the key that the files in place were made from, empty when there are none."""
    return _read_receipt(exporter, run)[0]


def published_files(exporter: Exporter, run: RunFolder) -> dict[str, FileRecord]:
    """Return size and hash of an exporter's files as they were put in place, by name."""
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
    """Writes what it is offered, once each, in the order of the offers.

    Leaving it as a context waits until all is written, and raises what a write raised.
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
        """Have an exporter's files written from ``artefacts`` unless those in place are made from ``key``."""
        if exporter.name not in self._writing:
            arguments = {kind: artefacts[kind] for kind in exporter.inputs().values()}
            self._writing[exporter.name] = self._pool.submit(self._write, exporter, key, arguments)

    def check(self) -> None:
        """Raise what a write raised that has ended."""
        for name, future in self._writing.items():
            if future.done() and future.exception() is not None:
                self.failed = f"writing {name}"
                future.result()

    def _write(self, exporter: Exporter, key: str, arguments: Mapping[type, object]) -> None:
        if not is_published(exporter, key, self._folder):
            start = time.monotonic()
            publish(exporter, arguments, key, self._folder)
            self._logger.info("wrote %s, %.1f s", exporter.name, time.monotonic() - start)
