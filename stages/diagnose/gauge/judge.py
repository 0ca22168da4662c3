"""Compare rival hypotheses: the marginal likelihood ranks them, and held-out regimes guard the result."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Bool, Float
from stages.diagnose.effects.base import EffectModel, Shape
from stages.diagnose.effects.nameless import Nameless
from stages.diagnose.gauge.fit import Fit, evidence, fit
from stages.diagnose.gauge.formula import adequacy, describes_effects, empirical, may_need_pattern, swings
from stages.diagnose.gauge.hypotheses import Instead, Judged, Regime, judged_of, regimes_of
from stages.diagnose.gauge.run import GaugeRun, Term
from stages.diagnose.gauge.scan import Scored, refined
from stages.diagnose.gauge.search import LEAST_SHARE, MOST_EFFECTS, Search, shift_px
from stages.diagnose.gauge.sets import (
    LawAndOrder,
    Member,
    Sets,
    believed,
    cause_of,
    key,
    members_of,
    prior_deviance,
    terms_of,
)
from stages.diagnose.inference import Stated

# Sets that are less likely than the best by more than this in −2 ln are dropped: a thousand of them weigh
# less than a hundredth of the accepted probability of a wrong name.
_FAR = 30.0
# How often the likeliest hypothesis is replaced by a likelier one that its own equations suggest; one more
# round adds patterns to the last.
_ROUNDS = 4


@dataclass(frozen=True)
class Unfitted:
    """A set of effects that was weighed with another fit's equations: its members and amplitudes."""

    members: tuple[Member, ...]
    amplitudes: tuple[Float, ...]
    deviance: float
    probability: float

    @property
    def terms(self) -> tuple[Term, ...]:
        """Its effects and patterns with their amplitudes."""
        each = zip(self.members, self.amplitudes, strict=True)
        return tuple(Term(m.model, m.shape, a) for m, a in each)

    @property
    def possible(self) -> bool:
        """Whether all sizes are possible: for example, an exposure cannot be negative."""
        return all(t.model.possible(t.shape, t.amplitude) for t in self.terms)

    @property
    def statement(self) -> str:
        """The set in words, with its sizes."""
        return " ".join(t.model.statement(t.shape, t.amplitude) for t in self.terms)


@dataclass(frozen=True)
class Verdicts:
    """All hypotheses, the likeliest first, with the probability of each.

    Attributes
    ----------
    probability : (H,)
    adequacy : float
        Probability that the likeliest hypothesis' residual is noise.
    formula : Judged
        The empirical formula, whether it is the likeliest or not.
    unfitted : tuple of Unfitted
        Sets of effects and patterns that were weighed but not fitted.
    laws : int
        Number of laws, which are equally likely beforehand.
    """

    regimes: tuple[Regime, ...]
    judged: tuple[Judged, ...]
    probability: Float
    adequacy: float
    formula: Judged
    unfitted: tuple[Unfitted, ...] = ()
    laws: int = 1

    @property
    def sets(self) -> Iterator[tuple[float, tuple[Term, ...]]]:
        """The probability of each set, fitted or not, and its effects and patterns."""
        yield from ((float(p), j.fit.terms) for p, j in zip(self.probability, self.judged, strict=True))
        yield from ((u.probability, u.terms) for u in self.unfitted)

    def chance_of(self, term: Term) -> float:
        """Return the probability that a term's law is among the causes, with whatever course."""
        return sum(p for p, causes, _, _ in self._each() if cause_of(term.model, term.shape) in causes)

    def chance_of_course(self, term: Term) -> float:
        """Return the probability of a term's course if its law is among the causes."""
        both = sum(p for p, _, names, _ in self._each() if term.model.name in names)
        return min(both / max(self.chance_of(term), 1e-300), 1.0)

    def likely_laws(self, sure: float) -> tuple[str, ...]:
        """Return the laws of the likeliest causes that together reach the probability ``sure``.

        Causes that merely join others, without explaining the run better, are not among them: where one law
        suffices, every other may stand beside it with a probability that it also has without any run.
        """
        chance, alone = dict[frozenset[LawAndOrder], float](), dict[frozenset[LawAndOrder], float]()
        for p, of, _, patterns in self._each():
            causes = frozenset(of)
            chance[causes] = chance.get(causes, 0.0) + p
            alone[causes] = alone.get(causes, 0.0) + p * (not patterns)
        each = sorted(chance, key=lambda causes: -chance[causes])
        before = np.cumsum([chance[causes] for causes in each]) - [chance[causes] for causes in each]
        likely = (causes for causes, so_far in zip(each, before, strict=True) if so_far < sure)
        of_each = (sorted(causes) for causes in likely if not self._joins(causes, chance[causes], alone))
        return tuple(dict.fromkeys(law for causes in of_each for law, _ in causes))

    def _joins(
        self, causes: frozenset[LawAndOrder], chance: float, alone: Mapping[frozenset[LawAndOrder], float]
    ) -> bool:
        """Return whether fewer of these causes, without any pattern, explain the run as well."""
        return any(
            fewer and fewer < causes and p >= chance * self.laws ** (len(causes) - len(fewer))
            for fewer, p in alone.items()
        )

    def instead_of(self, term: Term) -> Instead:
        """Return the hypotheses without a term's law that explain the run otherwise."""
        cause, found = cause_of(term.model, term.shape), Counter[str]()
        of_patterns, of_names = 0.0, 0.0
        for p, causes, _, patterns in self._each():
            if cause in causes:
                continue
            of_names += p if causes else 0.0
            of_patterns += p if patterns and not causes else 0.0
            found.update(dict.fromkeys(() if causes else patterns, p))
        return Instead(dict(found.most_common()), of_patterns, of_names)

    def _each(self) -> Iterator[tuple[float, set[LawAndOrder], set[str], set[str]]]:
        """Yield every hypothesis' probability, its causes, its effects' names, and its patterns' formulas."""
        for p, terms in self.sets:
            yield p, *_named_and_nameless(terms)


