"""``boresight simulate``: render recordings from a scene file, or from scenes drawn from a prior."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from pipeline.errors import InputError
from pipeline.simulator.effects.switch import parse_switches
from pipeline.simulator.premises import Premise
from pipeline.simulator.prior import draw_pair, read_prior
from pipeline.simulator.produce import Order, Places, beside, produce
from pipeline.simulator.scene import Scene, read_scene

_PRIOR = Path(__file__).resolve().parents[2] / "configs" / "priors" / "pairs.yaml"


def simulate(
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="RECORDING", help="folder to write; of all, with --draw")
    ],
    scene: Annotated[Path | None, typer.Argument(help="scene file, such as configs/scenes/*.yaml")] = None,
    effects: Annotated[
        list[str] | None,
        typer.Option(
            "--with", metavar="NAME=VALUES", help="an effect, such as laser_tilt=0.6@40; repeatable"
        ),
    ] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="in place of the scene's; of the draw")] = None,
    truth: Annotated[
        Path | None, typer.Option(metavar="DIR", help="folder of the truth; else beside the recording")
    ] = None,
    frames: Annotated[int | None, typer.Option(min=1, help="render only so many, from the first")] = None,
    draw: Annotated[int, typer.Option(min=0, help="draw so many pairs of gauge run and inspection")] = 0,
    first: Annotated[int, typer.Option(min=0, help="pairs of the draw that are left out before these")] = 0,
    prior: Annotated[
        Path | None, typer.Option(metavar="FILE", help="what to draw from; else configs/priors/pairs.yaml")
    ] = None,
    seal: Annotated[
        bool, typer.Option("--seal", help="give the recording hashes of its truth, for open-seal")
    ] = False,
) -> None:
    """Render a recording with its truth apart, from a scene or from scenes drawn from a prior.

    An effect takes its catalogue's quantities: a size, @ a direction in deg, x an order, / others with their
    unit, as in baseline_drift=0.05/40s. A scene that cannot show what it is meant to show is refused.
    """
    console = Console(stderr=True)
    if draw:
        orders = _drawn(range(first, first + draw), prior or _PRIOR, seed or 0, output, truth, seal, frames)
        if scene or effects:
            raise InputError("--draw", "draws scene and effects itself", hint="leave out SCENE and --with")
    else:
        places = Places(output, truth or beside(output), seal)
        orders = iter([[_single(scene, effects or (), seed, frames, places)]])
    for together in orders:
        _render(together, console)


def _single(
    file: Path | None, effects: Sequence[str], seed: int | None, frames: int | None, places: Places
) -> Order:
    if file is None:
        raise InputError("simulate", "is given no scene", hint="name a scene file, or use --draw N")
    scene = read_scene(file)
    switched = {s.name: s.quantities for s in parse_switches(effects)}
    changes: dict[str, object] = {"effects": {**scene.effects, **switched}}
    if seed is not None:
        changes["seed"] = seed
    return Order(_shortened(scene.model_copy(update=changes), frames), file, places)


def _drawn(
    which: range,
    prior_file: Path,
    seed: int,
    folder: Path,
    truth: Path | None,
    sealed: bool,
    frames: int | None,
) -> Iterator[list[Order]]:
    """Yield the gauge run and the inspection of every pair."""
    prior = read_prior(prior_file)
    truths = truth or beside(folder)
    for index in which:
        pair = draw_pair(prior, prior_file, seed, index)
        yield [
            Order(
                _shortened(scene, frames),
                pair.folder / "scene.yaml",
                Places(folder / scene.name, truths / scene.name, sealed),
            )
            for scene in (pair.gauge, pair.field)
        ]


def _shortened(scene: Scene, frames: int | None) -> Scene:
    return scene if frames is None else scene.model_copy(update={"frames": min(frames, scene.frames)})


def _render(together: Sequence[Order], console: Console) -> None:
    columns = (
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(),
    )  # fmt: skip
    with Progress(*columns, console=console, transient=True) as bar:
        tasks = {o.scene.name: bar.add_task(o.scene.name, total=o.scene.frames) for o in together}
        found = produce(together, lambda order, done: bar.update(tasks[order.scene.name], completed=done))
    for order, premises in zip(together, found, strict=True):
        _show(premises, order.scene, order.places)


def _show(premises: Sequence[Premise], scene: Scene, places: Places) -> None:
    """Tell what was checked, but of a sealed recording nothing that would betray what is in it."""
    if not places.sealed:
        for premise in premises:
            typer.echo(f"{premise.name:<40} {premise.text}")
    sealed = ", sealed" if places.sealed else ""
    typer.echo(f"Recording: {places.recording.resolve()} ({scene.frames} frames)")
    typer.echo(f"Truth{sealed}: {places.truth.resolve()}")
