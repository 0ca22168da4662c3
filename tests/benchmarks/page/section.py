"""The results of every part of the page: methods side by side, figures, charts, and how it was set up."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Literal


@dataclass(frozen=True)
class Quantity:
    """A column: its ``key`` in the figures, its name and unit, and whether more or less of it is better."""

    key: str
    name: str
    unit: str = ""
    better: Literal["less", "more"] | None = "less"

    @property
    def head(self) -> str:
        return f"{self.name}, {self.unit}" if self.unit else self.name


@dataclass(frozen=True)
class Method:
    """A row: figures by quantity, None where there is none, and remarks about it."""

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
    why_behind : dict
        Why boresight is behind in a quantity, by its key; as far as known.
    """

    key: str
    title: str
    setup: tuple[str, ...]
    quantities: tuple[Quantity, ...]
    methods: tuple[Method, ...]
    charts: tuple[str, ...] = ()
    why_behind: dict[str, str] = field(default_factory=dict)

    def ratios(self) -> dict[str, dict[str, float]]:
        """Return each other method's figures over boresight's, where both exist and are not zero."""
        own = self.methods[0].figures
        return {
            m.name: {k: v / own[k] for k, v in m.figures.items() if v is not None and own.get(k)}
            for m in self.methods[1:]
        }

    def behind(self) -> tuple[str, ...]:
        """Return a sentence for each quantity in which a method is better than boresight."""
        return tuple(
            f"{q.name}: better by {', '.join(ahead)}. {self.why_behind.get(q.key, 'The cause is not known.')}"
            for q in self.quantities
            if (ahead := [m.name for m in self.methods[1:] if self._is_ahead(m, q)])
        )

    def _is_ahead(self, method: Method, quantity: Quantity) -> bool:
        own, other = (m.figures.get(quantity.key) for m in (self.methods[0], method))
        if own is None or other is None or quantity.better is None:
            return False
        return other < own if quantity.better == "less" else other > own


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
    """Record the times spent inside on leaving."""
    spent, wall, cpu = Spent(), time.perf_counter(), _processor_s()
    try:
        yield spent
    finally:
        spent.wall_s, spent.cpu_s = time.perf_counter() - wall, _processor_s() - cpu


def _processor_s() -> float:
    return sum(os.times()[:4])
