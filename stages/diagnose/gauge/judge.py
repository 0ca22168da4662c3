"""Rivals compared: the marginal likelihood of all measurements ranks them, held-out regimes guard it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Bool, Float
from stages.diagnose.effects.base import EffectModel
from stages.diagnose.effects.courses import SEARCHED, Coursed
from stages.diagnose.effects.nameless import VOCABULARY, Nameless
from stages.diagnose.gauge.elimination import Part
from stages.diagnose.gauge.fit import Fit, evidence
from stages.diagnose.gauge.formula import (
    Rival,
    adequacy,
    empirical,
    rival_patterns,
    says_the_same,
    swings,
)
from stages.diagnose.gauge.run import GaugeRun, Term
from stages.diagnose.gauge.scan import Scored, refined, span
from stages.diagnose.gauge.search import LEAST_SHARE, Search, shift_px
from stages.diagnose.inference import INSTRUMENT, PRIOR_PLAUSIBLE, Evidence, Stated, estimate, total

_STRETCHES = 2
_LEAST_FRAMES = 8
# Prior: all effects of the library are equally likely, and a pattern without a cause is 50 times less likely
# than one of them, because such a pattern can imitate any law. Whether a law suffices is tested separately.
# Debt: data/debts.md.
_NAMELESS = 1 / 50
_PEAK = 2
# Likelihoods do not contain the small errors of laws and of image formation: what looks like odds of 1000 to
# 1 counts as 100 to 1. A drawn focal length was once called a cone at 100 to 1. Debt: data/debts.md.
_TEMPERED = 1.5
# Rivals that are tried with patterns for what is left, as the found effects are.
_WITH_PATTERNS = 3


@dataclass(frozen=True)
class Regime:
    """A part of the run that can be held out: its name, its frames (N,), the bore its rings lie in."""

    name: str
    part: Part
    section: int


@dataclass(frozen=True)
class Judged:
    """A hypothesis with its fit and how it does.

    Attributes
    ----------
    fit : Fit
    evidence : Evidence
        Of the whole run.
    by_regime : tuple of Evidence
        Of each regime on its own.
    surprise, heldout : float
        −2 ln of the likelihood of all, and of each regime given the others, over by how much neighbours err
        alike.
    beforehand : float
        −2 ln of its chance before anything was measured.
    """

    fit: Fit
    evidence: Evidence
    by_regime: tuple[Evidence, ...]
    surprise: float
    heldout: float
    beforehand: float

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects, in order."""
        return tuple(sorted(t.model.name for t in self.fit.terms))

    @property
    def laws(self) -> tuple[str, ...]:
        """Names of the effects' laws, in order."""
        return tuple(sorted({t.model.law for t in self.fit.terms}))

    @property
    def library_terms(self) -> tuple[Term, ...]:
        """The effects of the library; patterns for what they leave stand behind them."""
        return tuple(t for t in self.fit.terms if not isinstance(t.model, Nameless))

    @property
    def named(self) -> bool:
        """Whether all its effects are of the library, and there are some."""
        return bool(self.fit.terms) and not any(isinstance(t.model, Nameless) for t in self.fit.terms)


@dataclass(frozen=True)
class Verdicts:
    """All hypotheses, the likeliest first, with the chance of each.

    Attributes
    ----------
    regimes, judged
    probability : (H,)
    adequacy : float
        Chance that what the likeliest leaves is noise.
    formula : Judged
        The empirical formula, whether it is the likeliest or not.
    alike : float
        How many measurements that err alike count as one.
    unknown : tuple of tuple of Rival
        For each effect of the likeliest, the patterns without a cause that may be in its place.
    """

    regimes: tuple[Regime, ...]
    judged: tuple[Judged, ...]
    probability: Float
    adequacy: float
    formula: Judged
    alike: float
    unknown: tuple[tuple[Rival, ...], ...] = ()

    def chance_of(self, law: str) -> float:
        """Return the chance that a law is among the causes, with whatever course."""
        named = zip(self.judged[0].library_terms, self.unknown, strict=True) if self.unknown else ()
        against = [r.odds for term, rivals in named if term.model.law == law for r in rivals]
        return self._listed(law) / (1 + sum(against))

    def _listed(self, law: str) -> float:
        """Return the chance of a law among the hypotheses that were fitted."""
        return float(sum(p for p, j in zip(self.probability, self.judged, strict=True) if law in j.laws))

    def chance_of_course(self, model: EffectModel) -> float:
        """Return the chance of an effect's course if its law is among the causes."""
        pairs = zip(self.probability, self.judged, strict=True)
        both = sum(p for p, j in pairs if model.name in j.names)
        return float(min(both / max(self._listed(model.law), 1e-300), 1.0))


