"""What commands that compute have in common: their parameters, and the progress that they show."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from pipeline.api.job import Job, run_job
from pipeline.machine.display import ProgressDisplay
from pipeline.machine.outcome import RunOutcome, warnings_of
from pipeline.machine.plan import Selection

ConfigFile = Annotated[
    Path | None, typer.Option("--config", metavar="FILE", help="parameters by stage (YAML)")
]
Assignments = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="STAGE.NAME=VALUE", help="one parameter; may be repeated"),
]


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