def _named_and_nameless(of: Sequence[Term]) -> tuple[set[LawAndOrder], set[str], set[str]]:
    """Return the causes and names of the effects of a hypothesis, and the formulas of its patterns."""
    named = [m for m in of if not isinstance(m.model, Nameless)]
    patterns = {m.model.formula(m.shape) for m in of if isinstance(m.model, Nameless)}
    return {cause_of(m.model, m.shape) for m in named}, {m.model.name for m in named}, patterns


def judge(
    searched: Search, library: Mapping[str, EffectModel], stated: Stated, swung: Sequence[Scored]
) -> Verdicts:
    """Weigh the found hypothesis, its rivals, an empirical formula, and all sets near the likeliest.

    ``swung`` are the swings without a cause about the stated instrument.
    """
    run, regimes = searched.run, regimes_of(searched.run)
    laws = len({model.law for model in library.values()})
    ratio = believed(evidence(run, searched.found, ())[0], searched.inflation)
    formula = empirical(run, searched.nothing, stated, swung)

    def weighed(found: Fit) -> Judged:
        return judged_of(run, found, regimes, stated, ratio, _beforehand(run, found, laws))

    judged = [weighed(f) for f in _distinct([searched.nothing, searched.found, *searched.rivals, formula])]
    former: Judged | None = None
    patterned: Judged | None = None
    for rounds_left in reversed(range(_ROUNDS)):
        ranked, allowed = _ranked(searched, judged, formula)
        best, is_new = ranked[0], ranked[0] is not former
        former = best
        if is_new:
            left, sets = _near(run, best, searched.scores, laws, stated, ratio)
        near = _unfitted(sets, ranked)
        more = _better(run, best, near) if rounds_left > 1 else None
        if more is None and rounds_left and patterned is not best:
            patterned = best
            more = _with_patterns(run, best, left, stated)
        if more is None:
            break
        judged.append(weighed(more))
    chance, unfitted = _chances(ranked, allowed, near)
    ranked = (replace(best, evidence=evidence(run, best.fit, ())[0]), *ranked[1:])
    return Verdicts(regimes, ranked, chance, left, _of(judged, formula), unfitted, laws)


def _chances(
    ranked: Sequence[Judged], allowed: Bool, near: Sequence[Unfitted]
) -> tuple[Float, tuple[Unfitted, ...]]:
    """Return the probability (H,) of each fitted hypothesis, and the others with theirs, likeliest first."""
    deviance = np.array([*(j.deviance + j.prior_deviance for j in ranked), *(u.deviance for u in near)])
    weight = np.where([*allowed, *(True for _ in near)], np.exp(-0.5 * (deviance - deviance[0])), 0.0)
    chance = weight / weight.sum()
    each = (replace(u, probability=float(p)) for u, p in zip(near, chance[len(ranked) :], strict=True))
    return chance[: len(ranked)], tuple(sorted(each, key=lambda u: -u.probability))


