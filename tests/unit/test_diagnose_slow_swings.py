"""A swing of which a run shows less than two periods may be any slow course; a faster one may not."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.physics.effect import CourseKind
from stages.diagnose.effects.base import EffectModel
from stages.diagnose.effects.courses import Coursed
from stages.diagnose.effects.library import LIBRARY
from stages.diagnose.gauge.run import Term
from stages.diagnose.gauge.unknown_laws import odds_of_slow_course

ROCKING = LIBRARY["laser_rocking"]
SWINGING_TILT = Coursed(LIBRARY["laser_tilt"], (), CourseKind.SINUSOID)


@pytest.mark.parametrize("model", [ROCKING, SWINGING_TILT])
def test_a_swing_seen_for_one_period_is_no_surer_than_another_slow_course(model: EffectModel) -> None:
    """A sheet that hung to one side of the pipe while the probe rolled was named as a rocking one."""
    amplitude = np.ones(len(model.amplitudes))
    once, often = (Term(model, (frequency,), amplitude) for frequency in (0.15, 0.9))
    assert odds_of_slow_course(once, 6.6) == 1.0
    assert odds_of_slow_course(often, 6.6) == 0.0


def test_an_effect_that_does_not_swing_has_no_period() -> None:
    tilt = LIBRARY["laser_tilt"]
    assert odds_of_slow_course(Term(tilt, (), np.ones(len(tilt.amplitudes))), 6.6) == 0.0
