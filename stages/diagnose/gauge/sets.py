"""Compare sets of effects on one linearisation, including sets that were never fitted.

Around a fit, all effects of the library at their best shapes and all patterns without a cause are columns of
one evidence. The marginal likelihood of any set then needs only a few small factorisations, and sets are
visited from the likeliest to their neighbours: one member added, dropped or exchanged. C. Hans, A. Dobra, M.
West, "Shotgun stochastic search for large p regression", J. Am. Stat. Assoc., 2007, here without random
choices.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from pipeline.adjustment.normal_equations import marginalised
from pipeline.arrays import Float, Int
from pipeline.physics.effect import CourseKind
from stages.diagnose.effects.base import EffectModel, Shape
from stages.diagnose.effects.courses import SEARCHED, Coursed
from stages.diagnose.effects.free_profile import FREE_PROFILES, patterns_in_course, patterns_of_kind
from stages.diagnose.effects.nameless import STEADY, Nameless, PatternInCourse
from stages.diagnose.effects.vocabulary import VOCABULARY
from stages.diagnose.gauge.fit import Fit
from stages.diagnose.gauge.run import GaugeRun, Term, pattern_of
from stages.diagnose.gauge.scan import Scored, span
from stages.diagnose.inference import (
    INSTRUMENT,
    PRIOR_PLAUSIBLE,
    Evidence,
    Stated,
    instrument_places,
    places_of,
)

Set = frozenset[int]
# A law and its order, whatever its course: what a name stands for.
LawAndOrder = tuple[str, Shape]
# Likelihoods do not include the small errors of laws and of image formation: nominal odds of 1000 to 1 count
# as 100 to 1. A simulated focal length was once named a cone at 100 to 1. Debt: data/debts.md.
_TEMPERED = 1.5
# Prior: all effects of the library are equally likely, and a pattern without a cause is 50 times less likely,
# because it can imitate any law. Whether a law suffices is tested separately. Debt: data/debts.md.
NAMELESS = 1 / 50
_PEAK = 2
# Relative error of laws: a pattern that differs less from an effect describes it. Debt: data/debts.md.
SAME = 0.02
PATTERNS: tuple[tuple[Nameless, Shape], ...] = (*VOCABULARY, *FREE_PROFILES)
# Only the neighbours of the likeliest sets, and of those with at least this probability relative to the best,
# are visited: ten of them weigh less than the accepted probability of a wrong name.
_LOOKED_AT, _WORTH = 40, 1e-3


@dataclass(frozen=True)
class Member:
    """A possible member of a set: an effect at a shape, and −2 ln of its prior probability among its kind."""

    model: EffectModel
    shape: Shape
    prior_deviance: float

    @property
    def nameless(self) -> bool:
        """Whether it is a pattern without a cause."""
        return isinstance(self.model, Nameless)

    @property
    def of_kind(self) -> tuple[tuple[Nameless, Shape], ...]:
        """Steady patterns that are a constant law like its own with another growth."""
        if self.nameless:
            return ()
        harmonic = pattern_of(Term(self.model, self.shape, np.ones(len(self.model.amplitudes))))[2]
        return tuple((p, STEADY) for p in patterns_of_kind(self.model, harmonic))


def cause_of(model: EffectModel, shape: Shape) -> LawAndOrder:
    """Return the law and, if it may occur more than once, its order."""
    own = model.own if isinstance(model, Coursed) else shape if model.repeats else ()
    return model.law, own


def key(terms: Iterable[Term | Member]) -> frozenset[tuple[str, Shape]]:
    """Return what makes two hypotheses equal."""
    return frozenset(
        (t.model.name, t.shape if t.model.repeats or isinstance(t.model, Nameless) else ()) for t in terms
    )


def believed(of: Evidence, inflation: float) -> float:
    """Return the factor by which a difference of χ² is divided.

    It is at least the factor by which the true variance of the scores of the found effects exceeds that of
    independent errors.
    """
    effects = np.array([c.effect != INSTRUMENT for c in of.columns], bool)
    own, true = np.diag(of.information)[effects], np.diag(of.score_covariance)[effects]
    return float(max(_TEMPERED * inflation, np.max(true / np.maximum(own, 1e-300), initial=1.0)))


def prior_deviance(run: GaugeRun, terms: Sequence[tuple[EffectModel, Shape]], laws: int) -> float:
    """Return −2 ln of a set's prior probability: 1 over the number of similar sets, including shapes."""
    unknown = any(isinstance(model, Nameless) for model, _ in terms)
    each = sum(_one_prior_deviance(run, model, shape, laws) for model, shape in terms)
    return float(each - 2 * np.log(NAMELESS) * unknown)


