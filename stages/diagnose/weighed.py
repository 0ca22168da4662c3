"""How likely each effect is the cause of what was found, and with which course."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain

from pipeline.arrays import Float
from stages.diagnose.causes import NONE, Cause, Causes, CourseShare
from stages.diagnose.claims import Claim
from stages.diagnose.effects.base import EffectModel, Shape
from stages.diagnose.effects.nameless import Nameless
from stages.diagnose.gauge.answer import doubted
from stages.diagnose.gauge.examine import OF_A_PIPE, Examined
from stages.diagnose.gauge.judge import Verdicts

_Sized = tuple[EffectModel, Shape, Float]


def weighed(examined: Examined | None, claims: Sequence[Claim]) -> Causes:
    """Return what rings and fiducials of a gauge run and other channels' uncertain claims leave open."""
    of_rings = _of_rings(examined) if examined is not None else NONE
    return of_rings.joined(chain.from_iterable(_claimed(c) for c in claims if not c.sure))


def _claimed(claim: Claim) -> Iterator[Cause]:
    """Yield what a claim names, and its rivals, which are as likely."""
    told = claim.found
    yield from (Cause(name, told.probability) for name in claim.rivals)
    yield Cause(told.name, told.probability, (CourseShare("", 1.0, told.statement),))


def _of_rings(examined: Examined) -> Causes:
    """Return all laws that rings and fiducials were asked about, with the probability that each is a cause.

    What makes a name of the likeliest hypothesis doubtful is taken off its law: see `doubted`. A gauge is
    straight and round.
    """
    best, verdicts = examined.best, examined.verdicts
    if best is None or verdicts is None:
        return NONE
    chance, courses = _weighed(verdicts)
    each = doubted(examined)
    for term, one in zip(best.library_terms, each, strict=False):
        chance |= {term.model.law: one.chance, **one.alike}
    every = dict.fromkeys((*chance, *(f.name for f in examined.feasibility), *OF_A_PIPE))
    laws = (Cause(law, min(chance.get(law, 0.0), 1.0), courses.get(law, ())) for law in every)
    outside = min(max((one.outside for one in each), default=0.0) + _with_patterns(verdicts), 1.0)
    return Causes(tuple(sorted(laws, key=lambda c: -c.probability)), outside)


def _weighed(verdicts: Verdicts) -> tuple[dict[str, float], dict[str, tuple[CourseShare, ...]]]:
    """Return for each law the probability of all sets with it, and its courses, the likeliest first.

    The words for a course are those of the likeliest set with it.
    """
    chance, of_course = dict[str, float](), dict[tuple[str, str], list[tuple[float, str]]]()
    for p, members in _sets(verdicts):
        for law in {model.law for model, *_ in members}:
            chance[law] = chance.get(law, 0.0) + p
        for model, shape, amplitude in members:
            one = (p, model.statement(shape, amplitude))
            of_course.setdefault((model.law, str(model.kind)), []).append(one)
    shares = [
        (law, CourseShare(kind, sum(p for p, _ in each) / chance[law], max(each)[1]))
        for (law, kind), each in of_course.items()
    ]
    shares.sort(key=lambda pair: -pair[1].probability)
    return chance, {law: tuple(c for name, c in shares if name == law) for law in chance}


def _with_patterns(verdicts: Verdicts) -> float:
    """Return the probability of all sets that need a pattern without a cause."""
    each = zip(verdicts.probability, verdicts.judged, strict=True)
    fitted = sum(float(p) for p, j in each if len(j.fit.terms) > len(j.library_terms))
    return fitted + sum(u.probability for u in verdicts.unfitted if any(m.nameless for m in u.members))


def _sets(verdicts: Verdicts) -> Iterator[tuple[float, list[_Sized]]]:
    """Yield the probability of each set, fitted or not, and its effects."""
    for p, j in zip(verdicts.probability, verdicts.judged, strict=True):
        yield float(p), [(t.model, t.shape, t.amplitude) for t in j.library_terms]
    for u in verdicts.unfitted:
        each = zip(u.members, u.amplitudes, strict=True)
        yield u.probability, [(m.model, m.shape, a) for m, a in each if not isinstance(m.model, Nameless)]
