"""What could be named at best: the probability of each true name about the truth, for exact measurements.

The truth's effects are fitted to the run, and the measurements replaced by what they predict. All sets of
the library near them are then weighed as the diagnosis weighs them, and unknown laws as well; only the
search, the tests of what was found, and the margin for errors of laws are left out. No answer is read.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from pipeline.arrays import Float
from pipeline.physics.effect import CourseKind
from pipeline.simulator.effects.switch import Switch
from stages.diagnose.effects.base import EffectModel
from stages.diagnose.effects.courses import with_courses
from stages.diagnose.gauge.fit import Fit, evidence, fit
from stages.diagnose.gauge.hypotheses import judged_of, regimes_of
from stages.diagnose.gauge.run import GaugeRun, Term
from stages.diagnose.gauge.scan import refined, scan, span
from stages.diagnose.gauge.search import MOST_EFFECTS, Search
from stages.diagnose.gauge.sets import Set, Sets, cause_of, members_of
from stages.diagnose.gauge.unknown_laws import odds_of_unknown_laws
from stages.diagnose.inference import Evidence, Stated, places_of

# Quantities that are the shape of a model.
_SHAPES = ("order", "time_s", "frequency_hz")


def ideal_chances(
    switches: Sequence[Switch], searched: Search, library: Mapping[str, EffectModel], stated: Stated
) -> list[float | None]:
    """Return the probability of each concealed name; None for what rings and fiducials do not show."""
    run = searched.run
    each = [concealed_term(run, s, library) for s in switches]
    terms = [t for t in each if t is not None]
    if not terms:
        return [None] * len(each)
    found = refined(run, fit(run, searched.nothing.state, terms))
    coursed = with_courses(library)
    known = _chances(run, found, coursed, stated, searched.inflation)
    judged = judged_of(run, found, regimes_of(run), stated, searched.inflation)
    unknown = odds_of_unknown_laws(run, judged, stated, searched.inflation, coursed)
    told = iter([float(p / (1 + p * u.odds)) for p, u in zip(known, unknown, strict=True)])
    return [None if t is None else next(told) for t in each]


def concealed_term(run: GaugeRun, switch: Switch, library: Mapping[str, EffectModel]) -> Term | None:
    """Return a concealed effect at the searched shape nearest to its own, with size zero."""
    model = library.get(switch.name)
    if model is None or switch.course.kind is not CourseKind.CONSTANT:
        return None
    size, true, (_, rate_hz) = np.ones(len(model.amplitudes)), dict(switch.quantities), span(run)
    if "frequency_hz" in true:
        # Frames show the lowest alias.
        true["frequency_hz"] = abs(true["frequency_hz"] - rate_hz * round(true["frequency_hz"] / rate_hz))

    def apart(shape: tuple[float, ...]) -> float:
        given = model.quantities(shape, size)
        return sum(abs(given[n] - true[n]) for n in _SHAPES if n in given and n in true)

    return Term(model, min(model.shapes(*span(run)), key=apart), 0 * size)


def _chances(
    run: GaugeRun, found: Fit, library: Mapping[str, EffectModel], stated: Stated, inflation: float
) -> list[float]:
    """Return the probability of each of the truth's causes among the sets of the library near it."""
    members = members_of(
        run, found, scan(run, found, library, stated), len({m.law for m in library.values()})
    )
    own = {(t.model, t.shape) for t in found.terms}
    asked = [(m.model, m.shape) for m in members if (m.model, m.shape) not in own]
    about = _without_noise(evidence(run, found, asked, with_spread=False)[0], found)
    sets = Sets.of(about, members, stated, inflation)
    sets = sets.without_describing_patterns(sets.set_of(found))
    deviance = sets.likely([sets.set_of(found)], MOST_EFFECTS)
    weight = np.exp(-0.5 * (np.array(list(deviance.values())) - min(deviance.values())))
    return [float(weight @ _held(sets, list(deviance), t) / weight.sum()) for t in found.terms]


def _held(sets: Sets, chosen: Sequence[Set], term: Term) -> Float:
    """Return 1 for each set that has a term's cause, else 0."""
    cause, each = cause_of(term.model, term.shape), [cause_of(m.model, m.shape) for m in sets.members]
    return np.array([any(each[k] == cause for k in one) for one in chosen], float)


def _without_noise(about: Evidence, truth: Fit) -> Evidence:
    """Return the evidence if the measurements were as the truth predicts."""
    value = np.zeros(len(about.columns))
    for t in truth.terms:
        value[places_of(about, t.model, t.shape)] = t.amplitude
    right = about.information @ value
    return replace(about, right=right, misfit=float(value @ right))
