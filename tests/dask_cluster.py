"""A real Dask cluster: scheduler and workers are separate processes that are reached by address."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

from tests.patience import patience
from tests.shared_data import PROJECT_ROOT

_PATIENCE_S = patience(90)


@dataclass
class DaskCluster:
    """``dask scheduler`` and some ``dask worker`` processes, started as an administrator would."""

    folder: Path
    count: int
    workers: list[subprocess.Popen[bytes]] = field(default_factory=list)
    address: str = ""

    def __enter__(self) -> DaskCluster:
        told = self.folder / "scheduler.json"
        words = ["--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(told)]
        self.scheduler = self._start("dask_scheduler", words)
        until = time.monotonic() + _PATIENCE_S
        while not told.is_file() or not told.read_text():
            assert self.scheduler.poll() is None, "the scheduler ended"
            assert time.monotonic() < until, "no scheduler"
            time.sleep(0.05)
        self.address = json.loads(told.read_text())["address"]
        for _ in range(self.count):
            self.add_worker()
        return self

    def __exit__(self, *_: object) -> None:
        for process in (*self.workers, self.scheduler):
            end(process)

    def add_worker(self) -> None:
        """Start another worker without a nanny, so that it is not restarted when it is killed."""
        words = [self.address, "--nthreads", "1", "--no-dashboard", "--no-nanny"]
        self.workers.append(self._start("dask_worker", [*words, "--local-directory", str(self.folder)]))

    def _start(self, module: str, words: list[str]) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", f"distributed.cli.{module}", *words]
        environment = os.environ | {"PYTHONPATH": str(PROJECT_ROOT)}
        log = (self.folder / f"{module}-{len(self.workers)}.log").open("wb")
        with log:
            return subprocess.Popen(command, stdout=log, stderr=log, env=environment, start_new_session=True)


def end(process: subprocess.Popen[bytes]) -> None:
    """Kill a process and its children, as a power failure would."""
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()
