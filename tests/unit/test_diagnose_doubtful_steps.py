"""A slip that misplaced pictures may also explain, and residuals of the encoder.

They are reported, but never named.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.instrument.probe import Probe
from stages.diagnose.result import Verdict
from stages.diagnose.travel.events import with_events
from stages.diagnose.travel.evidence import TravelEvidence, _estimates
from stages.diagnose.travel.left_over import LeftOver
from stages.diagnose.travel.model import EventKind
from stages.diagnose.travel.steps import steps_found
from tests.diagnosed import AGREES, SCALE, SLIP, answer, of_gauge, seen
from tests.travel_cases import read
from tests.travel_cases import seen as sight

DOUBTFUL = replace(SLIP, rivals=(EventKind.OUTLIER,), stray=3)
LEFT = LeftOver(1.36, (90, 119), (6.0, 7.93), 1e-20, 30, False)
MAY_SLIP = replace(LEFT, where=(117, 119), stray=3, by_slip=True)


def test_a_step_that_misplaced_pictures_may_explain_is_reported_as_both_and_never_named(
    real_probe: Probe,
) -> None:
    found = of_gauge(real_probe, doubtful=(replace(DOUBTFUL, agreements=(AGREES,)),))
    assert found.verdict is Verdict.CLASS
    assert found.members == ("encoder_slip",)
    assert found.effects == ()
    assert (
        "At 1.30 s the reading gains +2.00 mm: a slip of the wheel, or 3 misplaced pictures"
        in found.identifiable
    )
    assert "record the passage again, slowly" in found.identifiable
    assert found.global_p <= 1e-20


def test_a_doubtful_step_that_may_be_chance_is_not_reported(real_probe: Probe) -> None:
    found = of_gauge(real_probe, doubtful=(replace(DOUBTFUL, p_value=1e-4),))
    assert found.members == ()
    assert found.identifiable == ""


def test_doubtful_steps_in_two_recordings_are_both_reported_and_confirm_nothing(real_probe: Probe) -> None:
    there = replace(DOUBTFUL, time_s=2.5, gain_mm=-1.0)
    found = answer(real_probe, seen("field", doubtful=(there,)), seen("gauge", doubtful=(DOUBTFUL,)))
    assert found.verdict is Verdict.CLASS
    assert found.members == ("encoder_slip",)
    assert "At 2.50 s the reading gains -1.00 mm" in found.identifiable
    assert "At 1.30 s the reading gains +2.00 mm" in found.identifiable


def test_several_doubtful_steps_of_one_recording_may_have_another_cause(real_probe: Probe) -> None:
    """A delay missing from the library looks like two steps of opposite sign where the probe turns back."""
    back = replace(DOUBTFUL, time_s=2.5, gain_mm=-2.0)
    found = of_gauge(real_probe, doubtful=(DOUBTFUL, back))
    assert found.verdict is Verdict.UNEXPLAINED
    assert found.effects == ()
    assert "gains +2.00 mm" in found.identifiable
    assert "gains -2.00 mm" in found.identifiable


def test_a_doubtful_step_beside_an_unexplained_residual_is_not_a_class_of_slips(real_probe: Probe) -> None:
    found = of_gauge(real_probe, doubtful=(DOUBTFUL,), unexplained=LEFT)
    assert found.verdict is Verdict.UNEXPLAINED
    assert found.members == ()
    assert "gains +2.00 mm" in found.identifiable
    assert "+1.36 mm in a way that no effect" in found.identifiable
    by_slips = of_gauge(real_probe, doubtful=(DOUBTFUL,), unexplained=MAY_SLIP)
    assert by_slips.members == ("encoder_slip",)


def test_beside_a_doubtful_slip_a_scale_keeps_its_size_but_no_sure_name(real_probe: Probe) -> None:
    """Three misplaced pictures at the end may be a slip; the encoder's scale is 2 % off."""
    way, encoder = sight(np.random.default_rng(10), drift_mm=0.001), read(scale=0.02)
    distance_mm = way.distance_mm.copy()
    distance_mm[-3:] += 1.0
    fit = with_events(replace(way, distance_mm=distance_mm), encoder)
    estimates = _estimates("gauge", fit, 0.002, 0.05)
    of_scale = next(e for e in estimates if e.effect == "encoder_scale")
    assert of_scale.value == pytest.approx(0.02, abs=4 * of_scale.sigma)
    steps = steps_found(fit, encoder)
    assert [s.doubt != "" for s in steps] == [True]
    sure = of_gauge(real_probe, estimates=estimates, fit=fit)
    found = of_gauge(real_probe, estimates=estimates, fit=fit, doubtful=steps)
    assert sure.verdict is Verdict.NAMED
    assert found.verdict is Verdict.CLASS
    assert {"encoder_scale", "encoder_slip"} <= set(found.members)
    (of_it,) = found.effects
    assert of_it.parameters == sure.effects[0].parameters
    assert 0.3 < of_it.probability < 0.55


