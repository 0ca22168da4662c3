"""What every part of the page hands over: methods side by side, figures, charts, and how it was set up."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Quantity:
    """A column: ``key`` in the figures, what it is called, and its unit."""

    key: str
    name: str
    unit: str = ""

    @property
    def head(self) -> str:
        return f"{self.name}, {self.unit}" if self.unit else self.name


@dataclass(frozen=True)
class Method:
    """A row: figures by quantity, None where there is none, and what must be said of it."""

    name: str
    figures: dict[str, float | None]
    note: str = ""


@dataclass(frozen=True)
class Section:
    """A comparison; the first method is boresight's own, to which ratios refer.

    Attributes
    ----------
    setup : tuple of str
        Paragraphs: what was given to whom, so that the reader can judge whether it is fair.
    charts : tuple of str
        SVG.
    """

    key: str
    title: str
    setup: tuple[str, ...]
    quantities: tuple[Quantity, ...]
    methods: tuple[Method, ...]
    charts: tuple[str, ...] = ()

    def ratios(self) -> dict[str, dict[str, float]]:
        """Return each other method's figures over boresight's, where both are there and not zero."""
        own = self.methods[0].figures
        return {
            m.name: {k: v / own[k] for k, v in m.figures.items() if v is not None and own.get(k)}
            for m in self.methods[1:]
        }


@dataclass
class Spent:
    """Time by the clock and processor time of this process and its children, s."""

    wall_s: float = field(default=0.0)
    cpu_s: float = field(default=0.0)

    @property
    def figures(self) -> dict[str, float | None]:
        return {"wall_s": self.wall_s, "cpu_s": self.cpu_s}


TIMES = (Quantity("wall_s", "time", "s"), Quantity("cpu_s", "processor time", "s"))


@contextmanager
def clocked() -> Iterator[Spent]:
    """Fill in the time spent inside when left."""
    spent, wall, cpu = Spent(), time.perf_counter(), _processor_s()
    try:
        yield spent
    finally:
        spent.wall_s, spent.cpu_s = time.perf_counter() - wall, _processor_s() - cpu


def _processor_s() -> float:
    return sum(os.times()[:4])
