"""What the report page shows, as its template takes it: texts, tables and pictures ready to be placed."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.export.report.plots import Plot, Tick

_MOST_NUMBERED = 40


@dataclass(frozen=True)
class Card:
    """One of the first screen's answers: a question's name, the number, and what stands behind it."""

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
    way: str
    wall_loss: str
    confidence: str
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
    flats: tuple[Flat, ...]
    plots: tuple[Plot, ...]
    tables: tuple[Table, ...]
    warnings: tuple[str, ...]
