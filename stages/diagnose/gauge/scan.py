"""Scores of every effect of the library about one fit of a gauge run, at the best times and shapes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import label

from pipeline.arrays import Float
from pipeline.physics.effect import CourseKind
from stages.diagnose.effects.base import EffectModel, Shape
from stages.diagnose.gauge.fit import Fit, evidence, fit
from stages.diagnose.gauge.run import GaugeRun, Term
from stages.diagnose.inference import Around, Score, Stated, places_of, places_of_all, stated_belief
from stages.diagnose.result import Value

# Effects with more shapes than this are first tried on a thinned run.
_MANY = 12
_AT_ONCE = 240
_REFINED = 5
_THIN_RINGS, _THIN_EDGES = 8, 4
_ITERATIONS = 3
# A drop of χ² that one free parameter makes by chance two times in three.
_AS_GOOD = 1.0
# Small enough that no upper limit of the catalogue matters, only the allowed sign of a size.
_LITTLE = 1e-6


@dataclass(frozen=True)
class Scored:
    """An effect at its best shape, its score there, and the number of shapes tried."""

    model: EffectModel
    shape: Shape
    score: Score
    tried: int

    @property
    def p_value(self) -> float:
        """Probability of such a score at the best of the shapes tried when nothing is hidden."""
        return min(self.score.p_value * self.tried, 1.0)

    @property
    def statement(self) -> str:
        """The effect in words with its size, as if it were the only one."""
        return self.model.statement(self.shape, self.score.amplitude)


def scan(run: GaugeRun, found: Fit, library: Mapping[str, EffectModel], stated: Stated) -> list[Scored]:
    """Return the scores of the effects not yet in the fit, the most significant first."""
    known, there = {t.model.name for t in found.terms}, {(t.model.name, t.shape) for t in found.terms}
    models = [m for name, m in library.items() if name not in known or m.repeats]
    shapes = {m.name: [s for s in m.shapes(*span(run)) if (m.name, s) not in there] for m in models}
    many = [(m, s) for m in models if len(shapes[m.name]) > _MANY for s in shapes[m.name]]
    coarse = _best(thinned(run), found, many, stated, with_spread=False)
    asked = [(m, s) for m in models if len(shapes[m.name]) <= _MANY for s in shapes[m.name]]
    asked += [(c.model, s) for c in coarse for s in _near(c.shape, shapes[c.model.name])]
    once, choice = ([(m, s) for m, s in asked if (len(shapes[m.name]) == 1) == one] for one in (True, False))
    # The scatter of scores is estimated only at their best shapes: it takes longer than the scores
    # themselves.
    chosen = _best(run, found, choice, stated, with_spread=False)
    scored = _best(run, found, [*once, *((c.model, c.shape) for c in chosen)], stated)
    best = [replace(s, tried=len(shapes[s.model.name])) for s in scored]
    return sorted(best, key=lambda s: -s.score.statistic / max(len(s.score.amplitude), 1))


def thinned(run: GaugeRun) -> GaugeRun:
    """Return the run with a part of its measurements."""
    rings, edges = np.zeros(len(run.rings.uv), bool), np.zeros(len(run.edges.uv), bool)
    rings[::_THIN_RINGS], edges[::_THIN_EDGES] = True, True
    return replace(
        run, rings=run.rings.select(rings), edges=run.edges.select(edges), width_px=run.width_px[rings],
        ring_weight=run.ring_weight[rings], edge_weight=run.edge_weight[edges],
    )  # fmt: skip


def _best(
    run: GaugeRun, found: Fit, asked: Sequence[tuple[EffectModel, Shape]], stated: Stated,
    with_spread: bool = True,
) -> list[Scored]:  # fmt: skip
    """Return each effect with its best shape."""
    found = found if run.measures_as(found.run) else replace(found, run=run)
    best: dict[str, Scored] = {}
    for part in _portions(asked):
        here = evidence(run, found, part, with_spread=with_spread)[0]
        around = Around.of(here, stated, places_of_all(here, [(t.model, t.shape) for t in found.terms]))
        for model, shape in part:
            result = around.score(places_of(here, model, shape))
            if result is None or not _some_size_is_possible(model, shape, result.amplitude):
                continue
            if model.name not in best or result.statistic > best[model.name].score.statistic:
                best[model.name] = Scored(model, shape, result, 1)
    return list(best.values())


def _some_size_is_possible(model: EffectModel, shape: Shape, amplitude: Float) -> bool:
    """Return whether the effect can have this size, or a small one of the same sign.

    What suggests a negative exposure is no evidence for another exposure, however significant it is.
    """
    return model.possible(shape, amplitude) or model.possible(shape, _LITTLE * amplitude)


def _portions(asked: Sequence[tuple[EffectModel, Shape]]) -> list[list[tuple[EffectModel, Shape]]]:
    portions: list[list[tuple[EffectModel, Shape]]] = []
    count = _AT_ONCE
    for model, shape in asked:
        if count + len(model.amplitudes) > _AT_ONCE:
            portions.append([])
            count = 0
        portions[-1].append((model, shape))
        count += len(model.amplitudes)
    return portions


def _near(shape: Shape, shapes: Sequence[Shape]) -> list[Shape]:
    """Return shapes from the grid's neighbour on one side to the one on the other."""
    grid = np.array([s[0] for s in shapes])
    at = int(np.argmin(np.abs(grid - shape[0])))
    low, high = grid[max(at - 1, 0)], grid[min(at + 1, len(grid) - 1)]
    between = np.unique(np.concatenate([np.linspace(low, high, _REFINED), [shape[0]]]))
    return [(float(x), *shape[1:]) for x in between]


