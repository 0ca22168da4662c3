"""The command line: one thin command each. Whatever is slow to import is imported inside its command."""

from __future__ import annotations

import shlex
import sys
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pipeline.errors import BoresightError, Cancelled, UnusableError

if TYPE_CHECKING:
    from rich.console import Console

    from pipeline.machine.outcome import RunOutcome

_EXIT_FAILED, _EXIT_REFUSED, _EXIT_UNUSABLE, _EXIT_CANCELLED = 1, 2, 3, 130


@dataclass(frozen=True)
class _Attached:
    """A command that lives in ``pipeline.commands`` and is imported only when it is called."""

    name: str
    summary: str

    @property
    def module(self) -> str:
        """Module of the command; the function in it bears the module's name."""
        return self.name.replace("-", "_")


_ATTACHED = (
    _Attached("error-model", "What a misaligned laser sheet does to the radius; tables, figures, page."),
    _Attached("error-budget", "Every source of error, its share in the radius, and what dominates."),
    _Attached("batch", "Run many recordings, on local workers or a Dask scheduler; resumable."),
    _Attached("calibrate", "Find camera and laser sheet, with covariance, from a gauge run."),
    _Attached("calibrate-camera", "Calibrate a camera from pictures of boards."),
    _Attached("calibrate-laser", "Find the laser plane from pictures of a board with the line across it."),
    _Attached("diagnose", "Find what physics was left out, where it shows, and what bears it out."),
    _Attached("prove", "Conceal effects in recordings, diagnose them, open the truth, and score."),
    _Attached("simulate", "Render recordings from a scene, with their truth apart."),
    _Attached("gallery", "What each known effect does: picture, residual, law, size, likeness; a page."),
    _Attached("open-seal", "Verify that a truth is the one a recording was sealed with."),
    _Attached("review", "Go through a run in the browser: decide on each finding, measure, sign."),
    _Attached("reproduce", "Compute a run again from what its record names, and compare every file."),
    _Attached("verify", "Compare a run with a known bore, a reference model or truth: a certificate."),
)

app = typer.Typer(
    name="boresight",
    help="Turns a recorded laser-ring run through a pipe into a measured, textured pipe model.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

_ConfigFile = Annotated[
    Path | None, typer.Option("--config", metavar="FILE", help="Parameters (YAML); see: boresight config.")
]
_Assignments = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="STAGE.NAME=VALUE", help="One parameter; may be repeated."),
]


@app.command()
def run(
    recording: Annotated[Path, typer.Argument(help="Recording: a folder or a bag.")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="RUN", help="Run folder.")],
    probe: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Probe to use in place of the recording's own.")
    ] = None,
    config: _ConfigFile = None,
    assignments: _Assignments = None,
    from_stage: Annotated[
        str, typer.Option("--from", metavar="STAGE", help="Compute this stage and all after it again.")
    ] = "",
    only: Annotated[str, typer.Option(metavar="STAGE", help="Run this stage alone.")] = "",
    resume: Annotated[
        bool, typer.Option("--resume/--no-resume", help="Continue from what is there, or start afresh.")
    ] = True,
    follow: Annotated[
        bool, typer.Option(help="The recording is still being written: show it live, run it when it rests.")
    ] = False,
    quiet_s: Annotated[
        float, typer.Option(min=1, help="With --follow: at rest after so many seconds without growth.")
    ] = 10.0,
) -> None:
    """Turn a recording into a run folder: model, measurements, defects and report."""
    from rich.console import Console

    from pipeline.api.job import run_job
    from pipeline.api.run import configuration, prepare
    from pipeline.machine.display import ProgressDisplay
    from pipeline.machine.plan import Selection

    console = Console(stderr=True)
    parameters = configuration(config, assignments or ())
    if follow:
        from pipeline.commands.follow import follow as follow_recording

        follow_recording(recording, output, probe, quiet_s, console)
    job = prepare(recording, output, probe=probe, configuration=parameters)
    _print_inputs(console, job.recording.name, job.recording.warnings)
    try:
        with ProgressDisplay(console) as display:
            outcome = run_job(job, Selection(from_stage, only, resume), display)
    except UnusableError:
        # What was wrong with the recording from the start is the likeliest reason: it is said again.
        _print_inputs(console, job.recording.name, job.recording.warnings)
        raise
    _print_outcome(outcome, output)