def _of(judged: Sequence[Judged], formula: Fit) -> Judged:
    """Return the formula's hypothesis."""
    names = [t.model.name for t in formula.terms]
    return next((j for j in judged if [t.model.name for t in j.fit.terms] == names), judged[0])


def _ranked(searched: Search, judged: Sequence[Judged], formula: Fit) -> tuple[tuple[Judged, ...], Bool]:
    """Return the hypotheses, the likeliest first, and which (H,) are allowed at all.

    Those that predict held-out regimes worse than the stated instrument, or have impossible sizes, are not.
    """
    nothing = next(j for j in judged if not j.fit.terms)
    allowed = np.array([j.heldout <= nothing.heldout and j.possible for j in judged])
    deviance = np.array([j.deviance + j.prior_deviance for j in judged])
    allowed &= ~_redundant(searched, judged, _of(judged, formula), deviance)
    order = np.lexsort((deviance, ~allowed))
    return tuple(judged[k] for k in order), np.asarray(allowed[order])


def _better(run: GaugeRun, best: Judged, near: Sequence[Unfitted]) -> Fit | None:
    """Return the fit of the likeliest set of named effects, if it is likelier than all that was fitted."""
    named = [u for u in near if u.members and not any(m.nameless for m in u.members)]
    first = min(named, key=lambda u: u.deviance, default=None)
    if first is None or first.deviance > best.deviance + best.prior_deviance:
        return None
    return refined(run, fit(run, best.fit.state, terms_of(first.members, best.fit)))


def _near(
    run: GaugeRun, best: Judged, scores: Sequence[Scored], laws: int, stated: Stated, ratio: float
) -> tuple[float, Sets]:
    """Return the probability that the likeliest leaves only noise, and the sets of effects near it."""
    members = members_of(run, best.fit, scores, laws)
    own = {(t.model, t.shape) for t in best.fit.terms}
    asked = [(m.model, m.shape) for m in members if (m.model, m.shape) not in own]
    about = evidence(run, best.fit, asked, with_spread=False)[0]
    return adequacy(best.fit.of_patterns, best.fit.terms, stated), Sets.of(about, members, stated, ratio)


def _unfitted(sets: Sets, ranked: Sequence[Judged]) -> list[Unfitted]:
    """Return the sets near the likeliest hypothesis that were not fitted themselves."""
    best = ranked[0]
    here = sets.set_of(best.fit)
    if not here:
        return []
    sets = sets.without_describing_patterns(here)
    here, fitted = sets.set_of(best.fit), {key(j.fit.terms) for j in ranked}
    offset = best.deviance + best.prior_deviance - sets.deviance(here)
    out = []
    for chosen, deviance in sets.likely([here], MOST_EFFECTS).items():
        members, far = sets.in_order(chosen), deviance + offset - best.deviance - best.prior_deviance
        if far < _FAR and key(members) not in fitted:
            one = Unfitted(members, sets.amplitudes(chosen), deviance + offset, 0.0)
            out += [one] if one.possible else []
    return out


def _with_patterns(run: GaugeRun, best: Judged, left: float, stated: Stated) -> Fit | None:
    """Return the likeliest effects together with patterns for their residual, if that is not noise.

    ``left`` is the probability that it is noise.
    """
    if not best.named:
        return None
    swung = swings(run, best.fit, stated)
    if not may_need_pattern(left, swung):
        return None
    both = empirical(run, best.fit, stated, swung)
    sizes = [shift_px(both, t) for t in both.terms]
    own = len(best.fit.terms)
    return both if max(sizes[own:], default=0.0) >= LEAST_SHARE * max(sizes[:own]) else None


def _redundant(searched: Search, judged: Sequence[Judged], formula: Judged, total_deviance: Float) -> Bool:
    """Return (H,) True for the formula, where the likeliest named effects or other ones make its patterns."""
    named, same = [k for k, j in enumerate(judged) if j.named], False
    if named and formula.fit.terms:
        best = judged[min(named, key=lambda k: float(total_deviance[k]))]
        same = describes_effects(searched.run, formula.fit, best.fit, searched.scores)
    return np.array([same and j is formula for j in judged])


def _beforehand(run: GaugeRun, found: Fit, laws: int) -> float:
    return prior_deviance(run, [(t.model, t.shape) for t in found.terms], laws)


def _distinct(fits: Sequence[Fit]) -> list[Fit]:
    """Return the best fit of each set of effects."""
    best: dict[frozenset[tuple[str, Shape]], Fit] = {}
    for f in fits:
        same = key(f.terms)
        if same not in best or f.cost < best[same].cost:
            best[same] = f
    return list(best.values())
