"""``boresight gallery``: renders and measures every known effect, and shows it with its law on one page."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import cv2
import numpy as np
import typer
from rich.console import Console
from rich.progress import track

from pipeline.arrays import Byte, Float
from pipeline.files.disk import disk_errors_named
from pipeline.pages import page_template
from pipeline.physics.catalogue import EFFECTS
from pipeline.physics.effect import Channel
from pipeline.simulator.effects.switch import parse_switches, typical_switch
from pipeline.simulator.gallery import STATES, WINDOW_PX, Exhibit, Likeness, exhibit, likenesses, unrolled
from pipeline.simulator.gallery.scenes import Course, surroundings
from pipeline.simulator.laws import BASELINE_MM, FOCAL_PX, LINE_SIGMA_MM, Check
from pipeline.simulator.laws.closed_form import lever_of
from pipeline.simulator.laws.table import all_checks, verdict

_INCH_MM = 25.4
# Typical 1 σ of a line's position in one frame, px, named for comparison.
_NOISE_PX = 0.1
# Cosine from which two patterns are listed as similar: 26° between them.
_LIKE = 0.9
# Size of a plot's field; the page adds the margins.
WIDTH, HEIGHT = 360.0, 130.0
# Side of the small picture, px.
_PICTURE_PX = 300
# Unrolled line: px on each side, step, columns around, and repetitions of a column.
_STRIP_PX, _STRIP_STEP_PX, _STRIP_COLUMNS, _STRIP_SCALE = 10.0, 0.25, 360, 2
# Gamma of the eye, so that a faint ghost or tail is visible beside the line.
_DISPLAY_GAMMA = 0.45
# Smallest difference of light that is shown in full colour: below it there is rounding only.
_LEAST_FULL_SCALE = 1e-4
# About so many marks on an axis.
_TICKS = 4


@dataclass(frozen=True)
class Plot:
    """Curves over one quantity, ready to draw: ``paths`` are SVG path data in a field WIDTH × HEIGHT."""

    title: str
    unit: str
    paths: tuple[str, ...]
    names: tuple[str, ...]
    x_ticks: tuple[tuple[float, str], ...]
    y_ticks: tuple[tuple[float, str], ...]
    x_title: str


def picture_png(exhibit: Exhibit) -> bytes:
    """Return the camera's picture with the effect, reduced in size."""
    shape = (_PICTURE_PX, _PICTURE_PX)
    small = cv2.resize(exhibit.changed, shape, interpolation=cv2.INTER_AREA)
    return _png(_displayed(np.asarray(small, float), 0.5))


def line_png(exhibit: Exhibit) -> bytes:
    """Return the line unrolled, azimuth across and image radius up, with the effect."""
    return _png(_strip(_displayed(_around(exhibit, changed=True), 1.0)))


def difference_png(exhibit: Exhibit) -> tuple[bytes, float]:
    """Return the change by the effect, red more and blue less light, and the change at full colour."""
    change = _around(exhibit, changed=True) - _around(exhibit, changed=False)
    full = max(float(np.quantile(np.abs(change), 0.999)), _LEAST_FULL_SCALE)
    share = np.clip(change / full, -1, 1)
    bgr = np.stack([1 - np.clip(share, 0, 1), 1 - np.abs(share), 1 + np.clip(share, -1, 0)], -1)
    return _png(_strip(np.asarray(255 * bgr, np.uint8))), full


def ring_plots(exhibit: Exhibit) -> list[Plot]:
    """Return the radius error around the ring, and light, width and skewness where the profile is changed."""
    azimuth = np.degrees(exhibit.azimuth_rad)
    residuals = exhibit.residual.values()
    names = tuple(map(_inch, exhibit.residual))
    shown = [("residual on the ring", "µm", [1000 * r.error_mm for r in residuals], 0.5)]
    if exhibit.switch.effect.channel is Channel.PROFILE or not exhibit.shows_on_ring:
        shown += [
            ("light of the line", "%", [100 * r.light for r in residuals], 0.1),
            ("width of the line", "px", [r.width_px for r in residuals], 0.005),
            ("skewness of the line", "", [r.skewness for r in residuals], 0.01),
        ]
    return [
        _plot(title, unit, azimuth, curves, names, "azimuth, °", [-180, -90, 0, 90, 180], least)
        for title, unit, curves, least in shown
    ]


