"""The progress display while stages run."""

from __future__ import annotations

from collections.abc import Iterable
from types import TracebackType
from typing import Protocol, Self

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn

from pipeline.machine.outcome import StageOutcome, State, state_word, warnings_of

# Refresh rate of the bars, 1/s: drawing takes some milliseconds in which no stage runs Python.
_DRAWN_PER_SECOND = 4


class Display(Protocol):
    """Receives the progress of the stages."""

    def planned(self, stages: int) -> None:
        """Receive the number of stages."""

    def started(self, stage: str) -> None:
        """Receive the start of a stage."""

    def progressed(self, stage: str, done: int, total: int) -> None:
        """Receive the progress of a running stage; several may run at a time, each on its own thread."""

    def ended(self, outcome: StageOutcome) -> None:
        """Receive the outcome of a stage."""


class SilentDisplay:
    """Shows nothing: for library use and tests."""

    def planned(self, stages: int) -> None:
        """Ignore."""

    def started(self, stage: str) -> None:
        """Ignore."""

    def progressed(self, stage: str, done: int, total: int) -> None:
        """Ignore."""

    def ended(self, outcome: StageOutcome) -> None:
        """Ignore."""


class ProgressDisplay:
    """One bar for the whole run, one beneath it for each running stage, and a line for each stage that ended.

    Attributes
    ----------
    warnings : list of str
        Warnings of the finished stages.
    """

    def __init__(self, console: Console, *, warn_at_once: bool = True) -> None:
        """Print the warnings of a stage when it ends, or only their number, for the caller to print them."""
        self._progress = Progress(
            TextColumn("{task.description:<20}"),
            BarColumn(),
            TextColumn("{task.fields[status]}"),
            TimeElapsedColumn(),
            console=console,
            transient=True,
            disable=not console.is_terminal,
            refresh_per_second=_DRAWN_PER_SECOND,
        )
        self._console, self._warn_at_once = console, warn_at_once
        self._whole = self._progress.add_task("whole run", total=None, status="starting")
        self._tasks: dict[str, TaskID] = {}
        self._stages, self._ended = 0, 0
        self.warnings: list[str] = []

    def __enter__(self) -> Self:
        self._progress.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._progress.stop()

    def planned(self, stages: int) -> None:
        """Set the length of the overall bar."""
        self._stages = stages
        self._move_whole()

    def started(self, stage: str) -> None:
        """Open a bar."""
        self._tasks[stage] = self._progress.add_task(f"  {stage}", total=None, status="working")

    def progressed(self, stage: str, done: int, total: int) -> None:
        """Move the bars."""
        if stage in self._tasks and total > 0:
            self._progress.update(
                self._tasks[stage], completed=done, total=total, status=f"{done} of {total}"
            )
            self._move_whole()

    def ended(self, outcome: StageOutcome) -> None:
        """Replace the bar by a line."""
        if outcome.name in self._tasks:
            self._progress.remove_task(self._tasks.pop(outcome.name))
        self._ended += 1
        self._move_whole()
        time = f"{outcome.seconds:8.1f} s" if outcome.state == State.COMPLETED else ""
        line, warnings = f"  {outcome.name:<20} {state_word(outcome.state):<10}{time}", warnings_of([outcome])
        self.warnings += warnings
        counted = "" if self._warn_at_once or not warnings else f"  [yellow]warnings: {len(warnings)}[/]"
        self._console.print(f"{line}{counted}".rstrip(), highlight=False)
        for warning in warnings if self._warn_at_once else ():
            self._console.print(f"  [bold yellow]warning[/]: {escape(warning)}", highlight=False)

    def _move_whole(self) -> None:
        """Set the overall bar to the finished stages and the shares of the running ones."""
        if not self._stages:
            return
        running = [t for t in self._progress.tasks if t.id in self._tasks.values()]
        done = self._ended + sum(t.percentage / 100 for t in running)
        files = self._ended >= self._stages
        words = "writing files" if files else f"{self._ended} of {self._stages} stages"
        self._progress.update(self._whole, completed=done, total=self._stages, status=words)


def print_warnings(warnings: Iterable[str], console: Console) -> None:
    """Print warnings, a line each."""
    for warning in warnings:
        console.print(f"warning: {warning}", highlight=False)
