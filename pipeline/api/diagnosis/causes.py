"""The class of a diagnosis as the page shows it: likely causes with their courses, the others summed up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from stages.diagnose.causes import Cause, CourseShare
from stages.diagnose.inference import SURE
from stages.diagnose.result import Diagnosis

# What is less likely than the accepted probability of a wrong name is summed up.
_SHOWN = 1 - SURE
_OUTSIDE = "A cause that the library does not have, or measurements that do not agree with each other"
_OTHERS = "Any other effect of the library, alone or beside one of these"


@dataclass(frozen=True)
class CauseShown:
    """A possible cause: its name with its probability, and what it would be, once for each likely course."""

    name: str
    courses: tuple[str, ...] = ()


@dataclass(frozen=True)
class ClassShown:
    """The possible causes, the likeliest first, and sentences on those that have no line of their own.

    The first is ``likely`` if it is likelier than all others together.
    """

    causes: tuple[CauseShown, ...]
    rest: tuple[str, ...] = ()
    likely: bool = False

    @property
    def weighed(self) -> bool:
        """Whether the causes have probabilities and say what they would be."""
        return any(c.courses for c in self.causes)


def class_shown(found: Diagnosis) -> ClassShown:
    """Return the class, or the class that remains beside what is certain, for the page.

    Names of which rings and fiducials of a gauge run say nothing stand with the likeliest that looks like
    them, or else without a probability. Unlikely names are summed up, unless all are unlikely. If those of a
    remaining class are, they come from other measurements, as the encoder's: the gauge run does not weigh
    them.
    """
    left = found.remainder
    members = found.members if left is None else left.members
    each = {name: found.causes.of(name) for name in members}
    if left is not None and all(cause is None or cause.probability < _SHOWN for cause in each.values()):
        return ClassShown(tuple(CauseShown(_in_words(name)) for name in members))
    asked = sorted((c for c in each.values() if c is not None), key=lambda c: -c.probability)
    unasked = [name for name, cause in each.items() if cause is None]
    mate = {name: found.causes.like(name, members) for name in unasked}
    unweighed = tuple(CauseShown(_in_words(name)) for name in unasked if mate[name] is None)
    shown = [c for c in asked if c.probability >= _SHOWN] or asked * (not unweighed)
    certain = {e.name for e in found.effects} if left is not None else set()
    hidden = [c for c in found.causes.laws if c not in shown and c.name not in certain]
    sentences = _rest(found.causes.outside, hidden, members) if asked else ()
    lines = (_line(c, [name for name in unasked if mate[name] == c]) for c in shown)
    return ClassShown((*lines, *unweighed), sentences, any(c.probability > 0.5 for c in shown))


def _rest(outside: float, hidden: Sequence[Cause], members: Sequence[str]) -> tuple[str, ...]:
    """Return sentences on what has no line of its own: not where it is negligible and outside the class."""
    others = min(sum(c.probability for c in hidden), 1.0)
    remaining = ((_OUTSIDE, outside, False), (_OTHERS, others, any(c.name in members for c in hidden)))
    return tuple(f"{words}: {_percent(p)}." for words, p, always in remaining if always or p >= _SHOWN / 10)


def _line(cause: Cause, alike: Sequence[str]) -> CauseShown:
    """Return a cause with its courses, and with what looks like it and could not be weighed."""
    or_alike = f" (or {' or '.join(map(_in_words, alike))}, which looks like it)" if alike else ""
    name = f"{_in_words(cause.name)}{or_alike}, {_percent(cause.probability)}"
    likely = [c for c in cause.courses if c.probability >= _SHOWN]
    if len(likely) < 2:
        return CauseShown(name, tuple(c.statement for c in likely))
    return CauseShown(f"{name}; which of these forms it has is not certain", tuple(map(_course, likely)))


def _course(course: CourseShare) -> str:
    return f"{_percent(course.probability)} of that: {course.statement}"


def _in_words(name: str) -> str:
    return name.replace("_", " ")


def _percent(probability: float) -> str:
    """Return a probability in per cent, never rounded to none or to certainty."""
    if probability < _SHOWN:
        return "less than 1 %"
    # From 0.995 on a probability rounds to 100 %.
    return f"{100 * probability:.0f} %" if probability < 0.995 else "more than 99 %"
