"""Files for people are written on a thread of their own, one after the other, while stages go on."""

from __future__ import annotations

import logging
import time
from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from types import TracebackType
from typing import Self

from pipeline.export.exporter import Exporter, is_published, publish
from pipeline.machine.run_folder import RunFolder


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
