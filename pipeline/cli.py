"""The command line: one thin command each. Whatever is slow to import is imported inside its command."""

from __future__ import annotations

import gc
import shlex
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from pipeline.commands import Assignments, ConfigFile
from pipeline.errors import BoresightError, Cancelled, UnusableError

if TYPE_CHECKING:
    from rich.console import Console

    from pipeline.machine.outcome import RunOutcome

_EXIT_FAILED, _EXIT_REFUSED, _EXIT_UNUSABLE, _EXIT_CANCELLED = 1, 2, 3, 130


@dataclass(frozen=True)
class _Attached:
    """A command that lives in ``pipeline.commands`` and is imported only when it is called."""

    group: str
    name: str
    summary: str

    @property
    def module(self) -> str:
        """Module of the command; the function in it bears the module's name."""
        return self.name.replace("-", "_")

    def loaded(self) -> Any:
        """Return the command itself, with its own options, ready to be called."""
        module = import_module(f"pipeline.commands.{self.module}")
        own = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
        own.command(name=self.name)(getattr(module, self.module))
        return typer.main.get_command(own)


_INSPECT, _INSTRUMENT, _SIMULATE, _MANY = (
    "Inspect a pipe",
    "The instrument",
    "Simulate and prove",
    "Many runs",
)
_ATTACHED = (
    _Attached(_INSPECT, "review", "Go through a run in the browser: decide on each finding, measure, sign."),
    _Attached(_INSPECT, "verify", "Compare a run with a known bore, a reference or truth: a certificate."),
    _Attached(_INSPECT, "twin", "Recorded frames beside the same, re-rendered: where they differ, and why."),
    _Attached(_INSPECT, "reproduce", "Compute a run again from its record, and compare every file."),
    _Attached(_INSTRUMENT, "calibrate", "Find camera and laser sheet, with covariance, from a gauge run."),
    _Attached(_INSTRUMENT, "calibrate-camera", "Calibrate a camera from pictures of boards."),
    _Attached(_INSTRUMENT, "calibrate-laser", "Find the laser plane from pictures of a board and the line."),
    _Attached(
        _INSTRUMENT, "diagnose", "Find what physics was left out, where it shows, and what supports it."
    ),
    _Attached(_INSTRUMENT, "error-model", "What a misaligned laser sheet does to the radius: tables, page."),
    _Attached(_INSTRUMENT, "error-budget", "Every source of error, its share in the radius, what dominates."),
    _Attached(_SIMULATE, "simulate", "Render recordings from a scene, with their truth apart."),
    _Attached(_SIMULATE, "gallery", "What each known effect does: picture, law, size, likeness; a page."),
    _Attached(_SIMULATE, "prove", "Conceal effects in recordings, diagnose them, open the truth, score."),
    _Attached(_SIMULATE, "open-seal", "Verify that a truth is the one a recording was sealed with."),
    _Attached(_MANY, "batch", "Run many recordings, on local workers or a Dask scheduler; resumable."),
)


class _Commands(TyperGroup):
    """Lists all commands at once, and imports the module of one when it is called or completed."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return a command's name, the command, and the words that are left for it."""
        name, command, rest = super().resolve_command(ctx, args)
        attached = next((a for a in _ATTACHED if a.name == name), None)
        if attached is None:
            return name, command, rest
        if sys.stderr.isatty() and not ctx.resilient_parsing:  # what is imported next can take seconds
            typer.echo(f"boresight {name} is starting", err=True)
        return name, attached.loaded(), rest


app = typer.Typer(name="boresight", cls=_Commands, no_args_is_help=True, pretty_exceptions_enable=False)


def _tell_version(wanted: bool) -> None:
    if wanted:
        from pipeline.files.installed import program_version

        typer.echo(f"boresight {program_version()}")
        raise typer.Exit