def regimes_of(run: GaugeRun) -> tuple[Regime, ...]:
    """Return stretches of the run within one bore each."""
    count = len(run.time_s)
    votes = np.zeros((count, int(run.rings.section.max(initial=0)) + 1))
    np.add.at(votes, (run.rings.frame, run.rings.section), 1)
    seen = np.flatnonzero(votes.sum(1))
    nearest = seen[np.abs(np.arange(count)[:, None] - seen).argmin(1)] if len(seen) else np.zeros(count, int)
    section = votes.argmax(1)[nearest]
    out = []
    for k in range(votes.shape[1]):
        frames = np.flatnonzero(section == k)
        for n, piece in enumerate(np.array_split(frames, _STRETCHES)):
            if len(piece) >= _LEAST_FRAMES:
                mask = np.zeros(count, bool)
                mask[piece] = True
                out.append(Regime(f"bore {k + 1}, stretch {n + 1}", Part(mask), k))
    return tuple(out)


def judge(
    searched: Search, library: Mapping[str, EffectModel], stated: Stated, swung: Sequence[Scored]
) -> Verdicts:
    """Rank the found hypothesis, its rivals and an empirical formula.

    ``swung`` are the swings without a cause about the stated instrument.
    """
    run, regimes, alike = searched.run, regimes_of(searched.run), searched.alike
    formula = empirical(run, searched.nothing, stated, swung)
    fits = _distinct(
        [
            searched.nothing, searched.found, *searched.rivals, formula,
            *_with_patterns(searched, stated),
        ]
    )  # fmt: skip
    fits = [refined(run, f) for f in fits]
    laws = len({model.law for model in library.values()})
    judged = [judged_of(run, f, regimes, stated, alike, beforehand(run, f, laws)) for f in fits]
    patterns = [t.model.name for t in formula.terms]
    of_formula = next((j for j in judged if [t.model.name for t in j.fit.terms] == patterns), judged[0])
    nothing = next(j for j in judged if not j.fit.terms)
    # A hypothesis that predicts held-out regimes worse than the stated instrument is discarded.
    allowed = np.array([j.heldout <= nothing.heldout for j in judged])
    total_surprise = np.array([j.surprise + j.beforehand for j in judged])
    allowed &= ~_redundant(run, judged, of_formula, total_surprise)
    behind = (total_surprise - total_surprise[allowed].min()) / _TEMPERED
    weight = np.where(allowed, np.exp(-0.5 * behind), 0.0)
    order = np.lexsort((total_surprise, -weight))
    ranked = tuple(judged[k] for k in order)
    about, terms = evidence(run, ranked[0].fit, VOCABULARY)[0], ranked[0].fit.terms
    left = adequacy(about, terms, stated)
    odds = [_NAMELESS / len(VOCABULARY) / _chance(run, t, laws) for t in ranked[0].library_terms]
    rivals = rival_patterns(about, terms, stated, alike * _TEMPERED, odds)
    return Verdicts(regimes, ranked, (weight / weight.sum())[order], left, of_formula, alike, rivals)


