"""``boresight batch``: run many recordings, on local workers or a cluster."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from pipeline.batch import BatchOutcome, Work, find_recordings, write_summary
from pipeline.batch.cluster import Cluster, LocalWorkers, RunningScheduler, outcomes, read_cluster, workers
from pipeline.commands import Assignments
from pipeline.errors import InputError
from pipeline.files.disk import disk_errors_named
from pipeline.machine.configuration import resolve
from pipeline.machine.outcome import state_word
from stages.catalogue import PIPELINE

# Exit status where some recordings failed and the batch itself did not.
_EXIT_SOME_FAILED = 3


def batch(
    folder: Annotated[Path, typer.Argument(help="folder of recordings, searched to any depth")],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="OUT", help="folder for the runs")],
    count: Annotated[
        int | None,
        typer.Option("--workers", min=1, help="number of local workers (default: one for each core)"),
    ] = None,
    scheduler: Annotated[
        str, typer.Option(metavar="ADDRESS", help="Dask scheduler in place of local workers, tcp://HOST:PORT")
    ] = "",
    probe: Annotated[
        Path | None, typer.Option(metavar="FILE", help="probe to use in place of the recordings' own")
    ] = None,
    config: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="parameters and, where wanted, the section cluster (YAML)"),
    ] = None,
    assignments: Assignments = None,
) -> None:
    """Run every recording below a folder; one that fails stops no other.

    Writes OUT/NAME for each, batch.json and batch.html. Completed runs are not computed again.
    """
    resolve(PIPELINE, config, assignments or ())
    cluster = _cluster(count, scheduler, config)
    options = _options(probe, config, assignments or [])
    found = find_recordings(folder)
    console = Console(stderr=True)
    done: list[BatchOutcome] = []
    with disk_errors_named(output):
        output.mkdir(parents=True, exist_ok=True)
    works = [Work(n, p.resolve(), (output / n).resolve(), options) for n, p in found.items()]
    with workers(cluster) as client:
        for outcome in outcomes(client, works):
            done.append(outcome)
            console.print(
                f"{len(done)}/{len(works)}  {outcome.name}: {state_word(outcome.state)}", highlight=False
            )
            with suppress(InputError):  # a full disk does not stop the runs; it is reported at the end
                write_summary(done, output)
    write_summary(done, output)
    typer.echo(f"Summary: {(output / 'batch.html').resolve()}")
    if any(e.state != "completed" for e in done):
        raise typer.Exit(_EXIT_SOME_FAILED)


def _cluster(count: int | None, scheduler: str, config: Path | None) -> Cluster:
    if count and scheduler:
        raise InputError(
            "--workers",
            "and --scheduler exclude each other",
            hint="use one of them: a scheduler has its own workers",
        )
    if scheduler:
        return RunningScheduler(address=scheduler)
    return LocalWorkers(count=count) if count else read_cluster(config)


def _options(probe: Path | None, config: Path | None, assignments: list[str]) -> tuple[str, ...]:
    words = ["--probe", str(probe.resolve())] if probe else []
    words += ["--config", str(config.resolve())] if config else []
    return (*words, *(w for a in assignments for w in ("--set", a)))