@app.callback()
def boresight(
    version: Annotated[
        bool, typer.Option("--version", callback=_tell_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Turn a recorded laser-ring run through a pipe into a measured, textured pipe model."""


@app.command(rich_help_panel=_INSPECT)
def run(
    recording: Annotated[Path, typer.Argument(help="Recording: a folder or a bag.")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="RUN", help="Run folder.")],
    probe: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Probe to use in place of the recording's own.")
    ] = None,
    config: ConfigFile = None,
    assignments: Assignments = None,
    twin: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Folder of a twin: dirt and drops that it found are kept out of photo and rings.",
        ),
    ] = None,
    from_stage: Annotated[
        str, typer.Option("--from", metavar="STAGE", help="Compute this stage and all after it again.")
    ] = "",
    only: Annotated[str, typer.Option(metavar="STAGE", help="Run this stage alone.")] = "",
    resume: Annotated[
        bool,
        typer.Option(
            "--resume/--no-resume", help="Continue from the results that are there, or compute all anew."
        ),
    ] = True,
    follow: Annotated[
        bool,
        typer.Option(
            help="The recording is still being written: show it live, and run it once it no longer grows."
        ),
    ] = False,
    quiet_s: Annotated[
        float,
        typer.Option(
            min=1, help="With --follow: seconds without growth after which the recording is complete."
        ),
    ] = 10.0,
) -> None:
    """Turn a recording into a run folder: model, measurements, defects and report."""
    typer.echo(f"Opening {recording}", err=True)  # at once: what is imported next takes seconds
    gc.disable()  # what is imported stays: looking for garbage in it takes a fiftieth of a run
    from rich.console import Console

    from pipeline.api.dirt import dirt_of
    from pipeline.api.job import run_job
    from pipeline.api.run import configuration, prepare
    from pipeline.machine.display import ProgressDisplay
    from pipeline.machine.plan import Selection
    from pipeline.system.kernels import compiled_ahead

    gc.freeze()
    gc.enable()
    console = Console(stderr=True)
    parameters = configuration(config, [*dirt_of(twin), *(assignments or ())])
    if follow:
        from pipeline.commands.follow import follow as follow_recording

        follow_recording(recording, output, probe, quiet_s, console)
    job = prepare(recording, output, probe=probe, configuration=parameters)
    _warn(console, "Look at this first", job.recording.warnings)
    display = ProgressDisplay(console, warn_at_once=False)
    try:
        with display, compiled_ahead(kernels_of_a_run()):
            outcome = run_job(job, Selection(from_stage, only, resume), display)
        _print_outcome(outcome, output)
    finally:
        # What was wrong with the recording from the start is the likeliest reason of what went wrong later.
        _warn(console, "Before you rely on this run", (*job.recording.warnings, *display.warnings))


@app.command(rich_help_panel=_INSPECT)
def stages() -> None:
    """List the stages in order, with what each needs and makes."""
    from stages.catalogue import PIPELINE

    for stage in PIPELINE:
        needs = ", ".join(kind.__name__ for kind in stage.inputs().values())
        typer.echo(f"{stage.name:<12} {stage.summary}")
        typer.echo(f"{'':<12} version {stage.version}: {needs} -> {stage.output().__name__}")


@app.command(rich_help_panel=_INSPECT)
def config(
    file: ConfigFile = None,
    assignments: Assignments = None,
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


def kernels_of_a_run() -> dict[str, dict[str, str]]:
    """Return the kernels of a run, by module and function."""
    from pipeline.files.installed import KERNELS, shipped_file
    from pipeline.files.json_yaml import read_yaml

    listed = read_yaml(shipped_file("run", KERNELS))
    modules = {module: listed.section(module) for module in map(str, listed.values)}
    return {m: {f: part.text(f) for f in map(str, part.values)} for m, part in modules.items()}


def main() -> None:
    """Run the command line; a refusal is printed as text, with its own exit code."""
    try:
        app(prog_name="boresight")
    except BoresightError as error:
        typer.echo(f"boresight: {error}", err=True)
        sys.exit(_exit_code(error))
    finally:
        gc.freeze()  # at its end Python would look for garbage in all that is imported, for .4 s


def _exit_code(error: BoresightError) -> int:
    from pipeline.machine.runner import FailedError

    codes: tuple[tuple[type[BoresightError], int], ...] = (
        (FailedError, _EXIT_FAILED),
        (UnusableError, _EXIT_UNUSABLE),
        (Cancelled, _EXIT_CANCELLED),
    )
    return next((code for kind, code in codes if isinstance(error, kind)), _EXIT_REFUSED)


def _attach(command: _Attached) -> None:
    """Put a command into the list; `_Commands` imports what is behind it when it is called."""

    def listed() -> None: ...

    app.command(command.name, help=command.summary, rich_help_panel=command.group)(listed)


def _warn(console: Console, title: str, warnings: Sequence[str]) -> None:
    """Print warnings so that nobody overlooks them; nothing where there are none."""
    from rich.markup import escape

    if not warnings:
        return
    console.print(f"\n[bold black on yellow] {title} [/]", highlight=False)
    for warning in warnings:
        console.print(f"  [bold yellow]warning[/]: {escape(warning)}", highlight=False)


def _print_outcome(outcome: RunOutcome, folder: Path) -> None:
    from pipeline.pages.notation import figure_name

    for number in outcome.metrics:
        typer.echo(f"{number.name:<48} {number.value} {number.unit}".rstrip())
    for stage in outcome.stages:
        for number in stage.numbers:
            if "rejected" in number.name and number.value:
                typer.echo(f"{figure_name(number.name):<48} {number.value} {number.unit}".rstrip())
    report = folder / "report.html"
    typer.echo(f"Report: {report.resolve()}" if report.is_file() else f"Run folder: {folder.resolve()}")
    if report.is_file():
        typer.echo(f"To decide on the findings and sign: boresight review {shlex.quote(str(folder))}")


for _command in _ATTACHED:
    _attach(_command)

if __name__ == "__main__":
    main()
