"""Unknown laws and courses as alternatives to one name or to several.

A name states how an effect grows from the middle of the picture outward. An unknown law may pass for it as
long as the measurements leave that growth open. Therefore each name competes with its own law times a free
polynomial of the radius: a Gaussian process about the law. Its marginal likelihood is penalised for this
freedom only where measurements could have shown the difference (D. MacKay, "Bayesian interpolation", 1992).
Without this, a focal length that was not in the library was named a shifted dome, and a shifted dome a focal
length.

A name also states the effect's course in time. Therefore each also competes with its law times a free course,
a Brownian motion about the named one: an optical axis that drifted as no course in the library does was named
one that moves evenly, together with a laser that rocks once during the whole run.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from pipeline.physics.catalogue import effect
from pipeline.physics.effect import CourseKind, FixedTo
from stages.diagnose.effects.base import EffectModel
from stages.diagnose.effects.courses import SEARCHED, Coursed, Drifting, InCourse
from stages.diagnose.gauge.altered_laws import other_course, other_growth
from stages.diagnose.gauge.fit import evidence
from stages.diagnose.gauge.hypotheses import Judged
from stages.diagnose.gauge.run import GaugeRun, Term, behaviour, pattern_of
from stages.diagnose.gauge.scan import span
from stages.diagnose.gauge.sets import prior_deviance, prior_sigma
from stages.diagnose.inference import INSTRUMENT, UNKNOWN, Evidence, Stated, estimate, places_of

# 1 σ, in equal parts, of the difference between an unknown law and the named one, relative to the latter, in
# each power of the radius; as large as the library's own laws differ. Over the rings of a gauge with bores of
# 25 and 38 mm, 122 pairs that differ only in their growth differ by .31, 1.4 and 3.8 in the first power (10
# %, 50 % and 90 % quantile) and by .29, 2.1 and 9.8 in the second: below these are 14, 54 and 87 %, and 13,
# 69 and 99 %, of what these make. Over stepped gauges of 102 to 35 mm they differ by .56 to .68, 1.7 to 2.4
# and 4.1 to 5.5 in the first power.
GROWTH = (1.0, 2.0, 4.0)
# The same of courses: those of the library (constant, with distance, its sign, all searched
# in time) differ from each other's best size by .32, .70 and 2.6 of it (the same quantiles); below these are
# 11, 43 and 86 % of what these make.
_COURSE = (0.5, 1.0, 3.0)
# Periods of a swing that a run must hold before its return is seen more than once. A sheet that hung to one
# side of the pipe while the probe rolled by 300° passed for one that rocks once during the run, at .994.
_LEAST_PERIODS = 2.0
# More effects of one harmonic than this can together imitate almost any law: a shifted optical axis that was
# not in the library was named a tilted sheet beside two others (`bench_diagnosis --mode leftout`, case 3002).
_AS_ANY = 2


def excess_exponent(
    run: GaugeRun, best: Judged, term: Term, stated: Stated, believed: float
) -> tuple[float, float]:
    """Return by how much d ln |δr| / d ln r exceeds the law's own in the middle of the rings, with 1 σ."""
    other = other_growth(term, best.fit.linearised, of_line=True)
    about = evidence(run, best.fit, [(other, ())], with_spread=False)[0].deflated(believed)
    both = (*best.fit.terms, Term(other, (), np.zeros(len(other.amplitudes))))
    found = estimate(about, stated, prior_sigma(about, both))
    at = places_of(about, other, ())[0]
    return float(found.value[at]), float(np.sqrt(found.covariance[at, at]))


@dataclass(frozen=True)
class Unknown:
    """Odds relative to a name: of unknown laws with another growth, and of unknown courses."""

    growth: float
    course: float

    @property
    def odds(self) -> float:
        """Odds of either."""
        return self.growth + self.course


