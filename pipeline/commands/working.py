"""A job run by a command: its progress shown, its warnings printed."""

from __future__ import annotations

from collections.abc import Iterable

from rich.console import Console

from pipeline.api.job import Job, run_job
from pipeline.machine.display import ProgressDisplay
from pipeline.machine.outcome import RunOutcome, warnings_of
from pipeline.machine.plan import Selection


def worked(job: Job, console: Console) -> RunOutcome:
    """Run a job with its progress shown, and print those of its warnings that were not shown with it.

    Raises
    ------
    BoresightError
        As `run_job` raises it.
    """
    with ProgressDisplay(console) as display:
        outcome = run_job(job, Selection(), display)
    print_warnings((w for w in warnings_of(outcome.stages) if w not in display.warnings), console)
    return outcome


def print_warnings(warnings: Iterable[str], console: Console) -> None:
    """Print warnings, a line each."""
    for warning in warnings:
        console.print(f"warning: {warning}", highlight=False)
