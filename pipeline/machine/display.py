"""What a user sees while stages run."""

from __future__ import annotations

from types import TracebackType
from typing import Protocol, Self

from rich.console import Console
from rich.markup import escape
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from pipeline.machine.outcome import StageOutcome, State, warnings_of


class Display(Protocol):
    """Is told how the stages stand."""

    def started(self, stage: str) -> None:
        """Hear that a stage started."""

    def progressed(self, stage: str, done: int, total: int) -> None:
        """Hear how far a running stage is; several may run at a time, each on a thread of its own."""

    def ended(self, outcome: StageOutcome) -> None:
        """Hear how a stage ended."""


class SilentDisplay:
    """Shows nothing: for library use and tests."""

    def started(self, stage: str) -> None:
        """Ignore."""

    def progressed(self, stage: str, done: int, total: int) -> None:
        """Ignore."""

    def ended(self, outcome: StageOutcome) -> None:
        """Ignore."""


class ProgressDisplay:
    """A bar with the time left for each running stage, and a line for each stage that ended."""

    def __init__(self, console: Console) -> None:
        self._progress = Progress(
            TextColumn("{task.description:<20}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("for"),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            console=console,
            transient=True,
        )
        self._console = console
        self._tasks: dict[str, TaskID] = {}

    def __enter__(self) -> Self:
        self._progress.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._progress.stop()

    def started(self, stage: str) -> None:
        """Open a bar."""
        self._tasks[stage] = self._progress.add_task(stage, total=None)

    def progressed(self, stage: str, done: int, total: int) -> None:
        """Move the bar."""
        if stage in self._tasks:
            self._progress.update(self._tasks[stage], completed=done, total=total)

    def ended(self, outcome: StageOutcome) -> None:
        """Replace the bar by a line."""
        if outcome.name in self._tasks:
            self._progress.remove_task(self._tasks.pop(outcome.name))
        time = f"{outcome.seconds:8.1f} s" if outcome.state == State.COMPLETED else " " * 10
        self._console.print(f"  {outcome.name:<20} {outcome.state.value:<10}{time}", highlight=False)
        for warning in warnings_of([outcome]):
            self._console.print(f"  [bold yellow]warning[/]: {escape(warning)}", highlight=False)