def odds_of_unknown_laws(
    run: GaugeRun, best: Judged, stated: Stated, believed: float, library: Mapping[str, EffectModel]
) -> tuple[Unknown, ...]:
    """Return, for each effect of the likeliest hypothesis, the odds of unknown causes relative to its name.

    An unknown law is similar to one of the effects and takes its place, or that of several with its harmonic
    and behaviour in time, including patterns without a cause; or it is the sum of several that have one
    direction. Two effects, of which one has no direction, have no such sum. For each law of the library of a
    kind (a harmonic, of the sheet or of the picture), including the named one, there are `UNKNOWN` others.
    With the odds of a pattern, which stands for any law, left-out focal lengths were named a dome at .993. An
    unknown course may take the place of several effects with one harmonic, whatever their behaviour in
    time. χ² is divided by ``believed``.
    """
    laws = {model.law for model in library.values()}
    at, terms = best.fit.linearised, best.fit.terms
    grown = [other_growth(t, at, _kind(t.model)[1]) for t in best.library_terms]
    moved = [other_course(t, at, span(run)[0]) for t in best.library_terms]
    steady = [steady_term(t) for t in best.library_terms]
    own = {(t.model, t.shape) for t in terms}
    constant = dict.fromkeys((s.model, s.shape) for s in steady if s is not None)
    asked = [*((o, ()) for o in (*grown, *moved)), *(c for c in constant if c not in own)]
    about = evidence(run, best.fit, asked, with_spread=False)[0].deflated(believed)

    def before(kept: Sequence[Term]) -> float:
        return prior_deviance(run, [(t.model, t.shape) for t in kept], len(laws))

    patterns = [pattern_of(t) for t in terms]
    laid_out = [(time, harmonic) for _, time, harmonic in patterns]
    growth = odds_in(about, terms, [o.name for o in grown], laid_out, before, stated, GROWTH)
    around = [t.model.name if p[2] is None else p[2] for t, p in zip(terms, patterns, strict=True)]
    course = odds_in(about, terms, [o.name for o in moved], around, before, stated, _COURSE, False)
    each = zip(growth, course, best.library_terms, steady, strict=True)
    return tuple(
        Unknown(
            g * known_alike(t.model, library),
            c + odds_of_unseen_course(t, span(run)[0]) + odds_of_steady(about, terms, t, s, before, stated),
        )
        for g, c, t, s in each
    )


def steady_term(term: Term) -> Term | None:
    """Return a drift's law as a constant effect of its size; None where nothing drifts."""
    if not isinstance(term.model, InCourse) or term.model.kind is not CourseKind.EXPONENTIAL:
        return None
    return Term(term.model.static, term.model.own, term.at(term.amplitude)[1])


def odds_of_steady(
    about: Evidence, terms: Sequence[Term], drift: Term, steady: Term | None,
    before: Callable[[Sequence[Term]], float], stated: Stated,
) -> float:  # fmt: skip
    """Return the odds, relative to a drift, that its law is ``steady``, even if the library lacks that.

    A shifted optical axis that was not in the library was named one that drifts within .8 s, at .9995.
    """
    if steady is None:
        return 0.0
    kept = [steady if t is drift else t for t in terms]
    gain = _surprise(about, terms, "", 0.0, stated) + before(terms) - before(kept)
    return UNKNOWN * float(np.exp((gain - _surprise(about, kept, "", 0.0, stated)) / 2))


def odds_of_unseen_course(term: Term, duration_s: float) -> float:
    """Return even odds that a swing of which the run holds few periods is slow in another way."""
    frequency = term.model.course(*term.at(term.amplitude)).get("frequency_hz")
    return float(frequency is not None and frequency * duration_s < _LEAST_PERIODS)


def known_alike(model: EffectModel, library: Mapping[str, EffectModel]) -> float:
    """Return the number of laws of the library that are of a model's kind, including its own.

    Each counts by its prior probability relative to the model's, once for all its courses of that behaviour.
    A law without a harmonic is recognised by what it depends on, whatever its growth: with another one, it
    has the same name, and none is of its kind.
    """
    if _kind(model)[0] is None:
        return 0.0
    like_it = sorted((_share(other), other.law) for other in library.values() if _kind(other) == _kind(model))
    return sum({law: share for share, law in like_it}.values()) / _share(model)


