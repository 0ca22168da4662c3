"""Hypotheses of left-out effects, each with its likelihood on all measurements and on held-out regimes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stages.diagnose.effects.nameless import Nameless
from stages.diagnose.gauge.equations import Part
from stages.diagnose.gauge.fit import Fit, evidence
from stages.diagnose.gauge.run import GaugeRun, Term
from stages.diagnose.gauge.sets import prior_sigma
from stages.diagnose.inference import Evidence, Stated, estimate, total

_STRETCHES = 2
_LEAST_FRAMES = 8


@dataclass(frozen=True)
class Regime:
    """A part of the run that can be held out: its frames (N,), and the bore of its rings."""

    part: Part
    section: int


@dataclass(frozen=True)
class Instead:
    """What may be in an effect's place.

    Attributes
    ----------
    patterns : dict of str to float
        Patterns without a cause that stand there without any name, the likeliest first, each with the
        probability of all sets that contain it.
    nameless, named : float
        Probability of all sets of patterns alone, each counted once, and of all with other names.
    """

    patterns: dict[str, float]
    nameless: float
    named: float


@dataclass(frozen=True)
class Judged:
    """A hypothesis with its fit and likelihoods.

    Attributes
    ----------
    evidence : Evidence
        Of the whole run; the scatter of its scores is estimated only for the likeliest hypothesis.
    by_regime : tuple of Evidence
        Of each regime alone.
    deviance, heldout : float
        −2 ln of the likelihood of all measurements, and of each regime given the others, divided by the
        factor for correlated errors.
    prior_deviance : float
        −2 ln of its prior probability.
    """

    fit: Fit
    evidence: Evidence
    by_regime: tuple[Evidence, ...]
    deviance: float
    heldout: float
    prior_deviance: float

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects, in order."""
        return tuple(sorted(t.model.name for t in self.fit.terms))

    @property
    def library_terms(self) -> tuple[Term, ...]:
        """The effects of the library; patterns for their residual follow them in the list of terms."""
        return tuple(t for t in self.fit.terms if not isinstance(t.model, Nameless))

    @property
    def possible(self) -> bool:
        """Whether the sizes of all its effects are possible."""
        return all(t.model.possible(*t.at(t.amplitude)) for t in self.fit.terms)

    @property
    def named(self) -> bool:
        """Whether it has effects, and all are of the library."""
        return bool(self.fit.terms) and not any(isinstance(t.model, Nameless) for t in self.fit.terms)


def regimes_of(run: GaugeRun) -> tuple[Regime, ...]:
    """Return stretches of the run that are within one bore each."""
    count = len(run.time_s)
    votes = np.zeros((count, int(run.rings.section.max(initial=0)) + 1))
    np.add.at(votes, (run.rings.frame, run.rings.section), 1)
    seen = np.flatnonzero(votes.sum(1))
    nearest = seen[np.abs(np.arange(count)[:, None] - seen).argmin(1)] if len(seen) else np.zeros(count, int)
    section = votes.argmax(1)[nearest]
    out = []
    for k in range(votes.shape[1]):
        frames = np.flatnonzero(section == k)
        for piece in np.array_split(frames, _STRETCHES):
            if len(piece) >= _LEAST_FRAMES:
                mask = np.zeros(count, bool)
                mask[piece] = True
                out.append(Regime(Part(mask), k))
    return tuple(out)


def judged_of(
    run: GaugeRun, found: Fit, regimes: Sequence[Regime], stated: Stated, inflation: float,
    before: float = 0.0,
) -> Judged:  # fmt: skip
    """Return the hypothesis with its evidence and its deviance on all and on held-out regimes."""
    whole, *parts = evidence(run, found, (), [r.part for r in regimes], with_spread=False)
    sigma = prior_sigma(whole, found.terms)

    def deviance(of: Evidence) -> float:
        return estimate(of.deflated(inflation), stated, sigma).deviance

    if len(parts) < 2:
        return Judged(found, whole, tuple(parts), deviance(whole), deviance(whole), before)
    together = deviance(total(parts).over(whole.columns))
    heldout = [
        together - deviance(total([p for p in parts if p is not left]).over(whole.columns)) for left in parts
    ]
    return Judged(found, whole, tuple(parts), deviance(whole), float(np.sum(heldout)), before)
