"""Forward selection of effects on a gauge run: score all, refit with the best few, keep what is needed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from stages.diagnose.effects.base import EffectModel
from stages.diagnose.effects.predict import ring_shift_px, texture_shift_px
from stages.diagnose.gauge.fit import Fit, fit
from stages.diagnose.gauge.prepare import weighed
from stages.diagnose.gauge.run import GaugeRun, Term
from stages.diagnose.gauge.scan import Scored, scan
from stages.diagnose.inference import Stated

Float = NDArray[np.float64]
# Below this chance, corrected for all that was tried, something is there.
DETECTED = 1e-4
_REFITTED = 5
_MOST_EFFECTS = 3
_WORTH_REFITTING = 0.1
_LEAST_GAIN = 20.0
# A further effect smaller than this share of the first may be the first's imprecise prediction.
_LEAST_SHARE = 0.01


@dataclass(frozen=True)
class Step:
    """One step of the selection: the fit it starts from, all scores there, and the refits tried."""

    before: Fit
    scores: tuple[Scored, ...]
    tried: tuple[Fit, ...]
    global_p: float


@dataclass(frozen=True)
class Search:
    """The selection's outcome: measurements with final weights, the final fit, and the steps to it."""

    run: GaugeRun
    nothing: Fit
    found: Fit
    steps: tuple[Step, ...]


def search(run: GaugeRun, start: Fit, library: Mapping[str, EffectModel], stated: Stated) -> Search:
    """Add effects while the data ask for them; then see whether a rival does better in each one's place."""
    found, steps = start, []
    while True:
        step, better = _extended(run, found, library, stated)
        steps.append(step)
        if better is None or len(better.terms) > _MOST_EFFECTS:
            break
        run = weighed(run, better.state, better.terms)
        found = fit(run, better.state, better.terms)
        found = _exchanged(run, found, library, stated) if len(found.terms) > 1 else found
    return Search(run, fit(run, start.state, ()), found, tuple(steps))


def global_p(scores: Sequence[Scored]) -> float:
    """Return the chance that nothing hidden gives so large a score anywhere."""
    return float(min(min((s.p_value for s in scores), default=1.0) * max(len(scores), 1), 1.0))


def refits(run: GaugeRun, found: Fit, scores: Sequence[Scored], most: int = _REFITTED) -> list[Fit]:
    """Return the fits with each of the most promising effects added, best first."""
    promising = sorted(scores, key=lambda s: -s.score.gain)[:most]
    worth = [s for s in promising if s.score.gain > _WORTH_REFITTING * promising[0].score.gain]
    fits = []
    for s in worth:
        term = Term(s.model, s.shape, s.score.amplitude)
        # A large effect promises more than its linear prediction keeps: start small, too.
        fits += [_best_start(run, found, term)]
    return sorted(fits, key=lambda f: f.cost)


def _best_start(run: GaugeRun, found: Fit, term: Term) -> Fit:
    return fit(run, found.state, (*found.terms, replace(term, amplitude=0 * term.amplitude)))


def _extended(
    run: GaugeRun, found: Fit, library: Mapping[str, EffectModel], stated: Stated
) -> tuple[Step, Fit | None]:
    scores = scan(run, found, library, stated)
    p_value = global_p(scores)
    if p_value > DETECTED:
        return Step(found, tuple(scores), (), p_value), None
    tried = refits(run, found, scores)
    step = Step(found, tuple(scores), tuple(tried), p_value)
    best = tried[0]
    needed = found.cost - best.cost > _LEAST_GAIN * alike(scores) and _counts(run, best)
    return step, best if needed else None


def alike(scores: Sequence[Scored]) -> float:
    """Return by how much a gain of χ² is overrated because neighbours err alike."""
    ratio = [s.score.gain / s.score.statistic for s in scores if s.score.statistic > 1]
    return float(max(np.median(ratio), 1.0)) if ratio else 1.0


def _counts(run: GaugeRun, found: Fit) -> bool:
    """Return whether the last effect is no mere trifle beside the others."""
    sizes = [shift_px(found, t) for t in found.terms]
    return len(sizes) < 2 or sizes[-1] > _LEAST_SHARE * max(sizes[:-1])


def shift_px(found: Fit, term: Term) -> float:
    """Return the r.m.s. shift in px of rings and fiducials by a term."""
    ring = ring_shift_px(term.model, found.linearised.rings, term.shape, term.amplitude)
    edge = np.linalg.norm(
        texture_shift_px(term.model, found.linearised.edges, term.shape, term.amplitude), axis=1
    )
    return float(max(np.sqrt(np.nanmean(ring**2)), np.sqrt(np.nanmean(edge**2))))


def _exchanged(run: GaugeRun, found: Fit, library: Mapping[str, EffectModel], stated: Stated) -> Fit:
    """Try to put another effect in each term's place."""
    for k in range(len(found.terms)):
        others = found.terms[:k] + found.terms[k + 1 :]
        reduced = fit(run, found.state, others)
        scores = scan(run, reduced, library, stated)
        best = refits(run, reduced, scores, 3)[0]
        if best.cost < found.cost - _LEAST_GAIN:
            found = best
    return found
