"""Premises: what must hold for a scene to show what it is meant to show, before and after rendering."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pipeline.errors import UnusableError

STAGE = "simulate"


@dataclass(frozen=True)
class Premise:
    """What was checked.

    Attributes
    ----------
    name : str
        As in "markers decoded in a lit frame".
    measured, limit : float
        In ``unit``; the premise holds when ``measured`` is at least, or where ``at_most`` at most, the limit.
    unit : str
    at_most : bool
    frames : tuple of int
        Looked at.
    hint : str
        What to change in the scene when it does not hold.
    """

    name: str
    measured: float
    limit: float
    unit: str = ""
    at_most: bool = False
    frames: tuple[int, ...] = ()
    hint: str = ""

    @property
    def holds(self) -> bool:
        """Whether the scene may be rendered, or the recording be handed on."""
        return self.measured <= self.limit if self.at_most else self.measured >= self.limit

    @property
    def bound(self) -> str:
        """The limit in words."""
        return f"at {'most' if self.at_most else 'least'} {self.limit:g} {self.unit}".rstrip()

    @property
    def text(self) -> str:
        """Measured value and limit, for people."""
        return f"{self.measured:.4g} {self.unit} ({self.bound})"

    @property
    def record(self) -> dict[str, object]:
        """For truth.json."""
        return {
            "name": self.name,
            "measured": float(f"{self.measured:.6g}"),
            "bound": self.bound,
            "holds": self.holds,
            "frames": list(self.frames),
        }


def require(premises: Sequence[Premise]) -> tuple[Premise, ...]:
    """Return the premises when all hold.

    Raises
    ------
    UnusableError
        Naming the first that does not, and all others.
    """
    broken = [p for p in premises if not p.holds]
    if broken:
        first, others = broken[0], ", ".join(p.name for p in broken[1:])
        also = f"; nor do hold: {others}" if others else ""
        raise UnusableError(
            STAGE, f"{first.name}: {first.measured:.4g} {first.unit}".rstrip() + also,
            limit=first.bound, frames=first.frames, hint=first.hint,
        )  # fmt: skip
    return tuple(premises)
