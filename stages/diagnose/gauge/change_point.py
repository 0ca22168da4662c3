"""When a step came: the chance of every time between two frames near the best one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.arrays import Float
from pipeline.physics.effect import CourseKind
from stages.diagnose.effects.base import EffectModel
from stages.diagnose.gauge.fit import Fit, evidence, fit
from stages.diagnose.gauge.run import GaugeRun, Term
from stages.diagnose.inference import places_of, score, stated_belief
from stages.diagnose.result import Value

_ITERATIONS = 3
# A drop of χ² that one free number makes by chance two times in three.
_AS_GOOD = 1.0
# The search of steps may have come out one cell beside the best one.
_CELLS = 2


def retimed(run: GaugeRun, found: Fit) -> Fit:
    """Return the fit with every step at the best time between two frames, unless it then fits worse."""
    for k, term in enumerate(found.terms):
        if term.model.kind is not CourseKind.STEP:
            continue
        time_s, gain = _gains(run, found, k)
        # Between two rings every moment does as well: the middle of those stands for them.
        best = replace(term, shape=(float(np.median(time_s[gain > gain.max() - _AS_GOOD])),))
        if best.shape == term.shape:
            continue
        moved = fit(run, found.state, (*found.terms[:k], best, *found.terms[k + 1 :]), _ITERATIONS)
        found = moved if moved.cost < found.cost else found
    return found


def change_time(run: GaugeRun, found: Fit, place: int, alike: float) -> Value:
    """Return when the step of term ``place`` came, with 1 σ over times that are equally likely beforehand.

    Parameters
    ----------
    alike : float
        How many measurements that err alike count as one.
    """
    time_s, gain = _gains(run, found, place)
    chance = np.exp(0.5 * (gain - gain.max()) / alike)
    chance /= chance.sum()
    middle = float(chance @ time_s)
    # Within the gap between two frames every moment is as likely as another.
    within = float(np.median(np.diff(run.time_s))) ** 2 / 12
    return Value(middle, float(np.sqrt(chance @ (time_s - middle) ** 2 + within)))


def _gains(run: GaugeRun, found: Fit, place: int) -> tuple[Float, Float]:
    """Return times (T,) in the middle between frames, and the drop of χ² with the step there."""
    term, others = found.terms[place], found.terms[:place] + found.terms[place + 1 :]
    time_s = _near(run, term)
    reduced = fit(run, found.state, others, _ITERATIONS)
    asked: list[tuple[EffectModel, tuple[float, ...]]] = [(term.model, (float(t),)) for t in time_s]
    about = evidence(run, reduced, asked)[0]
    stated = stated_belief(found.state.stated)
    given = [places_of(about, t.model, t.shape) for t in others]
    free = np.concatenate([np.zeros(0, np.int64), *given]).astype(np.int64)
    each = [score(about, stated, places_of(about, m, s), free) for m, s in asked]
    return time_s, np.array([0.0 if one is None else one.gain for one in each])


def _near(run: GaugeRun, term: Term) -> Float:
    """Return the middles between frames within two cells of the grid that steps are searched on, about it."""
    duration = float(run.time_s[-1] - run.time_s[0])
    grid = [s[0] for s in term.model.shapes(duration, len(run.time_s) / duration)]
    middle = run.time_s[:-1] + np.diff(run.time_s) / 2 - run.time_s[0]
    near = middle[np.abs(middle - term.shape[0]) <= _CELLS * (grid[1] - grid[0])]
    return near if len(near) else np.array(term.shape)