def span(run: GaugeRun) -> tuple[float, float]:
    """Return the run's duration in s and its frame rate."""
    duration = float(run.time_s[-1] - run.time_s[0])
    return duration, (len(run.time_s) - 1) / max(duration, 1e-9)


def freed(run: GaugeRun, found: Fit) -> Fit:
    """Return the same fit with continuous shapes as amplitudes, within the searched range.

    A drift faster than all that were searched is treated as a constant.
    """
    terms = tuple(_freed(run, t) for t in found.terms)
    return replace(found, terms=terms) if any(t.bounds is not None for t in terms) else found


def refined(run: GaugeRun, found: Fit) -> Fit:
    """Return the fit with times of steps and continuous shapes optimised, unless it then fits worse."""
    found = retimed(run, found)
    free = freed(run, found)
    if free is found:
        return found
    better = fit(run, found.state, free.terms)
    bound = fit(run, better.state, tuple(Term(t.model, *t.at(t.amplitude)) for t in better.terms), 1)
    return bound if bound.cost < found.cost else found


def _freed(run: GaugeRun, term: Term) -> Term:
    if term.model.shape_step(term.shape) is None or term.bounds is not None:
        return term
    searched = [shape[0] for shape in term.model.shapes(*span(run))]
    return replace(term, amplitude=np.append(term.amplitude, 0.0), bounds=(min(searched), max(searched)))


def retimed(run: GaugeRun, found: Fit) -> Fit:
    """Return the fit with every step at the best time between two frames, unless it then fits worse."""
    for k, term in enumerate(found.terms):
        if term.model.kind is not CourseKind.STEP:
            continue
        time_s, gain = _gains(run, found, k)
        # Between two rings every moment fits equally well: the middle stands for all of them.
        peaks, _ = label(gain > gain.max() - _AS_GOOD)
        best = replace(term, shape=(float(np.median(time_s[peaks == peaks[gain.argmax()]])),))
        if best.shape == term.shape:
            continue
        moved = fit(run, found.state, (*found.terms[:k], best, *found.terms[k + 1 :]), _ITERATIONS)
        found = moved if moved.cost < found.cost else found
    return found


def change_time(run: GaugeRun, found: Fit, place: int, inflation: float) -> Value:
    """Return the time of the step of term ``place``, s, with 1 σ, for a uniform prior.

    Parameters
    ----------
    inflation : float
        Number of measurements with correlated errors that count as one.
    """
    time_s, gain = _gains(run, found, place)
    chance = np.exp(0.5 * (gain - gain.max()) / inflation)
    chance /= chance.sum()
    middle = float(chance @ time_s)
    # Within the gap between two frames, every moment is equally likely.
    within = float(np.median(np.diff(run.time_s))) ** 2 / 12
    return Value(middle, float(np.sqrt(chance @ (time_s - middle) ** 2 + within)))


def _gains(run: GaugeRun, found: Fit, place: int) -> tuple[Float, Float]:
    """Return times (T,) midway between frames, and the drop of χ² with the step there."""
    term, others = found.terms[place], found.terms[:place] + found.terms[place + 1 :]
    time_s = _times_between(run)
    reduced = fit(run, found.state, others, _ITERATIONS)
    asked: list[tuple[EffectModel, tuple[float, ...]]] = [(term.model, (float(t),)) for t in time_s]
    about = evidence(run, reduced, asked, with_spread=False)[0]
    stated = stated_belief(found.state.stated)
    around = Around.of(about, stated, places_of_all(about, [(t.model, t.shape) for t in others]))
    each = [around.score(places_of(about, m, s)) for m, s in asked]
    return time_s, np.array([0.0 if one is None else one.gain for one in each])


def _times_between(run: GaugeRun) -> Float:
    """Return the times midway between frames, from the first frame on.

    All of the run: frames in which poses follow the effect, as at a change of bore, part two peaks.
    """
    return np.asarray(run.time_s[:-1] + np.diff(run.time_s) / 2 - run.time_s[0])