def _with_patterns(searched: Search, stated: Stated) -> list[Fit]:
    """Return the found effects and their nearest rivals, each with patterns for what is left, if it is."""
    run, found = searched.run, searched.found
    if not found.terms:
        return []
    both = empirical(run, found, stated, swings(run, found, stated))
    sizes = [shift_px(both, t) for t in both.terms]
    own = len(found.terms)
    if max(sizes[own:], default=0.0) < LEAST_SHARE * max(sizes[:own]):
        return []
    laws = {t.model.law for t in found.terms}
    rivals = (f for f in searched.rivals if f.terms and {t.model.law for t in f.terms} != laws)
    near = sorted(rivals, key=lambda f: f.cost)[:_WITH_PATTERNS]
    return [both, *(empirical(run, f, stated, swings(run, f, stated)) for f in near)]


def _redundant(run: GaugeRun, judged: Sequence[Judged], formula: Judged, total_surprise: Float) -> Bool:
    """Return (H,) True for the formula where the likeliest named effects make its very pattern."""
    out = np.zeros(len(judged), bool)
    named = [k for k, j in enumerate(judged) if j.named]
    if named and formula.fit.terms:
        best = judged[min(named, key=lambda k: float(total_surprise[k]))]
        out[[j is formula for j in judged]] = says_the_same(run, formula.fit, best.fit)
    return out


def beforehand(run: GaugeRun, found: Fit, effects: int) -> float:
    """Return −2 ln of a hypothesis' chance beforehand: how many others there are like it, shapes included."""
    nameless = any(isinstance(t.model, Nameless) for t in found.terms)
    chance = np.prod([_chance(run, t, effects) for t in found.terms]) * (_NAMELESS if nameless else 1.0)
    return float(-2 * np.log(chance))


def _chance(run: GaugeRun, term: Term, effects: int) -> float:
    """Return the chance of a term beforehand, among its own kind."""
    if (term.model, term.shape) in VOCABULARY:
        return 1 / len(VOCABULARY)
    courses = len(SEARCHED) if isinstance(term.model, Coursed) else 1
    return 1 / (effects * courses * max(len(term.model.shapes(*span(run))) / _PEAK, 1.0))


def judged_of(
    run: GaugeRun, found: Fit, regimes: Sequence[Regime], stated: Stated, alike: float, before: float = 0.0
) -> Judged:
    """Return the hypothesis' evidence and its surprise, held out and not."""
    whole, *parts = evidence(run, found, (), [r.part for r in regimes])
    sigma = prior_sigma(whole, found.terms)

    def surprise(of: Evidence) -> float:
        return estimate(of.deflated(alike), stated, sigma).surprise

    if len(parts) < 2:
        return Judged(found, whole, tuple(parts), surprise(whole), surprise(whole), before)
    together = surprise(total(parts).over(whole.columns))
    heldout = [
        together - surprise(total([p for p in parts if p is not left]).over(whole.columns)) for left in parts
    ]
    return Judged(found, whole, tuple(parts), surprise(whole), float(np.sum(heldout)), before)


def prior_sigma(of: Evidence, terms: Sequence[Term]) -> Float:
    """Return (K,) 1 σ of amplitudes beforehand; infinite for the instrument, which has its own."""
    plausible = {(t.model.name, a.name): a.plausible for t in terms for a in t.amplitudes}
    return np.array(
        [
            np.inf if c.effect == INSTRUMENT else PRIOR_PLAUSIBLE * plausible[c.effect, c.amplitude]
            for c in of.columns
        ]
    )


def _by_shape(model: EffectModel) -> bool:
    """Return whether another shape is another cause."""
    return model.repeats or isinstance(model, Nameless)


def _distinct(fits: Sequence[Fit]) -> list[Fit]:
    """Return the best fit of each set of effects."""
    best: dict[tuple[tuple[str, tuple[float, ...]], ...], Fit] = {}
    for f in fits:
        shaped = ((t.model.name, t.shape if _by_shape(t.model) else ()) for t in f.terms)
        key = tuple(sorted(shaped))
        if key not in best or f.cost < best[key].cost:
            best[key] = f
    return list(best.values())
