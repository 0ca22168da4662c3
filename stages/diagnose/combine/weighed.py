"""How likely each effect is the cause of what was found, and with which course."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from math import prod

from stages.diagnose.causes import NONE, Cause, Causes, CourseShare
from stages.diagnose.combine.claims import Claim
from stages.diagnose.effects.base import Shape
from stages.diagnose.effects.nameless import Nameless
from stages.diagnose.gauge.doubts import doubts
from stages.diagnose.gauge.examine import OF_A_PIPE, Examined
from stages.diagnose.gauge.judge import Verdicts
from stages.diagnose.gauge.run import Term
from stages.diagnose.gauge.sets import LawAndOrder, cause_of

# In place of a law's name: a cause that the library does not have, or measurements that do not agree.
_OUTSIDE = ""
# Sets of a smaller share are left out: nothing that is shown depends on them.
_LEAST = 1e-12


def weighed(examined: Examined | None, claims: Sequence[Claim]) -> Causes:
    """Return what rings and fiducials of a gauge run and other channels' uncertain claims leave open."""
    of_rings = _of_rings(examined) if examined is not None else NONE
    return of_rings.joined(chain.from_iterable(_claimed(c) for c in claims if not c.sure))


def _claimed(claim: Claim) -> Iterator[Cause]:
    """Yield what a claim names, and its rivals, which are as likely."""
    found = claim.found
    yield from (Cause(name, found.probability) for name in claim.rivals)
    yield Cause(found.name, found.probability, (CourseShare("", 1.0, found.statement),))


def _of_rings(examined: Examined) -> Causes:
    """Return all laws that rings and fiducials were asked about, with the probability that each is a cause.

    A gauge is straight and round.
    """
    best, verdicts = examined.best, examined.verdicts
    if best is None or verdicts is None:
        return NONE
    each = zip(best.library_terms, doubts(examined), strict=False)
    doubt = {cause_of(t.model, t.shape): one for t, one in each}
    table = _table(verdicts, doubt)
    # The answer tells the mean time of a step, not that of the best fit.
    steps = zip(best.library_terms, examined.sizes, strict=False)
    mean_s = {id(t): (sized.time_s.value,) for t, sized in steps if sized.time_s is not None}
    chance, courses = defaultdict[str, float](float), _courses(table, mean_s)
    for one in table:
        for name, share in one.names.items():
            chance[name] += one.probability * share
    every = dict.fromkeys((*chance, *(f.name for f in examined.feasibility), *sorted(OF_A_PIPE)))
    laws = (Cause(law, chance[law], courses.get(law, ())) for law in every if law != _OUTSIDE)
    return Causes(tuple(sorted(laws, key=lambda c: -c.probability)), chance[_OUTSIDE])


@dataclass(frozen=True)
class _Weighed:
    """A set of effects with its probability, including what may be in their places.

    Attributes
    ----------
    probability : float
        Those of all sets add up to 1.
    names : dict of str to float
        Each law that may be among its causes, and `_OUTSIDE`, with the probability in this set.
    """

    probability: float
    terms: tuple[Term, ...]
    names: dict[str, float]


def _table(verdicts: Verdicts, doubt: Mapping[LawAndOrder, float]) -> list[_Weighed]:
    """Return all sets, each likelier by the odds of what may be in its effects' places."""
    sets = []
    for p, every in verdicts.sets:
        terms = tuple(t for t in every if not isinstance(t.model, Nameless))
        each = {cause: doubt.get(cause, 0.0) for cause in (cause_of(t.model, t.shape) for t in terms)}
        weight = p * prod(1 + odds for odds in each.values())
        sets.append(_Weighed(weight, terms, _names(each, patterned=len(terms) < len(every))))
    total = sum(s.probability for s in sets)
    return [replace(s, probability=s.probability / total) for s in sets if s.probability > _LEAST * total]


def _names(each: Mapping[LawAndOrder, float], patterned: bool) -> dict[str, float]:
    """Return the names that may be in a set's places, which are independent, with their probabilities."""
    missing = {_OUTSIDE: 0.0 if patterned else 1.0}
    for (law, _), odds in each.items():
        for name, share in ((law, 1.0), (_OUTSIDE, odds)):
            missing[name] = missing.get(name, 1.0) * (1 - share / (1 + odds))
    return {name: 1 - p for name, p in missing.items()}


def _courses(table: Sequence[_Weighed], told: Mapping[int, Shape]) -> dict[str, tuple[CourseShare, ...]]:
    """Return each law's courses, or sets of courses and orders, the likeliest first.

    The words are those of the likeliest set with them; ``told`` has shapes to tell instead, by id of term.
    """
    found = dict[str, dict[object, list[tuple[float, CourseShare]]]]()
    for one in table:
        for law in {t.model.law for t in one.terms}:
            same = [t for t in one.terms if t.model.law == law]
            kinds = " and ".join(sorted({str(t.model.kind) for t in same}))
            words = " ".join(t.model.statement(told.get(id(t), t.shape), t.amplitude) for t in same)
            of = frozenset((t.model.kind, cause_of(t.model, t.shape)) for t in same)
            share = one.probability * one.names[law]
            found.setdefault(law, {}).setdefault(of, []).append((share, CourseShare(kinds, 1.0, words)))
    return {law: _shares(list(of_law.values())) for law, of_law in found.items()}


def _shares(of_law: Sequence[Sequence[tuple[float, CourseShare]]]) -> tuple[CourseShare, ...]:
    total = sum(p for each in of_law for p, _ in each)
    shares = (
        replace(max(each, key=lambda one: one[0])[1], probability=sum(p for p, _ in each) / total)
        for each in of_law
    )
    return tuple(sorted(shares, key=lambda c: -c.probability))