def course_plot(course: Course) -> Plot:
    """Return the course of an effect in time."""
    ticks = _nice(float(course.time_s[0]), float(course.time_s[-1]))
    return _plot(course.of, "mm", course.time_s, [course.value_mm], ("4 inch",), "time, s", ticks, 0.01)


def _plot(
    title: str, unit: str, x: Float, curves: Sequence[Float], names: tuple[str, ...], x_title: str,
    x_ticks: Sequence[float], least: float,
) -> Plot:  # fmt: skip
    """Return curves in a field that holds them and 0, and spans at least ``least``."""
    low, high = min(0.0, *(float(c.min()) for c in curves)), max(0.0, *(float(c.max()) for c in curves))
    room = max(0.08 * (high - low), least / 2)
    y_ticks = _nice(low - room, high + room)
    low, high = y_ticks[0], y_ticks[-1]

    def across(value: Float | float) -> Float:
        return np.asarray(WIDTH * (np.asarray(value) - x_ticks[0]) / (x_ticks[-1] - x_ticks[0]))

    def up(value: Float | float) -> Float:
        return np.asarray(HEIGHT * (high - np.asarray(value)) / (high - low))

    paths = tuple(_path(across(x), up(c)) for c in curves)
    return Plot(
        title, unit, paths, names,
        tuple((float(across(t)), f"{t:g}") for t in x_ticks),
        tuple((float(up(t)), f"{t:g}") for t in y_ticks), x_title,
    )  # fmt: skip


def _path(x: Float, y: Float) -> str:
    return "M" + "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(x, y, strict=True))


def _nice(low: float, high: float) -> list[float]:
    """Return round numbers from at or below ``low`` to at or above ``high``."""
    rough = (high - low) / _TICKS
    power = 10.0 ** math.floor(math.log10(rough))
    step = power * next(m for m in (1.0, 2.0, 2.5, 5.0, 10.0) if m * power >= rough)
    first, last = math.floor(low / step + 1e-9), math.ceil(high / step - 1e-9)
    return [k * step for k in range(first, last + 1)]


def _around(exhibit: Exhibit, *, changed: bool) -> Float:
    """Return the picture along radii (rows, outward up) and azimuths (columns)."""
    azimuth = -np.pi + 2 * np.pi * np.arange(_STRIP_COLUMNS) / _STRIP_COLUMNS
    picture = exhibit.changed if changed else exhibit.plain
    return np.asarray(unrolled(picture, exhibit.scene, azimuth, _STRIP_PX, _STRIP_STEP_PX)[1].T[::-1])


def _displayed(light: Float, white: float) -> Byte:
    return np.asarray(255 * np.clip(light / white, 0, 1) ** _DISPLAY_GAMMA, np.uint8)


def _strip(picture: Byte) -> Byte:
    return np.asarray(np.repeat(picture, _STRIP_SCALE, axis=1))


def _png(picture: Byte) -> bytes:
    return bytes(cv2.imencode(".png", picture, [cv2.IMWRITE_PNG_COMPRESSION, 9])[1].tobytes())


@dataclass(frozen=True)
class Bore:
    """Size of an effect in one bore."""

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
    """Return the page's content on an effect."""
    difference, full_scale = difference_png(exhibit)
    course: Plot | None = None if exhibit.course is None else course_plot(exhibit.course)
    return {
        "name": exhibit.name,
        "effect": exhibit.switch.effect,
        "switch": exhibit.switch.text,
        "quantities": list(zip(exhibit.switch.effect.quantities, exhibit.switch.values, strict=True)),
        "surroundings": surroundings(exhibit.name),
        "picture": picture_png(exhibit),
        "line": line_png(exhibit),
        "difference": difference,
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
