"""``boresight prove``: conceal effects in recordings, diagnose them, open the truth, and score."""

from __future__ import annotations

import json
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from statistics import median
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from pipeline.commands import PriorFile, ResultFolder
from pipeline.commands.prove_cases import Drawing, NotRenderedError, Worked, draw_case, require_seal, worked
from pipeline.drill.cases import find_cases
from pipeline.drill.score import Figure, Trial, calibration, confusion, figures, shuffled
from pipeline.errors import InputError
from pipeline.files.disk import require_writable, written_together
from pipeline.files.installed import PRIORS, file_or_shipped
from pipeline.files.provenance import MadeBy
from pipeline.pages import page_template


def write_report(done: Sequence[Worked], folder: Path) -> None:
    """Write proof.json and proof.html."""
    document = report_document(done)
    text = json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False)
    (folder / "proof.json").write_text(text + "\n", "utf-8")
    (folder / "proof.html").write_text(page_template("prove").render(d=document), "utf-8")


def report_document(done: Sequence[Worked]) -> dict[str, Any]:
    """Return the report as plain data; a figure of no trials has the value None."""
    trials = [trial for case in done for trial in case.trials]
    seconds = [case.seconds for case in done if case.seconds is not None]
    return {
        "format": 2,
        "made_by": MadeBy("prove", {}).document(),
        "figures": [vars(row) | {"text": row.text} for row in rows_of(done)],
        "seconds": {"median": median(seconds), "most": max(seconds), "of": len(seconds)} if seconds else None,
        "unanswered": [failure for case in done if case.trials for failure in case.failures],
        "not_rendered": [failure for case in done if not case.trials for failure in case.failures],
        "confusion": [
            {"concealed": truth, "said": said, "count": count}
            for (truth, said), count in sorted(confusion(trials).items())
        ],
        "calibration": [
            {"probability": mean, "right": r.share, "of": r.of, "interval": r.interval}
            for mean, r in calibration(trials)
        ],
        "trials": [_trial(t) for t in trials],
        "wall_errors_mm": {c.trials[0].name: vars(c.wall) for c in done if c.wall is not None},
    }


def rows_of(done: Sequence[Worked]) -> tuple[Figure, ...]:
    """Return the rows of the table, the wall's error among them."""
    ratios = [
        case.wall.corrected_mm / case.wall.oracle_mm
        for case in done
        if case.wall is not None and case.trials[0].concealed
    ]
    words = "Median wall error after correction, relative to that with the true instrument"
    value = median(ratios) if ratios else None
    wall = Figure("wall_error", words, "≤ 1.1", value, len(ratios), None)
    return (*figures([trial for case in done for trial in case.trials]), wall)


def _trial(trial: Trial) -> dict[str, Any]:
    return {
        "name": trial.name,
        "concealed": [c.model_dump() for c in trial.concealed],
        "left_out": list(trial.left_out),
        "verdict": trial.answer.verdict,
        "said": [e.model_dump() for e in trial.answer.effects],
        "class": list(trial.answer.members),
        "global_p": trial.answer.global_p,
        "exact": trial.exact,
        "misnamed": trial.misnamed,
        "snr": trial.snr,
        "identifiable": trial.identifiable,
    }


def prove(
    output: ResultFolder,
    sealed: Annotated[
        Path | None, typer.Option(metavar="DIR", help="recordings from elsewhere, NAME-gauge and NAME-field")
    ] = None,
    truth: Annotated[
        Path | None, typer.Option(metavar="DIR", help="their opened truth, NAME-gauge/truth.json and so on")
    ] = None,
    cases: Annotated[
        int, typer.Option(min=1, help="number of probes to draw, where --sealed is not given")
    ] = 10,
    prior: PriorFile = Path("pairs"),
    seed: Annotated[int, typer.Option(min=0, help="random seed of the draw")] = 0,
    leave_out: Annotated[
        bool,
        typer.Option(
            "--leave-out", help="diagnose each concealed effect again with it left out of the library"
        ),
    ] = False,
    shuffle: Annotated[
        bool,
        typer.Option(
            "--shuffle", help="score every case by another case's answer: scores must drop to chance"
        ),
    ] = False,
    workers: Annotated[int, typer.Option(min=1, help="number of cases processed at a time")] = 1,
) -> None:
    """Prove the diagnosis on recordings in which an effect is concealed.

    Without --sealed, probes are drawn, effects concealed, and recordings rendered and sealed. Each is
    diagnosed by a process that gets only the recordings; then the seal is checked, the truth opened and the
    answer scored. Existing results are kept: an interrupted proof continues where it stopped, also within a
    case.
    """
    console = Console(stderr=True)
    require_writable(output)
    if sealed is None:
        drawing = Drawing(file_or_shipped(prior, PRIORS), seed, output / "recordings", output / "truth")
        done = _drawn_and_worked(drawing, cases, output, leave_out, workers, console)
    else:
        done = _sealed_and_worked(sealed, truth, output, leave_out, workers, console)
    if shuffle:
        _show(_shuffled(done), console)
        return
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
            # An effect that is too small to show in its scene is refused: the others continue.
            return _shown(Worked((), None, (str(error),), None), console)
        return _shown(worked(case, output, drawing.truth, leave_out), console)

    with ThreadPoolExecutor(workers) as pool:
        return list(pool.map(work, range(cases)))


def _sealed_and_worked(
    sealed: Path, truth: Path | None, output: Path, leave_out: bool, workers: int, console: Console
) -> list[Worked]:
    if truth is None:
        raise InputError(sealed, "its truth is not stated", hint="state the folder of its truth with --truth")
    cases = find_cases(sealed)
    for case in cases:
        require_seal(case, truth)
    with ThreadPoolExecutor(workers) as pool:
        return list(pool.map(lambda case: _shown(worked(case, output, truth, leave_out), console), cases))


def _shuffled(done: Sequence[Worked]) -> list[Worked]:
    """Return all trials, each with the answer to a case with another effect, without wall errors."""
    trials = shuffled([trial for case in done for trial in case.trials])
    return [Worked(trials, seconds=None, failures=(), wall=None)]


def _shown(done: Worked, console: Console) -> Worked:
    """Report on the console a case that gave no answer."""
    words = "no answer" if done.trials else "not rendered"
    for failure in done.failures:
        console.print(f"{words}: {failure}", style="red", highlight=False)
    return done


def _show(done: Sequence[Worked], console: Console) -> None:
    trials = [trial for case in done for trial in case.trials]
    table = Table(title=f"{len(trials)} diagnoses compared with the concealed effects")
    for heading in ("", "value", "of", "95 % interval", "goal"):
        table.add_column(heading)
    for row in rows_of(done):
        value = "none" if row.value is None else f"{row.value:.3f}"
        interval = "" if row.interval is None else f"{row.interval[0]:.3f}–{row.interval[1]:.3f}"
        table.add_row(row.words, value, str(row.of), interval, row.goal)
    console.print(table)