def test_beside_a_doubtful_step_a_name_is_unsure_and_a_sure_slip_is_kept(real_probe: Probe) -> None:
    """The step is a column of the fit: the effect of misplaced pictures is one more doubt, not a bad fit."""
    elsewhere = replace(DOUBTFUL, time_s=6.0, place=90)
    sure = replace(SCALE, agreements=(AGREES,))
    both = {"doubtful": (DOUBTFUL, elsewhere)}
    for shown in ({"doubtful": (DOUBTFUL,)}, both, {"unexplained": LEFT}):
        (of_it,) = of_gauge(real_probe, estimates=(sure,), **shown).effects
        assert of_it.name == "encoder_scale"
        assert 0.45 < of_it.probability < 0.5
    slip = replace(SLIP, agreements=(AGREES,))
    beside = of_gauge(real_probe, slips=(slip,), doubtful=(elsewhere,))
    assert beside.verdict is Verdict.PARTLY
    assert [e.name for e in beside.effects] == ["encoder_slip"]
    assert 0.95 < beside.effects[0].probability < 0.99
    (once,) = of_gauge(real_probe, slips=(SLIP,), doubtful=(elsewhere,)).effects
    assert once.probability < 0.5


@pytest.mark.parametrize("source", ["field", "gauge"])
def test_a_residual_that_no_encoder_effect_explains_gets_no_name_and_makes_names_unsure(
    real_probe: Probe, source: str
) -> None:
    sure = (replace(SCALE, agreements=(AGREES,)),)
    recordings = {"field": None, "gauge": None, source: seen(source, unexplained=LEFT)}
    alone = answer(real_probe, **recordings)
    assert alone.verdict is Verdict.UNEXPLAINED
    assert alone.effects == ()
    assert "toy: Between 6.00 and 7.93 s the reading is off by +1.36 mm in a way" in alone.identifiable
    assert alone.location is not None
    assert alone.location.channel == "motion"
    assert alone.global_p == pytest.approx(1e-20)
    beside = answer(real_probe, **{**recordings, source: seen(source, unexplained=LEFT, estimates=sure)})
    assert beside.verdict is Verdict.CLASS
    assert [e.parameters["relative"].value for e in beside.effects] == [0.02]
    assert 0.45 < beside.effects[0].probability < 0.5
    assert "+1.36 mm in a way" in beside.identifiable


def test_a_residual_that_may_be_a_slip_is_a_class_if_the_library_has_slips(real_probe: Probe) -> None:
    found = of_gauge(real_probe, unexplained=MAY_SLIP)
    assert found.verdict is Verdict.CLASS
    assert found.members == ("encoder_slip",)
    assert "the wheel slipped, or 3 pictures in a row were misplaced" in found.identifiable
    unknown = answer(real_probe, None, seen("gauge", unexplained=LEFT), "encoder_slip")
    assert unknown.verdict is Verdict.UNEXPLAINED


def test_fitted_steps_and_a_reported_residual_do_not_count_again_as_noise() -> None:
    nothing = TravelEvidence("gauge", (), (), (), (), None, ())
    assert (nothing.fits_p, nothing.least_p) == (1.0, 1.0)
    for shown in ({"unexplained": LEFT}, {"doubtful": (DOUBTFUL,)}, {"slips": (SLIP,)}):
        some = replace(nothing, **shown)  # type: ignore[arg-type]
        assert (some.fits_p, some.least_p) == (1.0, 1e-20)