def _one_prior_deviance(run: GaugeRun, model: EffectModel, shape: Shape, laws: int) -> float:
    """Return −2 ln of the prior probability of an effect or pattern among its kind."""
    if (model, shape) in PATTERNS:
        return float(2 * np.log(len(PATTERNS)))
    if isinstance(model, PatternInCourse) and model.like is not None:
        # As likely beside the effect as a steady pattern is beside a steady effect.
        return _one_prior_deviance(run, model.like, shape, laws) + float(2 * np.log(len(PATTERNS) / laws))
    courses = len(SEARCHED) if isinstance(model, Coursed) else 1
    return float(2 * np.log(laws * courses * max(len(model.shapes(*span(run))) / _PEAK, 1.0)))


def prior_sigma(of: Evidence, terms: Sequence[Term]) -> Float:
    """Return the prior 1 σ (K,) of amplitudes; infinite for the instrument, which has its own prior."""
    plausible = {(t.model.name, a.name): a.plausible for t in terms for a in t.amplitudes}
    return np.array(
        [
            np.inf if c.effect == INSTRUMENT else PRIOR_PLAUSIBLE * plausible[c.effect, c.amplitude]
            for c in of.columns
        ]
    )


def members_of(run: GaugeRun, found: Fit, scores: Sequence[Scored], laws: int) -> tuple[Member, ...]:
    """Return what may replace or join a fit's effects: these, all scored effects, and all patterns.

    Laws with a step may have the step of an effect that was found.
    """
    asked = [(t.model, t.shape) for t in found.terms]
    asked += [(s.model, s.shape) for s in scores]
    # An effect that may occur more than once is another cause at another shape.
    asked += [(s.model, shape) for s in scores if s.model.repeats for shape in s.model.shapes(*span(run))]
    asked += [
        (s.model, t.shape)
        for s in scores
        for t in found.terms
        if s.model.kind is t.model.kind and s.model.kind is not CourseKind.CONSTANT
    ]
    known = [t for t in found.terms if not isinstance(t.model, Nameless)]
    as_found = [(p, t.shape) for t in known for p in patterns_in_course(t.model, pattern_of(t)[2])]
    each = dict.fromkeys((*asked, *PATTERNS, *as_found))
    return tuple(Member(model, shape, _one_prior_deviance(run, model, shape, laws)) for model, shape in each)


def terms_of(members: Sequence[Member], found: Fit) -> tuple[Term, ...]:
    """Return a set's terms as the start of a fit: those of another fit unchanged, others with size zero."""
    kept = {(t.model.name, t.shape): t for t in found.terms}
    return tuple(
        kept.get((m.model.name, m.shape), Term(m.model, m.shape, np.zeros(len(m.model.amplitudes))))
        for m in members
    )


