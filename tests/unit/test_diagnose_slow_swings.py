"""Courses that a run hardly shows: a swing of less than two periods, and a drift as fast as any searched."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.physics.effect import CourseKind
from stages.diagnose.effects.base import EffectModel
from stages.diagnose.effects.courses import Coursed
from stages.diagnose.effects.library import LIBRARY
from stages.diagnose.gauge.run import Term
from stages.diagnose.gauge.unknown_laws import odds_of_unseen_course

ROCKING = LIBRARY["laser_rocking"]
SWINGING_TILT = Coursed(LIBRARY["laser_tilt"], (), CourseKind.SINUSOID)


@pytest.mark.parametrize("model", [ROCKING, SWINGING_TILT])
def test_a_swing_seen_for_one_period_is_no_surer_than_another_slow_course(model: EffectModel) -> None:
    """A sheet that hung to one side of the pipe while the probe rolled was named as a rocking one."""
    amplitude = np.ones(len(model.amplitudes))
    once, often = (Term(model, (frequency,), amplitude) for frequency in (0.15, 0.9))
    assert odds_of_unseen_course(once, 6.6, 15.0) == 1.0
    assert odds_of_unseen_course(often, 6.6, 15.0) == 0.0


def test_an_effect_that_does_not_swing_has_no_period() -> None:
    tilt = LIBRARY["laser_tilt"]
    assert odds_of_unseen_course(Term(tilt, (), np.ones(len(tilt.amplitudes))), 6.6, 15.0) == 0.0


@pytest.mark.parametrize(
    "model", [LIBRARY["centre_drift"], Coursed(LIBRARY["laser_cone"], (), CourseKind.EXPONENTIAL)]
)
def test_a_drift_as_fast_as_any_that_is_searched_is_no_surer_than_a_constant_effect(
    model: EffectModel,
) -> None:
    """A shifted optical axis that the library lacked was named a drift of .8 s in a run of 7.9, at .9995."""
    amplitude = np.ones(len(model.amplitudes))
    fastest, nearly, slower = (Term(model, (time_s,), amplitude) for time_s in (0.79, 0.85, 1.2))
    assert odds_of_unseen_course(fastest, 7.9, 15.0) == 1.0
    assert odds_of_unseen_course(nearly, 7.9, 15.0) == 1.0
    assert odds_of_unseen_course(slower, 7.9, 15.0) == 0.0
