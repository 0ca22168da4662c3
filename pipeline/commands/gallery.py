"""``boresight gallery``: every known effect rendered, measured and put beside its law, on one page."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import track

from pipeline.commands.gallery_report import write_gallery
from pipeline.files.disk import disk_errors_named
from pipeline.physics.catalogue import EFFECTS
from pipeline.simulator.effects.switch import parse_switches, typical_switch
from pipeline.simulator.gallery.exhibit import exhibit
from pipeline.simulator.laws.table import all_checks


def gallery(
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE", help="page to write, .html")],
    effects: Annotated[
        list[str] | None,
        typer.Option(
            "--with",
            metavar="NAME=VALUES",
            help="show only these, at these sizes: as for simulate; repeatable",
        ),
    ] = None,
) -> None:
    """Show what each known effect does: its picture, its residual on the ring, its law, its size, its likes.

    All of the page is computed when it is made, which takes a few minutes for all effects. An effect takes
    its catalogue's quantities, as in laser_tilt=0.6@40, or its typical size.
    """
    console = Console(stderr=True)
    switches = parse_switches(effects or ()) or tuple(typical_switch(name) for name in EFFECTS)
    with disk_errors_named(output):
        output.parent.mkdir(parents=True, exist_ok=True)
        exhibits = [exhibit(s) for s in track(switches, "rendering", console=console, transient=True)]
        with console.status("checking the laws"):
            checks = list(all_checks())
        write_gallery(exhibits, checks, output)
    typer.echo(f"Gallery of {len(exhibits)} effects: {output.resolve()}")