@dataclass(frozen=True)
class Sets:
    """Marginal likelihoods of sets of members.

    Attributes
    ----------
    place : tuple of (Q,) int
        The columns of each member.
    information, right : (K, K), (K,)
        Normal equations of all columns in units of their prior 1 σ, with the stated instrument eliminated.
    sigma : (K,)
        That prior 1 σ.
    """

    members: tuple[Member, ...]
    place: tuple[Int, ...]
    information: Float
    right: Float
    sigma: Float

    @staticmethod
    def of(about: Evidence, members: Sequence[Member], stated: Stated, believed: float) -> Sets:
        """Return the sets of those members that the evidence covers; χ² is divided by ``believed``."""
        out = instrument_places(about)
        left = marginalised(
            about.information / believed + stated.over(about.columns), about.right / believed, out, 1e-13
        )
        kept = np.setdiff1d(np.arange(len(about.columns)), out)
        sigma = np.zeros(len(kept))
        seen, place = [], []
        for member in members:
            at = np.searchsorted(kept, places_of(about, member.model, member.shape))
            sigma[at] = [PRIOR_PLAUSIBLE * a.plausible for a in member.model.amplitudes]
            if len(at) and np.diag(left.information)[at].min() > 0:
                seen.append(member)
                place.append(at)
        scaled = left.information * np.outer(sigma, sigma)
        return Sets(tuple(seen), tuple(place), scaled, left.right * sigma, sigma)

    def deviance(self, chosen: Set) -> float:
        """Return −2 ln of a set's posterior probability, up to a constant."""
        before = sum(self.members[k].prior_deviance for k in chosen)
        before -= 2 * np.log(NAMELESS) * any(self.members[k].nameless for k in chosen)
        if not chosen:
            return 0.0
        at = np.concatenate([self.place[k] for k in sorted(chosen)])
        root = cholesky(np.eye(len(at)) + self.information[np.ix_(at, at)], lower=True, check_finite=False)
        gain = solve_triangular(root, self.right[at], lower=True, check_finite=False)
        return float(before + 2 * np.sum(np.log(np.diag(root))) - gain @ gain)

    def in_order(self, chosen: Set) -> tuple[Member, ...]:
        """Return a set's members in order."""
        return tuple(self.members[k] for k in sorted(chosen))

    def amplitudes(self, chosen: Set) -> tuple[Float, ...]:
        """Return the optimal amplitudes (Q,) of each member of a set."""
        each = [self.place[k] for k in sorted(chosen)]
        at = np.concatenate([np.zeros(0, np.int64), *each])
        both = np.eye(len(at)) + self.information[np.ix_(at, at)]
        best = np.linalg.solve(both, self.right[at]) * self.sigma[at]
        return tuple(np.split(best, np.cumsum([len(p) for p in each])[:-1]))

    def set_of(self, found: Fit) -> Set:
        """Return the set of a fit's effects and patterns."""
        own = {(t.model.name, t.shape) for t in found.terms}
        return frozenset(k for k, m in enumerate(self.members) if (m.model.name, m.shape) in own)

    def without_describing_patterns(self, chosen: Set) -> Sets:
        """Return the sets without patterns that merely describe one of some effects: they are no rivals.

        Nor are patterns of an effect's kind: as unknown laws like it they count already
        (`stages.diagnose.gauge.unknown_laws`).
        """
        own = {p for c in chosen for p in self.members[c].of_kind}
        echoes = {
            k for k, member in enumerate(self.members)
            if member.nameless and k not in chosen
            and ((member.model, member.shape) in own or any(self._apart(k, c) < SAME**2 for c in chosen))
        }  # fmt: skip
        kept = [k for k in range(len(self.members)) if k not in echoes]
        return replace(
            self, members=tuple(self.members[k] for k in kept), place=tuple(self.place[k] for k in kept)
        )

    def _apart(self, pattern: int, effect: int) -> float:
        """Return the share of a pattern's information that remains when an effect is free."""
        at, free = self.place[pattern], self.place[effect]
        own, both = self.information[np.ix_(at, at)], self.information[np.ix_(free, at)]
        taken = both.T @ np.linalg.lstsq(self.information[np.ix_(free, free)], both)[0]
        return float(1 - np.trace(np.linalg.lstsq(own, taken)[0]) / len(at))

    def likely(self, first: Collection[Set], most: int) -> dict[Set, float]:
        """Return the deviance of all sets of up to ``most`` members visited from the ``first`` ones."""
        met = {chosen: self.deviance(chosen) for chosen in first}
        looked_at, grown = set[Set](), set[Set]()
        while len(looked_at) < _LOOKED_AT:
            best = min(met.values())
            ahead = [s for s in met if s not in looked_at and met[s] < best - 2 * np.log(_WORTH)]
            if not ahead:
                break
            here = min(ahead, key=met.__getitem__)
            looked_at.add(here)
            # Sets with one member added, dropped or exchanged.
            for rest in (here, *(here - {gone} for gone in here)):
                met.setdefault(rest, self.deviance(rest))
                if rest not in grown and len(rest) < most:
                    grown.add(rest)
                    for more, deviance in self._grown(rest):
                        met.setdefault(more, deviance)
        return met

    def _grown(self, rest: Set) -> Iterator[tuple[Set, float]]:
        """Yield the set with each member added, and its deviance; a model that does not repeat once."""
        taken = {self.members[k].model.name for k in rest if not self.members[k].model.repeats}
        free = [k for k, m in enumerate(self.members) if k not in rest and m.model.name not in taken]
        first, taken_up, best = self.deviance(rest), *self._taken_up(rest)
        named = not any(self.members[k].nameless for k in rest)
        for size in {len(self.place[k]) for k in free}:
            alike = [k for k in free if len(self.place[k]) == size]
            at = np.array([self.place[k] for k in alike])
            both = taken_up[:, at]
            own = np.eye(size) + self.information[at[:, :, None], at[:, None, :]]
            own -= np.einsum("rkp,rkq->kpq", both, both)
            pull = self.right[at] - np.einsum("rkq,r->kq", both, best)
            gain = np.einsum("kq,kq->k", pull, np.linalg.solve(own, pull[..., None])[..., 0])
            for k, more in zip(alike, np.linalg.slogdet(own)[1] - gain, strict=True):
                before = self.members[k].prior_deviance
                before -= 2 * np.log(NAMELESS) * (named and self.members[k].nameless)
                yield rest | {k}, float(first + before + more)

    def _taken_up(self, rest: Set) -> tuple[Float, Float]:
        """Return (R, K) and (R,) whose products are what a set's R columns absorb of the normal equations."""
        at = np.concatenate([np.zeros(0, np.int64), *(self.place[k] for k in sorted(rest))])
        root = np.linalg.cholesky(np.eye(len(at)) + self.information[np.ix_(at, at)])
        sides = np.column_stack([self.information[at], self.right[at]])
        taken = np.linalg.solve(root, sides)
        return taken[:, :-1], taken[:, -1]
