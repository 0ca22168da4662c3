"""Channels are combined into one answer: a name needs agreement of a second, independent estimate."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from pipeline.api.diagnosis.report import headline
from pipeline.instrument.probe import Probe
from stages.diagnose.combine.compose import unexamined
from stages.diagnose.combine.shown import verdict_of_rings
from stages.diagnose.correct import encoder_effects
from stages.diagnose.gauge.answer import rocking_excluded
from stages.diagnose.gauge.examine import Examined
from stages.diagnose.result import FitQuality, Location, Verdict
from stages.diagnose.travel.events import with_events
from tests.diagnosed import AGREES, DIFFERS, PLAY, SCALE, SLIP, SWING, answer, of_gauge, seen
from tests.travel_cases import read
from tests.travel_cases import seen as sight


def test_one_estimate_in_one_recording_gives_a_class(real_probe: Probe) -> None:
    found = of_gauge(real_probe, estimates=(SCALE,))
    assert found.verdict is Verdict.CLASS
    assert "encoder_scale" in found.members
    assert found.effects[0].probability < 0.95


def test_two_agreeing_parts_of_one_recording_give_a_name(real_probe: Probe) -> None:
    found = of_gauge(real_probe, estimates=(replace(SCALE, agreements=(AGREES,)),))
    assert found.verdict is Verdict.NAMED
    assert found.effects[0].confirmed_by == (AGREES.confirmation,)
    assert 0.95 < found.effects[0].probability < 0.99


def test_beside_a_bore_that_is_not_as_drawn_a_name_is_not_the_whole_answer(real_probe: Probe) -> None:
    """Rings and fiducials deviate, by the bore or by an effect that fits as well; it was "named"."""
    sure = seen("gauge", estimates=(replace(SCALE, agreements=(AGREES,)),))
    found = answer(real_probe, None, replace(sure, misdrawn=True))
    assert found.verdict is Verdict.PARTLY
    assert found.remainder is not None
    assert found.remainder.verdict is Verdict.UNEXPLAINED
    assert found.record_next.startswith("Measure the gauge's bores")
    assert answer(real_probe, None, replace(seen("gauge"), misdrawn=True)).verdict is Verdict.NOT_IDENTIFIABLE


def test_an_effect_with_a_residual_or_another_possible_course_is_not_named(real_probe: Probe) -> None:
    sure = replace(SCALE, agreements=(AGREES,))
    unsure = of_gauge(real_probe, estimates=(replace(sure, other_courses=0.2),))
    assert unsure.verdict is Verdict.CLASS
    assert "depends on distance or speed in another way" in unsure.identifiable
    assert "in another way" not in of_gauge(real_probe, estimates=(SCALE,)).identifiable
    encoder = read(delay_s=0.06)
    wrong = with_events(sight(np.random.default_rng(8)), encoder, ("time_offset", "encoder_slip"))
    found = of_gauge(real_probe, estimates=(sure,), fit=wrong)
    assert found.verdict is Verdict.CLASS
    assert found.effects[0].probability < 0.9


def test_parts_that_contradict_each_other_give_no_name(real_probe: Probe) -> None:
    found = of_gauge(real_probe, estimates=(replace(PLAY, agreements=(AGREES, DIFFERS)),))
    assert found.verdict is Verdict.CLASS
    assert set(found.members) == {"encoder_backlash", "time_offset"}
    assert found.effects[0].probability < 1e-6


def test_agreeing_estimates_in_both_recordings_give_a_name(real_probe: Probe) -> None:
    both = (seen(source, estimates=(SCALE,)) for source in ("field", "gauge"))
    found = answer(real_probe, *both)
    assert found.verdict is Verdict.NAMED
    (one,) = found.effects
    assert one.name == "encoder_scale"
    assert [c.agrees for c in one.confirmed_by] == [True]


@pytest.mark.parametrize("other", [-0.02, 0.03])
def test_another_size_in_the_other_recording_does_not_confirm(real_probe: Probe, other: float) -> None:
    there = replace(SCALE, value=other)
    found = answer(real_probe, seen("field", estimates=(there,)), seen("gauge", estimates=(SCALE,)))
    assert found.verdict is Verdict.CLASS
    assert found.effects[0].probability < 0.1


def test_an_effect_that_the_other_recording_should_show_but_does_not_is_not_named(real_probe: Probe) -> None:
    sure = replace(PLAY, agreements=(AGREES,))
    none = replace(PLAY, value=0.01, p_value=0.7)
    found = answer(real_probe, seen("field", estimates=(none,)), seen("gauge", estimates=(sure,)))
    assert found.verdict is Verdict.CLASS
    blind = replace(none, sigma=float("inf"))
    found = answer(real_probe, seen("field", estimates=(blind,)), seen("gauge", estimates=(sure,)))
    assert found.verdict is Verdict.NAMED


def test_a_rival_that_one_recording_excludes_is_excluded(real_probe: Probe) -> None:
    doubted = replace(SCALE, alike=(("baseline", 1.0),))
    alone = answer(real_probe, seen("field", estimates=(doubted,)), None)
    assert {"baseline", "encoder_scale"} <= set(alone.members)
    assert alone.effects[0].probability < 0.5
    both = answer(real_probe, seen("field", estimates=(doubted,)), seen("gauge", estimates=(SCALE,)))
    assert both.verdict is Verdict.NAMED


def test_an_uncertain_claim_and_its_rivals_have_probabilities_on_the_page(real_probe: Probe) -> None:
    doubted = replace(SCALE, alike=(("baseline", 1.0),))
    alone = answer(real_probe, seen("field", estimates=(doubted,)), None)
    chance = alone.effects[0].probability
    assert {c.name: c.probability for c in alone.causes.laws} == {"encoder_scale": chance, "baseline": chance}
    assert alone.causes.laws[-1].courses[0].statement == SCALE.statement


def test_a_slip_is_named_only_if_the_encoder_reading_alone_shows_it_too(real_probe: Probe) -> None:
    alone = of_gauge(real_probe, slips=(SLIP,))
    assert alone.verdict is Verdict.CLASS
    assert alone.members == ("encoder_slip",)
    again = of_gauge(real_probe, slips=(replace(SLIP, agreements=(AGREES,)),))
    assert again.verdict is Verdict.NAMED


def test_a_sure_effect_is_named_though_a_residual_remains(real_probe: Probe) -> None:
    sure = replace(PLAY, agreements=(AGREES,))
    found = of_gauge(real_probe, estimates=(sure, SCALE))
    assert found.verdict is Verdict.PARTLY
    assert [e.name for e in found.effects] == ["encoder_backlash"]
    assert found.remainder is not None
    assert found.remainder.verdict is Verdict.CLASS
    assert "encoder_scale" in found.remainder.members
    assert found.identifiable.startswith(SCALE.statement.rstrip("."))
    assert PLAY.statement.rstrip(".") not in found.identifiable
    assert found.members == ()
    assert "encoder_scale" in found.record_next


def test_a_sure_effect_is_named_beside_one_missing_from_the_library(real_probe: Probe) -> None:
    sure = replace(PLAY, agreements=(AGREES,))
    found = answer(real_probe, None, seen("gauge", estimates=(sure, SCALE)), "encoder_scale")
    assert found.verdict is Verdict.PARTLY
    assert found.remainder is not None
    assert found.remainder.verdict is Verdict.UNEXPLAINED
    assert found.remainder.members == ()


def test_a_slip_in_the_gauge_run_is_not_one_of_the_inspection(real_probe: Probe) -> None:
    sure = replace(SLIP, agreements=(AGREES,))
    of_both = answer(
        real_probe,
        seen("field", slips=(replace(sure, gain_mm=3.0, p_value=1e-8),)),
        seen("gauge", slips=(sure,)),
    )
    assert of_both.effects[0].parameters["slip_mm"].value == 3.0
    assert encoder_effects(of_both.effects) == of_both.effects
    assert encoder_effects(of_gauge(real_probe, slips=(sure,)).effects) == ()


def test_a_slip_of_another_recording_confirms_nothing(real_probe: Probe) -> None:
    found = answer(real_probe, seen("field", slips=(SLIP,)), seen("gauge", slips=(SLIP,)))
    assert found.verdict is Verdict.CLASS


def test_an_effect_missing_from_the_library_is_found_but_not_named(real_probe: Probe) -> None:
    both = (seen(source, estimates=(SCALE,)) for source in ("field", "gauge"))
    found = answer(real_probe, *both, "encoder_scale")
    assert found.verdict is Verdict.UNEXPLAINED
    assert found.effects == ()
    assert found.location is not None
    assert (found.location.channel, found.location.fixed_to) == ("motion", "pipe")


def test_a_deviation_within_the_stated_uncertainty_is_not_a_finding(real_probe: Probe) -> None:
    found = of_gauge(real_probe, estimates=(replace(SCALE, p_value=0.2),))
    assert found.verdict is Verdict.NOT_IDENTIFIABLE
    assert found.effects == ()


def test_a_course_that_fits_speed_and_reversals_equally_is_not_placed_in_time(real_probe: Probe) -> None:
    doubted = replace(PLAY, alike=(("time_offset", 0.99),), agreements=(AGREES,))
    found = of_gauge(real_probe, estimates=(doubted,))
    assert found.verdict is Verdict.CLASS
    assert found.location is not None
    assert found.location.time is None
    clear = of_gauge(real_probe, estimates=(replace(PLAY, agreements=(AGREES,)),))
    assert clear.location is not None
    assert clear.location.time == "reversal"


def geometry(detectable_mrad: float, *suspected: str) -> Any:
    """Return rings of a 40 mm bore, sheet 20 mm ahead: 1 mrad of tilt looks like 0.08 mm off the axis."""
    laser = SimpleNamespace(baseline_mm=20.0)
    rings = SimpleNamespace(radius_mm=np.array([40.0]), probe=SimpleNamespace(laser=laser))
    searched = SimpleNamespace(nothing=SimpleNamespace(linearised=SimpleNamespace(rings=rings)))
    terms = tuple(SimpleNamespace(model=SimpleNamespace(law=law)) for law in suspected)
    verdicts = SimpleNamespace(sets=((0.6, terms),))
    table = (SimpleNamespace(name="laser_rocking", detectable=detectable_mrad),)
    return SimpleNamespace(searched=searched, verdicts=verdicts, feasibility=table)


@pytest.mark.parametrize(
    ("of", "excluded"),
    [
        (geometry(1.0), True),
        (geometry(5.0), False),
        (geometry(1.0, "laser_rocking"), False),
        (geometry(1.0, "laser_tilt"), True),
        (None, False),
    ],
)
def test_a_rocking_sheet_that_rings_would_show_is_excluded(of: Any, excluded: bool) -> None:
    assert rocking_excluded(cast(Any, of), SWING.amplitude_mm) is excluded


def test_a_swing_that_a_rocking_sheet_may_also_cause_is_a_class(real_probe: Probe) -> None:
    found = of_gauge(real_probe, lines=(SWING,))
    assert found.verdict is Verdict.CLASS
    assert set(found.members) == {"probe_vibration", "laser_rocking"}
    lit = replace(SWING, lit_mm=0.3, share_sigma_mm=0.003)
    assert of_gauge(real_probe, lines=(lit,)).verdict is Verdict.NAMED


@pytest.mark.parametrize(
    ("names", "claimed", "verdict"),
    [
        ((), True, Verdict.CONSISTENT),
        ((), False, Verdict.UNEXPLAINED),
        (("a pattern",), True, Verdict.UNEXPLAINED),
    ],
)
def test_ring_residuals_without_a_pattern_are_attributed_to_the_effect_found_in_motion(
    names: tuple[str, ...], claimed: bool, verdict: Verdict
) -> None:
    best = SimpleNamespace(named=False, names=names, library_terms=())
    rings = SimpleNamespace(best=best, verdicts=SimpleNamespace(adequacy=0.5), confirmed=())
    own = [cast(Any, SimpleNamespace(location=Location("motion", None, None)))] * claimed
    assert verdict_of_rings(cast(Any, rings), own) is verdict


@pytest.mark.parametrize("slipped_in", ["field", "gauge"])
def test_a_repeated_residual_in_the_gauge_run_is_reported_beside_a_slip_in_either_recording(
    real_probe: Probe, slipped_in: str
) -> None:
    """A slip of the inspection was named.

    A residual of .28 px in the gauge run, noise .13, was not reported.
    """
    searched = cast(Any, SimpleNamespace(by_chance=0.5))
    where = Location("ring", "camera", None)
    quality = FitQuality("px", 0.31, 0.3, 0.29, 0.284, 0.126)
    rings = Examined(searched, None, (), (), quality=quality, location=where)
    sure = replace(SLIP, agreements=(AGREES,))
    field, gauge = (seen(n, slips=(sure,) * (n == slipped_in)) for n in ("field", "gauge"))
    found = answer(real_probe, field, replace(gauge, geometry=rings))
    assert found.verdict is Verdict.PARTLY
    assert [e.name for e in found.effects] == ["encoder_slip"]
    assert found.remainder is not None
    assert found.remainder.verdict is Verdict.UNEXPLAINED
    assert found.remainder.location == where
    assert "0.28 px" in found.identifiable
    assert answer(
        real_probe, replace(field, travel=None), replace(gauge, geometry=rings, travel=None)
    ).verdict is (Verdict.UNEXPLAINED)


def test_what_was_not_examined_is_said_beside_the_name(real_probe: Probe) -> None:
    """A tilt was "named" without a word in the verdict that the line's profile had not been examined."""
    found = of_gauge(real_probe, estimates=(replace(SCALE, agreements=(AGREES,)),))
    assert found.verdict is Verdict.NAMED
    assert found.unexamined == ("the line's profile of toy", "rings and fiducials of toy")
    assert headline(found) == (
        "Left out: encoder scale (not examined: the line's profile of toy, rings and fiducials of toy)"
    )
    known = replace(seen("gauge"), misdrawn=True, profile=cast(Any, SimpleNamespace(unexplained=None)))
    assert unexamined(known) == ()
