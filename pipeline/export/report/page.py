"""The content of the report page for its template: texts, tables, pictures and line plots."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Float, runs_of

WIDTH, HEIGHT = 900.0, 220.0
_LEFT, _RIGHT, _TOP, _BOTTOM = 64.0, 12.0, 10.0, 34.0


@dataclass(frozen=True)
class Curve:
    """A curve: ``style`` names its look in the page, ``sigma`` gives it a band of ±1 σ."""

    name: str
    style: str
    y: Float
    sigma: Float | None = None


@dataclass(frozen=True)
class Drawn:
    """A curve in the plot's coordinates: polylines, broken where nothing was measured, and bands."""

    name: str
    style: str
    lines: tuple[str, ...]
    bands: tuple[str, ...]


@dataclass(frozen=True)
class Tick:
    """A tick's place in the plot and its text."""

    at: float
    text: str


@dataclass(frozen=True)
class Plot:
    """A plot, ready to be drawn."""

    title: str
    unit: str
    curves: tuple[Drawn, ...]
    x_ticks: tuple[Tick, ...]
    y_ticks: tuple[Tick, ...]
    width: float = WIDTH
    height: float = HEIGHT
    left: float = _LEFT
    bottom: float = HEIGHT - _BOTTOM
    right: float = WIDTH - _RIGHT


def plot(title: str, unit: str, x: Float, curves: Sequence[Curve]) -> Plot | None:
    """Return a plot of curves over ``x`` (N,); None when there is nothing to draw."""
    edges = [c.y + k * (c.sigma if c.sigma is not None else 0) for c in curves for k in (-1, 1)]
    values = np.concatenate(edges)
    if not np.isfinite(values).any() or len(x) < 2:
        return None
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    margin = max(0.06 * (high - low), 1e-3 * max(abs(high), 1e-6))
    low, high = low - margin, high + margin
    place_x = _LEFT + (x - x[0]) / (x[-1] - x[0]) * (WIDTH - _LEFT - _RIGHT)

    def place_y(y: Float) -> Float:
        return np.asarray(_TOP + (high - y) / (high - low) * (HEIGHT - _TOP - _BOTTOM))

    drawn = tuple(_drawn(c, place_x, place_y(c.y), high - low) for c in curves)
    x_values, y_values = round_ticks(float(x[0]), float(x[-1]), 10), round_ticks(low, high, 5)
    at_x = _LEFT + (x_values - x[0]) / (x[-1] - x[0]) * (WIDTH - _LEFT - _RIGHT)
    x_ticks = tuple(Tick(float(a), f"{v:g}") for a, v in zip(at_x, x_values, strict=True))
    y_ticks = tuple(Tick(float(a), f"{v:g}") for a, v in zip(place_y(y_values), y_values, strict=True))
    return Plot(title, unit, drawn, x_ticks, y_ticks)


def _drawn(curve: Curve, x: Float, y: Float, range_y: float) -> Drawn:
    runs = runs_of(np.isfinite(y))
    lines = tuple(_points(x[r], y[r]) for r in runs)
    if curve.sigma is None:
        return Drawn(curve.name, curve.style, lines, ())
    band = np.nan_to_num(curve.sigma) / range_y * (HEIGHT - _TOP - _BOTTOM)
    bands = tuple(
        _points(np.concatenate([x[r], x[r][::-1]]), np.concatenate([(y - band)[r], (y + band)[r][::-1]]))
        for r in runs
    )
    return Drawn(curve.name, curve.style, lines, bands)


def _points(x: Float, y: Float) -> str:
    return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))


def round_ticks(low: float, high: float, about: int) -> Float:
    """Return round values within [low, high], roughly ``about`` of them."""
    raw = (high - low) / about
    power = 10.0 ** np.floor(np.log10(raw))
    # 0.999: a step that is round already is kept in spite of rounding errors.
    step = power * next(f for f in (1, 2, 2.5, 5, 10) if f * power >= raw * 0.999)
    return np.asarray(np.round(np.arange(np.ceil(low / step), np.floor(high / step) + 1) * step, 10) + 0.0)


# Marks on one picture, above which their numbers are left out. Chosen by eye.
_MOST_NUMBERED = 40


@dataclass(frozen=True)
class Card:
    """One answer on the first screen: the name of the question, the number, and its basis."""

    name: str
    value: str
    lines: tuple[str, ...]
    warning: str = ""


@dataclass(frozen=True)
class Mark:
    """A finding's frame on a flat picture, % from the left and the top."""

    number: int
    left: float
    top: float
    width: float
    height: float


@dataclass(frozen=True)
class Strip:
    """A stretch of a flat picture with its marks and the ticks of its distances (at %)."""

    picture: str
    description: str
    aspect: float
    marks: tuple[Mark, ...]
    ticks: tuple[Tick, ...]

    @property
    def crowded(self) -> bool:
        """Whether the marks' numbers would hide the wall."""
        return len(self.marks) > _MOST_NUMBERED


@dataclass(frozen=True)
class Legend:
    """A colour bar: CSS gradient stops, and its ends and middle with unit."""

    stops: str
    low: str
    middle: str
    high: str
    note: str


@dataclass(frozen=True)
class Flat:
    """A flat picture of the whole wall."""

    title: str
    strips: tuple[Strip, ...]
    legend: Legend | None


@dataclass(frozen=True)
class Finding:
    """A row of the table of findings."""

    number: int
    kind: str
    distance: str
    clock: str
    length: str
    width: str
    depth: str
    wall_loss: str
    probability: str
    codes: tuple[str, ...]
    frames: tuple[str, ...]
    statement: str
    photo: str
    deviation: str
    description: str


@dataclass(frozen=True)
class Table:
    """A table with a caption; rows are as long as the header."""

    caption: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""


@dataclass(frozen=True)
class Page:
    """The whole report."""

    title: str
    verdict: str
    cards: tuple[Card, ...]
    findings: tuple[Finding, ...]
    findings_note: str
    unconfirmed: tuple[Finding, ...]
    flats: tuple[Flat, ...]
    plots: tuple[Plot, ...]
    tables: tuple[Table, ...]
    warnings: tuple[str, ...]
