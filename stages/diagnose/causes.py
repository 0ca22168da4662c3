"""The possible causes of a class, each with its probability and the ways in which its size may change."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass, replace

from pipeline.physics.catalogue import CLASSES


@dataclass(frozen=True)
class CourseShare:
    """A form that a cause may have: its course or courses, such as "constant and step", and its orders.

    Attributes
    ----------
    kind : str
        The courses.
    probability : float
        For this cause.
    statement : str
        The cause in words.
    """

    kind: str
    probability: float
    statement: str


@dataclass(frozen=True)
class Cause:
    """A law that may be the cause, with whatever course.

    Attributes
    ----------
    probability : float
        That it is the cause or one of several.
    courses : tuple of CourseShare
        The likeliest first.
    """

    name: str
    probability: float
    courses: tuple[CourseShare, ...] = ()


@dataclass(frozen=True)
class Causes:
    """All laws that rings and fiducials of a gauge run were asked about and leave possible.

    Attributes
    ----------
    laws : tuple of Cause
        The likeliest first; probabilities add up to more than 1 where several act at once.
    outside : float
        Probability that a cause which is none of them has a part in it.
    """

    laws: tuple[Cause, ...] = ()
    outside: float = 0.0

    def of(self, name: str) -> Cause | None:
        """Return what is known of a law; None if it was not asked about or is not possible."""
        return next((c for c in self.laws if c.name == name), None)

    def like(self, name: str, members: Collection[str]) -> Cause | None:
        """Return what is known of a member of a class, or of the likeliest member that looks like it."""
        mates = next((alike for alike in CLASSES if name in alike), (name,))
        looks_like_it = (c for c in self.laws if c.name in mates and c.name in members)
        return self.of(name) or next(looks_like_it, None)

    def without(self, names: Collection[str]) -> Causes:
        """Return these causes without those of which nothing is known any more."""
        return replace(self, laws=tuple(c for c in self.laws if c.name not in names))

    def joined(self, others: Iterable[Cause]) -> Causes:
        """Return these causes and others; of two with the same name the likelier."""
        each = {c.name: c for c in sorted((*self.laws, *others), key=lambda c: c.probability)}
        return replace(self, laws=tuple(sorted(each.values(), key=lambda c: -c.probability)))


NONE = Causes()
