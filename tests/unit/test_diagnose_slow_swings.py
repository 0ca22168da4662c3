"""Courses that a run hardly shows: a swing of less than two periods, and a fast drift."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.physics.effect import CourseKind
from stages.diagnose.effects.base import EffectModel
from stages.diagnose.effects.courses import Coursed
from stages.diagnose.effects.library import LIBRARY
from stages.diagnose.gauge.run import Term
from stages.diagnose.gauge.unknown_laws import odds_of_steady, odds_of_unseen_course, steady_term
from stages.diagnose.inference import Column, Evidence, Stated

ROCKING = LIBRARY["laser_rocking"]
SWINGING_TILT = Coursed(LIBRARY["laser_tilt"], (), CourseKind.SINUSOID)


@pytest.mark.parametrize("model", [ROCKING, SWINGING_TILT])
def test_a_swing_seen_for_one_period_is_no_surer_than_another_slow_course(model: EffectModel) -> None:
    """A sheet that hung to one side of the pipe while the probe rolled was named as a rocking one."""
    amplitude = np.ones(len(model.amplitudes))
    once, often = (Term(model, (frequency,), amplitude) for frequency in (0.15, 0.9))
    assert odds_of_unseen_course(once, 6.6) == 1.0
    assert odds_of_unseen_course(often, 6.6) == 0.0


def test_an_effect_that_does_not_swing_has_no_period() -> None:
    tilt = LIBRARY["laser_tilt"]
    assert odds_of_unseen_course(Term(tilt, (), np.ones(len(tilt.amplitudes))), 6.6) == 0.0


def drifting(model: EffectModel, drift: float, constant: float) -> tuple[Evidence, Term]:
    """Return evidence of 90 rings that a drift of .8 s and its law as a constant shift, and the drift."""
    term = Term(model, (0.8,), np.full(len(model.amplitudes), drift + constant))
    steady = steady_term(term)
    assert steady is not None
    time_s = np.linspace(0, 7.9, 90)
    course = np.stack([1 - np.exp(-time_s / 0.8), np.ones(90)], 1)
    size, wide = len(model.amplitudes), np.array([model.amplitudes[0].plausible])
    design = np.kron(course, np.eye(size)) / (0.5 * wide)
    measured = design @ np.repeat([drift, constant], size) * wide
    columns = tuple(Column(t.model.name, a.name, t.shape) for t in (term, steady) for a in t.model.amplitudes)
    information = design.T @ design
    free = np.full(2 * size, np.inf)
    right, misfit = design.T @ measured, float(measured @ measured)
    return Evidence(columns, information, right, information, misfit, free), term


@pytest.mark.parametrize(
    "model", [LIBRARY["centre_drift"], Coursed(LIBRARY["laser_cone"], (), CourseKind.EXPONENTIAL)]
)
def test_a_fast_drift_competes_with_its_law_as_a_constant_effect_even_if_the_library_lacks_that(
    model: EffectModel,
) -> None:
    """A shifted optical axis that the library lacked was named a drift of .8 s in a run of 7.9, at .9995."""
    stated = Stated((), np.zeros((0, 0)))
    odds = []
    for drift, constant in ((1.0, 0.0), (0.0, 1.0)):
        about, term = drifting(model, drift, constant)
        odds.append(odds_of_steady(about, [term], term, steady_term(term), lambda terms: 0.0, stated))
    assert odds[0] < 1e-3
    assert odds[1] > 1.0


def test_only_a_drift_has_a_constant_rival() -> None:
    tilt = LIBRARY["laser_tilt"]
    assert steady_term(Term(tilt, (), np.ones(2))) is None
    assert steady_term(Term(ROCKING, (0.9,), np.ones(4))) is None