def _share(model: EffectModel) -> float:
    """Return the prior probability of a model relative to a law of the library without a course."""
    return 1 / len(SEARCHED) if isinstance(model, Coursed) else 1.0


def _kind(model: EffectModel) -> tuple[int | None, bool, str]:
    """Return the harmonic of a model's law, whether it moves the laser's sheet, and its behaviour in time."""
    known = effect(model.static.law if isinstance(model, Drifting) else model.law)
    return known.harmonic, known.fixed_to is FixedTo.LASER, behaviour(model)


def odds_in(
    about: Evidence, terms: Sequence[Term], others: Sequence[str], pattern: Sequence[object],
    before: Callable[[Sequence[Term]], float], stated: Stated, sizes: Sequence[float] = GROWTH,
    as_one: bool = True,
) -> tuple[float, ...]:  # fmt: skip
    """Return the odds of unknown laws in the place of each of the terms that ``others`` resemble.

    ``about`` is the evidence over all terms and all others, ``pattern`` what terms must share to be one law,
    and ``before`` −2 ln of the prior probability of terms; ``sizes`` are the 1 σ of differences, equally
    likely, and ``as_one`` says whether terms along one direction may be one law as they are.
    """
    alone, odds = _surprise(about, terms, "", 0.0, stated), np.zeros(len(others))
    for group in _groups(pattern):
        grown = [k for k in group if k < len(others)]
        each = []
        for k in grown:
            kept = [t for n, t in enumerate(terms) if n == k or n not in group]
            left = [_surprise(about, kept, others[k], apart, stated) for apart in sizes]
            headed = all(len(terms[n].amplitude) == len("xy") for n in group)
            if as_one and (len(group) > _AS_ANY or (len(group) > 1 and headed)):
                left.append(_surprise(_aligned(about, terms, group, k), terms, "", 0.0, stated))
            gain = alone + before(terms) - before(kept)
            each += [np.exp((gain - one) / 2) for one in left]
        odds[grown] += UNKNOWN * float(np.mean(each)) if each else 0.0
    return tuple(map(float, odds))


def _aligned(about: Evidence, terms: Sequence[Term], group: Sequence[int], first: int) -> Evidence:
    """Return the evidence when all terms of a group act along one's direction, each with its own size.

    One law has one direction, whatever it consists of; several causes have a common one only by chance.
    """
    heading = terms[first].amplitude / np.linalg.norm(terms[first].amplitude)
    along, gone = np.eye(len(about.columns)), list[int]()
    for k in group:
        at = places_of(about, terms[k].model, terms[k].shape)
        if k != first and len(at) == len(heading):
            along[at, at[0]] = heading
            gone += at[1:].tolist()
    along = np.delete(along, gone, axis=1)
    columns = tuple(c for n, c in enumerate(about.columns) if n not in gone)
    spread = along.T @ about.score_covariance @ along
    information, right = along.T @ about.information @ along, along.T @ about.right
    return Evidence(columns, information, right, spread, about.misfit, np.delete(about.degrees, gone))


def _groups(pattern: Sequence[object]) -> Iterator[tuple[int, ...]]:
    """Yield all groups of terms with the same pattern."""
    for one in dict.fromkeys(pattern):
        like = [k for k, p in enumerate(pattern) if p == one]
        for size in range(1, len(like) + 1):
            yield from combinations(like, size)


def _surprise(about: Evidence, terms: Sequence[Term], other: str, apart: float, stated: Stated) -> float:
    """Return the deviance of terms and of a law with another growth, if any."""
    keys = {(t.model.name, t.shape) for t in terms}
    over = about.over([
        c for c in about.columns if c.effect in (INSTRUMENT, other) or (c.effect, c.shape) in keys
    ])  # fmt: skip
    grown = [c.effect == other for c in over.columns]
    own = over.over([c for c in over.columns if c.effect != other])
    before = np.full(len(grown), apart)
    before[~np.array(grown)] = prior_sigma(own, terms)
    return estimate(over, stated, before).deviance
