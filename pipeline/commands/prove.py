"""``boresight prove``: conceal effects in recordings, diagnose them, open the truth, and score."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from pipeline.commands.prove_report import write_report
from pipeline.disk import disk_errors_named
from pipeline.errors import BoresightError, InputError
from stages.diagnose.drill.cases import Case, DiagnosisFailedError, diagnose_apart, find_cases, trial_of
from stages.diagnose.drill.score import Rate, Trial, score


def prove(
    output: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="folder for the results")],
    sealed: Annotated[
        Path | None, typer.Option(metavar="DIR", help="recordings from elsewhere, NAME-gauge and NAME-field")
    ] = None,
    truth: Annotated[
        Path | None, typer.Option(metavar="DIR", help="their opened truth, NAME-gauge/truth.json and so on")
    ] = None,
    cases: Annotated[int, typer.Option(min=1, help="how many probes to draw, without --sealed")] = 10,
    prior: Annotated[Path | None, typer.Option(metavar="FILE", help="what to draw them from")] = None,
    seed: Annotated[int, typer.Option(min=0, help="of the draw")] = 0,
    leave_out: Annotated[
        bool,
        typer.Option(
            "--leave-out", help="diagnose each concealed effect again with it left out of the library"
        ),
    ] = False,
) -> None:
    """Prove the diagnosis on recordings in which an effect is concealed.

    Without --sealed, probes are drawn, effects concealed, and recordings rendered and sealed. Each is
    diagnosed by a process that is given the recordings only; then the truth is opened and scored. Answers
    that are there already are kept: an interrupted proof goes on where it stopped.
    """
    console = Console(stderr=True)
    with disk_errors_named(output):
        output.mkdir(parents=True, exist_ok=True)
        recordings, opened = _recordings(output, sealed, truth, cases, prior, seed, console)
        trials = list(_trials(find_cases(recordings), output, opened, leave_out, console))
        write_report(trials, output)
    _show(trials, console)
    console.print(f"Report: {output / 'proof.html'}")


def _recordings(
    output: Path,
    sealed: Path | None,
    truth: Path | None,
    cases: int,
    prior: Path | None,
    seed: int,
    console: Console,
) -> tuple[Path, Path]:
    """Return the folders of recordings and of their truth, drawn first where none are given."""
    if sealed is not None:
        if truth is None:
            raise InputError(
                sealed, "its truth is not given", hint="give the folder of opened truth, --truth"
            )
        return sealed, truth
    folder, opened = output / "recordings", output / "truth"
    words = ["simulate", "--draw", str(cases), "--seed", str(seed), "--seal", "-o", str(folder)]
    words += ["--truth", str(opened), *(("--prior", str(prior)) if prior else ())]
    with console.status(f"rendering {cases} probes"):
        done = subprocess.run([sys.executable, "-m", "pipeline.cli", *words], check=False)
    if done.returncode:
        raise BoresightError(f"the recordings could not be rendered: simulate ended with {done.returncode}")
    return folder, opened


def _trials(
    cases: tuple[Case, ...], output: Path, opened: Path, leave_out: bool, console: Console
) -> Iterator[Trial]:
    for number, case in enumerate(cases, 1):
        answer = output / "answers" / case.name
        with console.status(f"diagnosing {case.name}, {number} of {len(cases)}"):
            if not _answered(case, answer, (), console):
                continue
        trial = trial_of(case, answer, opened)
        yield trial
        if leave_out and len(trial.truth) == 1:
            without = tuple(trial.truth)
            answer = output / "answers-without" / case.name
            with console.status(f"diagnosing {case.name} without {without[0]}"):
                if _answered(case, answer, without, console):
                    yield trial_of(case, answer, opened, without)


def _answered(case: Case, answer: Path, without: tuple[str, ...], console: Console) -> bool:
    """Diagnose; a case that gives no answer is told and left out of no count silently."""
    try:
        diagnose_apart(case, answer, without)
    except DiagnosisFailedError as error:
        console.print(f"no answer: {error}", style="red", highlight=False)
        return False
    return True


def _show(trials: list[Trial], console: Console) -> None:
    table = Table(title=f"{len(trials)} diagnoses against what was concealed")
    for heading in ("", "share", "of", "95 % interval"):
        table.add_column(heading)
    for name, value in vars(score(trials)).items():
        if isinstance(value, Rate):
            low, high = value.interval
            table.add_row(
                name.replace("_", " "), f"{value.share:.3f}", str(value.of), f"{low:.3f}–{high:.3f}"
            )
        else:
            table.add_row(name.replace("_", " "), f"{value:.3f}", "", "")
    console.print(table)