@app.command()
def stages() -> None:
    """List the stages in order, with what each needs and makes."""
    from stages.catalogue import PIPELINE

    for stage in PIPELINE:
        needs = ", ".join(kind.__name__ for kind in stage.inputs().values())
        typer.echo(f"{stage.name:<12} {stage.summary}")
        typer.echo(f"{'':<12} version {stage.version}: {needs} -> {stage.output().__name__}")


@app.command()
def config(
    file: _ConfigFile = None,
    assignments: _Assignments = None,
    default: Annotated[
        bool, typer.Option("--default", help="Print the defaults with meaning, unit and range.")
    ] = False,
) -> None:
    """Print the configuration that a run would use, as YAML."""
    from pipeline.api.run import configuration
    from pipeline.machine.configuration import default_text, resolved_text
    from stages.catalogue import PIPELINE

    text = default_text(PIPELINE) if default else resolved_text(configuration(file, assignments or ()))
    typer.echo(text, nl=False)


def main() -> None:
    """Run the command line; a refusal is told as text, with its own exit code."""
    try:
        app()
    except BoresightError as error:
        typer.echo(f"boresight: {error}", err=True)
        sys.exit(_exit_code(error))


def _exit_code(error: BoresightError) -> int:
    from pipeline.machine.runner import FailedError

    codes: tuple[tuple[type[BoresightError], int], ...] = (
        (FailedError, _EXIT_FAILED),
        (UnusableError, _EXIT_UNUSABLE),
        (Cancelled, _EXIT_CANCELLED),
    )
    return next((code for kind, code in codes if isinstance(error, kind)), _EXIT_REFUSED)


def _attach(command: _Attached) -> None:
    """Put a command into the list; its module is imported when it is called, and parses its own words."""

    def forward(context: typer.Context) -> None:
        module = import_module(f"pipeline.commands.{command.module}")
        own = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
        own.command(name=command.name)(getattr(module, command.module))
        own(args=context.args, prog_name=f"boresight {command.name}")

    passing_on = {"allow_extra_args": True, "ignore_unknown_options": True}
    app.command(command.name, help=command.summary, add_help_option=False, context_settings=passing_on)(
        forward
    )


def _print_inputs(console: Console, name: str, warnings: tuple[str, ...]) -> None:
    from rich.text import Text

    console.print(f"Recording {name}", highlight=False)
    for warning in warnings:
        console.print(Text.assemble(("  noticed", "bold yellow"), f": {warning}"))


def _print_outcome(outcome: RunOutcome, folder: Path) -> None:
    from pipeline.machine.outcome import warnings_of

    for number in outcome.metrics:
        typer.echo(f"{number.name:<48} {number.value} {number.unit}".rstrip())
    for stage in outcome.stages:
        for number in stage.numbers:
            if "rejected" in number.name and number.value:
                typer.echo(f"{stage.name + ': ' + number.name:<48} {number.value} {number.unit}".rstrip())
    for warning in warnings_of(outcome.stages):
        typer.echo(f"warning: {warning}", err=True)
    report = folder / "report.html"
    typer.echo(f"Report: {report.resolve()}" if report.is_file() else f"Run folder: {folder.resolve()}")
    if report.is_file():
        typer.echo(f"To go through it, decide and sign: boresight review {shlex.quote(str(folder))}")


for _command in _ATTACHED:
    _attach(_command)

if __name__ == "__main__":
    main()
