"""``boresight prove``: conceal effects in recordings, diagnose them, open the truth, and score."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from pipeline.commands.prove_cases import (
    Drawing,
    NotRenderedError,
    Worked,
    draw_case,
    require_seal,
    sweep,
    worked,
)
from pipeline.commands.prove_report import rows_of, write_report
from pipeline.errors import InputError
from pipeline.files.disk import require_writable, written_together
from pipeline.files.shipped import PRIORS, file_or_shipped
from stages.diagnose.drill.cases import find_cases


def prove(
    output: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="folder for the results")],
    sealed: Annotated[
        Path | None, typer.Option(metavar="DIR", help="recordings from elsewhere, NAME-gauge and NAME-field")
    ] = None,
    truth: Annotated[
        Path | None, typer.Option(metavar="DIR", help="their opened truth, NAME-gauge/truth.json and so on")
    ] = None,
    cases: Annotated[int, typer.Option(min=1, help="how many probes to draw, without --sealed")] = 10,
    prior: Annotated[
        Path, typer.Option(metavar="FILE", help="what to draw from: a file, or the name of a shipped one")
    ] = Path("pairs"),
    seed: Annotated[int, typer.Option(min=0, help="of the draw")] = 0,
    leave_out: Annotated[
        bool,
        typer.Option(
            "--leave-out", help="diagnose each concealed effect again with it left out of the library"
        ),
    ] = False,
    workers: Annotated[int, typer.Option(min=1, help="cases that are worked on at a time")] = 1,
) -> None:
    """Prove the diagnosis on recordings in which an effect is concealed.

    Without --sealed, probes are drawn, effects concealed, and recordings rendered and sealed. Each is
    diagnosed by a process that is given the recordings only; then the seal is checked, the truth opened and
    scored. What is there already is kept: an interrupted proof goes on where it stopped.
    """
    console = Console(stderr=True)
    require_writable(output)
    sweep(output)
    if sealed is None:
        drawing = Drawing(file_or_shipped(prior, PRIORS), seed, output / "recordings", output / "truth")
        done = _drawn_and_worked(drawing, cases, output, leave_out, workers, console)
    else:
        done = _sealed_and_worked(sealed, truth, output, leave_out, workers, console)
    with written_together(output, last="proof.json") as folder:
        write_report(done, folder)
    _show(done, console)
    console.print(f"Report: {output / 'proof.html'}")


def _drawn_and_worked(
    drawing: Drawing, cases: int, output: Path, leave_out: bool, workers: int, console: Console
) -> list[Worked]:
    """Draw, render and diagnose one case after the other, several at a time."""

    def work(index: int) -> Worked:
        try:
            case = draw_case(drawing, index)
        except NotRenderedError as error:
            # An effect too small for its scene to show is refused: the others go on.
            return _told(Worked((), None, (str(error),), None), console)
        return _told(worked(case, output, drawing.truth, leave_out), console)

    with ThreadPoolExecutor(workers) as pool:
        return list(pool.map(work, range(cases)))


def _sealed_and_worked(
    sealed: Path, truth: Path | None, output: Path, leave_out: bool, workers: int, console: Console
) -> list[Worked]:
    if truth is None:
        raise InputError(sealed, "its truth is not given", hint="give the folder of opened truth, --truth")
    cases = find_cases(sealed)
    for case in cases:
        require_seal(case, truth)
    with ThreadPoolExecutor(workers) as pool:
        return list(pool.map(lambda case: _told(worked(case, output, truth, leave_out), console), cases))


def _told(done: Worked, console: Console) -> Worked:
    """Tell on the console of a case that gave no answer."""
    words = "no answer" if done.trials else "not rendered"
    for failure in done.failures:
        console.print(f"{words}: {failure}", style="red", highlight=False)
    return done


def _show(done: Sequence[Worked], console: Console) -> None:
    trials = [trial for case in done for trial in case.trials]
    table = Table(title=f"{len(trials)} diagnoses against what was concealed")
    for heading in ("", "value", "of", "95 % interval", "goal"):
        table.add_column(heading)
    for row in rows_of(done):
        value = "none" if row.value is None else f"{row.value:.3f}"
        interval = "" if row.interval is None else f"{row.interval[0]:.3f}–{row.interval[1]:.3f}"
        table.add_row(row.words, value, str(row.of), interval, row.goal)
    console.print(table)
