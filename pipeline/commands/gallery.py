"""``boresight gallery``: every known effect rendered, measured and put beside its law, on one page."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import track

from pipeline.commands.gallery_figures import (
    Plot,
    course_plot,
    difference_png,
    line_png,
    picture_png,
    ring_plots,
)
from pipeline.files.disk import disk_errors_named
from pipeline.pages import page_template
from pipeline.physics.catalogue import EFFECTS
from pipeline.simulator.effects.switch import parse_switches, typical_switch
from pipeline.simulator.gallery.exhibit import WINDOW_PX, Exhibit, exhibit
from pipeline.simulator.gallery.likeness import STATES, Likeness, likenesses
from pipeline.simulator.gallery.scenes import surroundings
from pipeline.simulator.laws.bench import BASELINE_MM, FOCAL_PX, LINE_SIGMA_MM, Check
from pipeline.simulator.laws.closed_form import lever_of
from pipeline.simulator.laws.table import all_checks, verdict

_INCH_MM = 25.4
# Typical 1 σ of a line's position in one frame, px, named for comparison.
_NOISE_PX = 0.1
# Cosine from which two patterns are listed as alike: 26° between them.
_LIKE = 0.9


@dataclass(frozen=True)
class Bore:
    """How large an effect is in one bore."""

    inch: str
    rms_um: float
    largest_um: float
    light_percent: float
    width_px: float
    skewness: float


def write_gallery(exhibits: Sequence[Exhibit], checks: Sequence[Check], file: Path) -> None:
    """Write the page.

    Raises
    ------
    OSError
        When it cannot be written.
    """
    file.write_text(gallery_page(exhibits, checks), "utf-8")


def gallery_page(exhibits: Sequence[Exhibit], checks: Sequence[Check]) -> str:
    """Return the page of exhibits, with the checks of their laws."""
    alike = likenesses(exhibits, least=_LIKE)
    return page_template("gallery").render(
        exhibits=[_shown(e, alike[e.name], checks) for e in exhibits],
        bench={"baseline": BASELINE_MM, "focal": FOCAL_PX, "line": LINE_SIGMA_MM, "window": WINDOW_PX},
        noise=[(_inch(r), 1000 * _NOISE_PX * lever_of(r) / FOCAL_PX) for r in exhibits[0].residual],
        noise_px=_NOISE_PX,
        like=_LIKE,
    )


def _shown(exhibit: Exhibit, alike: Sequence[Likeness], checks: Sequence[Check]) -> dict[str, Any]:
    """Return what the page tells of an effect."""
    difference, full_scale = difference_png(exhibit)
    course: Plot | None = None if exhibit.course is None else course_plot(exhibit.course)
    return {
        "name": exhibit.name,
        "effect": exhibit.switch.effect,
        "switch": exhibit.switch.text,
        "quantities": list(zip(exhibit.switch.effect.quantities, exhibit.switch.values, strict=True)),
        "surroundings": surroundings(exhibit.name),
        "picture": _inline(picture_png(exhibit)),
        "line": _inline(line_png(exhibit)),
        "difference": _inline(difference),
        "full_scale": full_scale,
        "plots": ring_plots(exhibit),
        "course": course,
        "bores": bores(exhibit),
        "on_ring": exhibit.shows_on_ring,
        "harmonic": exhibit.harmonic,
        "exponent": exhibit.exponent,
        "alike": alike,
        "most_alike": next((a.name for a in alike if a.name not in STATES), ""),
        "checks": [(c, verdict(c).replace("*", "")) for c in checks if c.name == exhibit.name],
    }


def bores(exhibit: Exhibit) -> list[Bore]:
    """Return the effect's sizes in every bore."""
    found = []
    for radius, residual in exhibit.residual.items():
        light, width, skewness = residual.profile_rms
        rms, largest = 1000 * residual.rms_mm, 1000 * residual.largest_mm
        found.append(Bore(_inch(radius), rms, largest, 100 * light, width, skewness))
    return found


def _inch(radius_mm: float) -> str:
    return f"{2 * radius_mm / _INCH_MM:g} inch"


def _inline(png: bytes) -> str:
    return base64.b64encode(png).decode("ascii")


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
    """Show each known effect: its picture, residual on the ring, law, size, and the effects that look alike.

    The page is computed when the command runs, which takes a few minutes for all effects. An effect takes the
    quantities of the catalogue, as in laser_tilt=0.6@40, or its typical size.
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
