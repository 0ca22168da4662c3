"""``boresight diagnose``: finds left-out physics, where it shows, and the evidence for it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from pipeline.api.diagnosis import diagnose as diagnosis
from pipeline.commands import Assignments, ConfigFile, ResultFolder, StatedProbe
from pipeline.drill.answer import Answer
from pipeline.machine.display import ProgressDisplay, print_warnings


def diagnose(
    output: ResultFolder,
    field: Annotated[Path | None, typer.Argument(help="recording of an inspection")] = None,
    gauge: Annotated[
        Path | None, typer.Option(metavar="GAUGE", help="recording of the same probe's run through a gauge")
    ] = None,
    probe: StatedProbe = None,
    without: Annotated[
        list[str] | None,
        typer.Option("--without", metavar="NAME", help="leave an effect out of the library; repeatable"),
    ] = None,
    apply: Annotated[
        bool, typer.Option("--apply", help="reconstruct the inspection with the corrected probe")
    ] = False,
    run: Annotated[
        Path | None,
        typer.Option("--run", metavar="RUN", help="run of FIELD whose results and parameters are used"),
    ] = None,
    config: ConfigFile = None,
    assignments: Assignments = None,
) -> None:
    """Find left-out physics from an inspection and a gauge run of one probe; either may be missing.

    Writes diagnosis.json, diagnosis.html, arrays.npz, and probe.yaml corrected for the effects found; with
    --apply also the inspection reconstructed with that probe, in run.
    """
    console = Console(stderr=True)
    with ProgressDisplay(console) as display:
        found = diagnosis.diagnose(
            field, gauge=gauge, output=output, probe=probe, run=run, without=without or (), apply=apply,
            config=config, settings=assignments or (), display=display,
        )  # fmt: skip
    print_warnings(found.warnings, console)
    _show(found.answer, output, console)
    if found.consequence:
        console.print(found.consequence)


def _show(answer: Answer, output: Path, console: Console) -> None:
    chance = "not known" if answer.global_p is None else f"{answer.global_p:.2g}"
    console.print(f"Verdict: {answer.verdict} (probability of such a result by chance alone: {chance})")
    if answer.unexamined:
        console.print(f"Not examined: {', '.join(answer.unexamined)}")
    for e in answer.effects:
        console.print(f"  {e.name} ({e.probability:.1%}): {e.statement}")
    console.print(f"Report: {output / 'diagnosis.html'}")
