"""``boresight simulate``: render recordings from a scene file, or from scenes drawn from a prior."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TaskID, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bars

from pipeline.api.simulate import Progress, Simulated, simulate_like, simulate_pairs
from pipeline.api.simulate import simulate as simulate_scene
from pipeline.commands import PriorFile
from pipeline.errors import InputError


def simulate(
    output: Annotated[
        Path,
        typer.Option(
            "--output",
            "-o",
            metavar="RECORDING",
            help="folder to write; with --draw the folder of all recordings",
        ),
    ],
    scene: Annotated[
        Path | None, typer.Argument(help="scene file, or the name of a shipped one, such as oval-3-inch")
    ] = None,
    effects: Annotated[
        list[str] | None,
        typer.Option(
            "--with",
            metavar="NAME=VALUES",
            help="an effect, such as laser_tilt=0.6@40, or with --like a diagnosis' folder; repeatable",
        ),
    ] = None,
    seed: Annotated[
        int | None, typer.Option(min=0, help="random seed: replaces the scene's, or is that of --draw")
    ] = None,
    truth: Annotated[
        Path | None, typer.Option(metavar="DIR", help="folder of the truth (default: beside the recording)")
    ] = None,
    frames: Annotated[
        int | None, typer.Option(min=1, help="number of frames to render, from the first")
    ] = None,
    draw: Annotated[int, typer.Option(min=0, help="number of pairs of gauge run and inspection to draw")] = 0,
    first: Annotated[
        int, typer.Option(min=0, help="number of drawn pairs to skip before the first that is rendered")
    ] = 0,
    prior: PriorFile = Path("pairs"),
    like: Annotated[
        Path | None,
        typer.Option(
            metavar="RUN",
            help="run folder: render the pipe, path, probe and lighting of this run, in place of a scene",
        ),
    ] = None,
    speed: Annotated[
        float, typer.Option(min=0.01, max=100, help="with --like: factor on the speed of the probe")
    ] = 1.0,
    probe: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="with --like: probe file to render with, in place of the run's"),
    ] = None,
    defects: Annotated[
        list[str] | None,
        typer.Option(
            "--defect",
            metavar="KIND,DISTANCE,AZIMUTH,LENGTH,WIDTH,DEPTH",
            help="with --like: a defect to put in, in mm and deg, such as pit,120,45,6,5,1.2; repeatable",
        ),
    ] = None,
    seal: Annotated[
        bool, typer.Option("--seal", help="give the recording hashes of its truth, for open-seal")
    ] = False,
) -> None:
    """Render a recording with its truth apart, from a scene or from scenes drawn from a prior.

    An effect takes its catalogue's quantities: a size, @ a direction in deg, x an order, / others with their
    unit, as in baseline_drift=0.05/40s. A scene that cannot show what it is meant to show is refused.
    """
    _refuse_what_does_not_go_together(scene, effects, draw, like, seal)
    with _progress() as progress:
        made: Iterator[Simulated]
        if draw:
            pairs = simulate_pairs(
                prior, output, draw, first=first, truth=truth, seed=seed or 0, frames=frames, seal=seal,
                progress=progress,
            )  # fmt: skip
            made = (recording for pair in pairs for recording in pair)
        elif like is not None:
            made = iter([
                simulate_like(
                    like, output, truth=truth, effects=effects or (), speed=speed, probe=probe,
                    defects=defects or (), seed=seed or 0, frames=frames, progress=progress,
                )
            ])  # fmt: skip
        elif scene is not None:
            one = simulate_scene(
                scene, output, truth=truth, effects=effects or (), seed=seed, frames=frames, seal=seal,
                progress=progress,
            )  # fmt: skip
            made = iter([one])
        else:
            raise InputError(
                "simulate", "is given no scene", hint="name a scene file, --like RUN or --draw N"
            )
        for recording in made:
            _show(recording)


def _refuse_what_does_not_go_together(
    scene: Path | None, effects: list[str] | None, draw: int, like: Path | None, seal: bool
) -> None:
    if draw and (scene or effects):
        raise InputError("--draw", "draws scene and effects itself", hint="leave out SCENE and --with")
    if not draw and like is not None and (scene or seal):
        raise InputError("--like", "takes no SCENE and no --seal", hint="leave them out")


@contextmanager
def _progress() -> Iterator[Progress]:
    """Yield what moves one bar for each scene."""
    columns = (
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(),
    )  # fmt: skip
    with Bars(*columns, console=Console(stderr=True), transient=True) as bars:
        tasks: dict[str, TaskID] = {}

        def move(name: str, done: int, total: int) -> None:
            if name not in tasks:
                tasks[name] = bars.add_task(name, total=total)
            bars.update(tasks[name], completed=done)

        yield move


def _show(made: Simulated) -> None:
    """Print what was checked; of a sealed recording nothing that would reveal its effects."""
    if not made.sealed:
        for premise in made.premises:
            typer.echo(f"{premise.name:<40} {premise.text}")
    sealed = ", sealed" if made.sealed else ""
    typer.echo(f"Recording: {made.recording.resolve()} ({made.frames} frames)")
    typer.echo(f"Truth{sealed}: {made.truth.resolve()}")
