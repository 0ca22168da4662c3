"""Rivals compared on held-out regimes: another bore, another part of the motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stages.diagnose.effects.base import EffectModel
from stages.diagnose.effects.decoys import DECOYS
from stages.diagnose.evidence import INSTRUMENT, Evidence, total
from stages.diagnose.gauge.elimination import Part
from stages.diagnose.gauge.fit import Fit, evidence, fit
from stages.diagnose.gauge.run import GaugeRun, Term
from stages.diagnose.gauge.scan import scan
from stages.diagnose.gauge.search import Search, alike, refits
from stages.diagnose.inference import PRIOR_PLAUSIBLE, Stated, estimate

Float = NDArray[np.float64]
_RIVALS = 4
_STRETCHES = 2
_LEAST_FRAMES = 8


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
    """

    fit: Fit
    evidence: Evidence
    by_regime: tuple[Evidence, ...]
    surprise: float
    heldout: float

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects, in order."""
        return tuple(sorted(t.model.name for t in self.fit.terms))


@dataclass(frozen=True)
class Verdicts:
    """All hypotheses, the likeliest first, with the chance of each."""

    regimes: tuple[Regime, ...]
    judged: tuple[Judged, ...]
    probability: Float

    def chance_of(self, name: str) -> float:
        """Return the chance that an effect is among the causes."""
        return float(sum(p for p, j in zip(self.probability, self.judged, strict=True) if name in j.names))


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


def judge(searched: Search, library: Mapping[str, EffectModel], stated: Stated) -> Verdicts:
    """Fit the found hypothesis' rivals to all, and rank them by what they say of regimes held out."""
    run, regimes = searched.run, regimes_of(searched.run)
    fits = [searched.nothing, searched.found, *_rivals(searched, library, stated)]
    scores = searched.steps[0].scores
    deflation = alike(scores)
    judged = [judged_of(run, f, regimes, stated, deflation) for f in _distinct(fits)]
    judged.sort(key=lambda j: j.heldout)
    heldout = np.array([j.heldout for j in judged])
    weight = np.exp(-0.5 * (heldout - heldout.min()))
    return Verdicts(regimes, tuple(judged), weight / weight.sum())


def judged_of(
    run: GaugeRun, found: Fit, regimes: Sequence[Regime], stated: Stated, deflation: float
) -> Judged:
    """Return the hypothesis' evidence and its surprise, held out and not."""
    whole, *parts = evidence(run, found, (), [r.part for r in regimes])
    sigma = prior_sigma(whole, found.terms)

    def surprise(of: Evidence) -> float:
        return estimate(of, stated, sigma).surprise / deflation

    if len(parts) < 2:
        return Judged(found, whole, tuple(parts), surprise(whole), surprise(whole))
    together = surprise(total(parts).over(whole.columns))
    heldout = [
        together - surprise(total([p for p in parts if p is not left]).over(whole.columns)) for left in parts
    ]
    return Judged(found, whole, tuple(parts), surprise(whole), float(np.sum(heldout)))


def prior_sigma(of: Evidence, terms: Sequence[Term]) -> Float:
    """Return (K,) 1 σ of amplitudes beforehand; infinite for the instrument, which has its own."""
    plausible = {(t.model.name, a.name): a.plausible for t in terms for a in t.model.amplitudes}
    return np.array(
        [
            np.inf if c.effect == INSTRUMENT else PRIOR_PLAUSIBLE * plausible[c.effect, c.amplitude]
            for c in of.columns
        ]
    )


def _rivals(searched: Search, library: Mapping[str, EffectModel], stated: Stated) -> list[Fit]:
    """Return fits with another effect, or a decoy, in each found one's place."""
    run, found, out = searched.run, searched.found, []
    decoys = {d.name: d for d in DECOYS}
    for k, term in enumerate(found.terms):
        others = found.terms[:k] + found.terms[k + 1 :]
        reduced = fit(run, found.state, others) if others else searched.nothing
        rest = {name: m for name, m in library.items() if name != term.model.name}
        scores = scan(run, reduced, rest, stated)
        out += refits(run, reduced, scores, _RIVALS)
        out += refits(run, reduced, scan(run, reduced, decoys, stated), 1)
        out.append(reduced)
    return out


def _distinct(fits: Sequence[Fit]) -> list[Fit]:
    """Return the best fit of each set of effects."""
    best: dict[tuple[str, ...], Fit] = {}
    for f in fits:
        names = tuple(sorted(t.model.name for t in f.terms))
        if names not in best or f.cost < best[names].cost:
            best[names] = f
    return list(best.values())
