"""Processor time and memory of a process and all its descendants, sampled while they work."""

from __future__ import annotations

import os
import re
import threading
from collections.abc import Callable
from pathlib import Path

_TICK_S = 1 / os.sysconf("SC_CLK_TCK")
_EVERY_S = 0.05
_UTIME, _AFTER_CSTIME = 11, 15
_CHANGE = re.compile(
    r" INFO (?:stage (?P<stage>\w+) (?P<how>starts|completed|reused)|(?P<files>writing|wrote) )"
)


class Watch:
    """Processor time and largest private memory of a process and its descendants, by phase.

    Memory is RssAnon, without pages mapped from files, which the system can drop.

    Parameters
    ----------
    pid : int
        The process at the top; absent: this process.
    phase : callable
        Returns the name of the present phase, to which time and memory are added.

    Attributes
    ----------
    cpu_s, mib : dict of str to float
        Processor time, and the most memory held at one moment, by phase.
    """

    def __init__(self, pid: int | None = None, phase: Callable[[], str] = str) -> None:
        self._pid, self._phase = pid or os.getpid(), phase
        self.cpu_s: dict[str, float] = {}
        self.mib: dict[str, float] = {}

    @property
    def most_mib(self) -> float:
        """Most memory at any moment."""
        return max(self.mib.values(), default=0.0)

    @property
    def all_cpu_s(self) -> float:
        """Processor time of all phases."""
        return sum(self.cpu_s.values())

    def __enter__(self) -> Watch:
        self._used, self._stop = _used_s(family(self._pid)), threading.Event()
        self._thread = threading.Thread(target=self._look_on, daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()
        self._look()

    def _look_on(self) -> None:
        while not self._stop.wait(_EVERY_S):
            self._look()

    def _look(self) -> None:
        pids, phase = family(self._pid), self._phase()
        self.mib[phase] = max(self.mib.get(phase, 0.0), sum(map(_anonymous_mib, pids)))
        used = _used_s(pids)
        # the time of an ended helper is counted for its parent once that has waited for it
        self.cpu_s[phase] = self.cpu_s.get(phase, 0.0) + max(used - self._used, 0.0)
        self._used = max(used, self._used)


class Progress:
    """Reads from a growing log of a run which stages are active, and whether files are being written."""

    def __init__(self, log: Path) -> None:
        self._log, self._read, self._at = log, 0, ["start"]

    def __call__(self) -> str:
        if self._log.exists():
            with self._log.open("rb") as file:
                file.seek(self._read)
                for line in file:
                    self._take(line.decode())
                self._read = file.tell()
        return " and ".join(self._at) or "between"

    def _take(self, line: str) -> None:
        change = _CHANGE.search(line)
        if change is None:
            return
        name = change["stage"] or "files"
        self._at = [at for at in self._at if at not in ("start", name)]
        if "starts" in change.groups() or "writing" in change.groups():
            self._at.append(name)
            self._at.sort(key="files".__eq__)


def family(pid: int) -> list[int]:
    """Return a process and all below it."""
    try:
        tasks = list(Path(f"/proc/{pid}/task").iterdir())
        below = [int(c) for t in tasks for c in (t / "children").read_text().split()]
    except OSError:  # ended meanwhile
        return [pid]
    return [pid, *(p for child in below for p in family(child))]


def _used_s(pids: list[int]) -> float:
    return sum(map(_one_used_s, pids))


def _one_used_s(pid: int) -> float:
    try:
        stat = Path(f"/proc/{pid}/stat").read_text()
    except OSError:  # ended meanwhile
        return 0.0
    return _TICK_S * sum(map(int, stat.rpartition(")")[2].split()[_UTIME:_AFTER_CSTIME]))


def _anonymous_mib(pid: int) -> float:
    try:
        status = Path(f"/proc/{pid}/status").read_text()
    except OSError:  # ended meanwhile
        return 0.0
    held = [line.split()[1] for line in status.splitlines() if line.startswith("RssAnon:")]
    return int(held[0]) / 1024 if held else 0.0
