"""``boresight reproduce``: computes a run again from its record, and compares every file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import typer
import yaml
from rich.console import Console

from pipeline.api.job import Job, open_job, run_job
from pipeline.errors import BoresightError, InputError
from pipeline.export.catalogue import EXPORTERS
from pipeline.export.run_record import RunRecord, check_inputs_unchanged, read_run_record
from pipeline.files.disk import disk_errors_named
from pipeline.files.provenance import library_versions
from pipeline.machine.configuration import resolve
from pipeline.machine.display import ProgressDisplay
from pipeline.machine.plan import Selection
from pipeline.machine.run_folder import Exporter, RunFolder, published_files
from stages.catalogue import PIPELINE

# Files that contain the time at which they were made; their content is in the other files, too.
_DATED = frozenset({"report.html"})


class Agreement(StrEnum):
    """Comparison of a file of the run with the one computed again."""

    SAME = "same"
    DIFFERENT = "different"
    CHANGED = "changed after the run"
    MISSING = "not made again"
    NEW = "only made now"


@dataclass(frozen=True)
class Compared:
    """A file of the run folder and the result of its comparison."""

    file: str
    agreement: Agreement


class NotReproducedError(BoresightError):
    """A run whose results were not reproduced."""


def reproduce(
    run: Annotated[Path, typer.Argument(help="Run folder of a completed run.")],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="RUN", help="Keep the run computed again here.")
    ] = None,
) -> None:
    """Compute a run again from its recording, probe and parameters; fail when a file differs."""
    record = read_run_record(run)
    if output is not None and output.resolve() == run.resolve():
        raise InputError(
            output, "is the run itself, which would be lost", expected="another folder for the run made again"
        )
    with _temporary_folder() as temporary:
        again = output or temporary / "run"
        job = _job(record, again, temporary)
        check_inputs_unchanged(record, job.plan.input_hashes())
        with ProgressDisplay(Console(stderr=True)) as display:
            run_job(job, Selection("", "", True), display)
        compared = compare_runs(RunFolder(run), RunFolder(again), EXPORTERS)
    _tell(compared, record)


@contextmanager
def _temporary_folder() -> Iterator[Path]:
    with ExitStack() as stack:
        with disk_errors_named(
            Path("the system's temporary folder"), hint="free space there, or set TMPDIR to another"
        ):
            folder = stack.enter_context(TemporaryDirectory(prefix="boresight-"))
        yield Path(folder)


def _job(record: RunRecord, folder: Path, temporary: Path) -> Job:
    parameters = temporary / "configuration.yaml"
    with disk_errors_named(temporary):
        parameters.write_text(yaml.safe_dump({s: dict(p) for s, p in record.configuration.items()}), "utf-8")
    configuration = resolve(PIPELINE, parameters)
    return open_job(record.recording, folder, record.probe, PIPELINE, EXPORTERS, configuration)


def compare_runs(run: RunFolder, again: RunFolder, exporters: Sequence[Exporter]) -> tuple[Compared, ...]:
    """Return every published file of both folders but the dated report, with how they stand to each other."""
    before = {n: r for e in exporters for n, r in published_files(e, run).items()}
    after = {n: r for e in exporters for n, r in published_files(e, again).items()}
    out = []
    for name in sorted((before.keys() | after.keys()) - _DATED):
        if name not in before:
            state = Agreement.NEW
        elif not before[name].matches(run.path / name):
            state = Agreement.CHANGED
        elif name not in after:
            state = Agreement.MISSING
        else:
            state = Agreement.SAME if before[name] == after[name] else Agreement.DIFFERENT
        out.append(Compared(name, state))
    return tuple(out)


def _tell(compared: tuple[Compared, ...], record: RunRecord) -> None:
    for file in compared:
        if file.agreement is not Agreement.SAME:
            typer.echo(f"{file.file:<48} {file.agreement}")
    counts = Counter(c.agreement for c in compared)
    typer.echo(", ".join(f"{count} {state}" for state, count in counts.items()))
    if counts[Agreement.SAME] < len(compared):
        raise NotReproducedError(f"not reproduced; {_versions(record)}")


def _versions(record: RunRecord) -> str:
    """Return which libraries are others than those of the run."""
    now = library_versions()
    changed = [
        f"{name} {was} then, {now.get(name)} now"
        for name, was in record.libraries.items()
        if now.get(name) != was
    ]
    return "; ".join(changed) or "the libraries are those of the run"
