"""Channels come to one answer: a name needs a second prediction that agrees, and a name that is known."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from pipeline.instrument.probe import Probe
from pipeline.instrument.probe_file import read_probe
from pipeline.physics.catalogue import effect
from stages.diagnose.agreement import Agreement
from stages.diagnose.channels import Seen
from stages.diagnose.compose import composed, verdict_of_rings
from stages.diagnose.correct import encoder_effects
from stages.diagnose.profile.evidence import Condition, ProfileEvidence
from stages.diagnose.profile.finding import Size, finding
from stages.diagnose.result import Confirmation, Diagnosis, Verdict
from stages.diagnose.rocking import rocking_excluded
from stages.diagnose.travel.events import with_events
from stages.diagnose.travel.evidence import TravelEstimate, TravelEvidence, _estimates
from stages.diagnose.travel.left_over import LeftOver
from stages.diagnose.travel.lines import Line
from stages.diagnose.travel.model import EventKind, TravelFit, fitted
from stages.diagnose.travel.steps import StepFound, steps_found
from tests.shared_data import PROJECT_ROOT
from tests.travel_cases import read
from tests.travel_cases import seen as sight

AGREES = Agreement(Confirmation("first half: 0.02", "second half: 0.02", True), 30.0)
DIFFERS = Agreement(Confirmation("first half: 0.02", "second half: -0.01", False), 1e-12)
SCALE = TravelEstimate("encoder_scale", "relative", 0.02, 0.0004, 0.002, 1e-12, 0.01, ())
PLAY = TravelEstimate("encoder_backlash", "backlash_mm", 1.0, 0.02, 0.02, 1e-30, 0.1, ())
SLIP = StepFound(40, 1.3, 0.02, 2.0, 0.05, 1e-20, (), 0.0)
SWING = Line(5.0, 0.3, 0.002, 20.0, 1e-12, float("nan"), 0.3, float("nan"), 0.01, (AGREES,))


@pytest.fixture
def real_probe() -> Probe:
    """The probe of the sample recording."""
    return read_probe(PROJECT_ROOT / "data" / "sample" / "probe.yaml")


def seen(source: str, **shown: object) -> Seen:
    travel = TravelEvidence(source, (), (), (), (), None, ())
    return Seen("toy", None, replace(travel, **shown), None, ())  # type: ignore[arg-type]


def answer(probe: Probe, field: Seen | None, gauge: Seen | None, *without: str) -> Diagnosis:
    return composed(field, gauge, probe, without)


def of_gauge(probe: Probe, **shown: object) -> Diagnosis:
    return answer(probe, None, seen("gauge", **shown))


def test_what_one_recording_shows_once_is_a_class(real_probe: Probe) -> None:
    found = of_gauge(real_probe, estimates=(SCALE,))
    assert found.verdict is Verdict.CLASS
    assert "encoder_scale" in found.members
    assert found.effects[0].probability < 0.95


def test_what_two_parts_of_one_recording_show_alike_is_named(real_probe: Probe) -> None:
    found = of_gauge(real_probe, estimates=(replace(SCALE, agreements=(AGREES,)),))
    assert found.verdict is Verdict.NAMED
    assert found.effects[0].confirmed_by == (AGREES.confirmation,)
    assert 0.95 < found.effects[0].probability < 0.99


def test_what_leaves_more_than_noise_or_may_go_otherwise_is_not_named(real_probe: Probe) -> None:
    sure = replace(SCALE, agreements=(AGREES,))
    unsure = of_gauge(real_probe, estimates=(replace(sure, otherwise=0.2),))
    assert unsure.verdict is Verdict.CLASS
    assert "depends on distance or speed in another way" in unsure.identifiable
    assert "in another way" not in of_gauge(real_probe, estimates=(SCALE,)).identifiable
    encoder = read(delay_s=0.06)
    wrong = with_events(sight(np.random.default_rng(8)), encoder, ("time_offset", "encoder_slip"))
    found = of_gauge(real_probe, estimates=(sure,), fit=wrong)
    assert found.verdict is Verdict.CLASS
    assert found.effects[0].probability < 0.9


@pytest.fixture(scope="module")
def thirty_a_second() -> TravelFit:
    """Any fit of pictures from 1/30 s to 1/30 s."""
    return fitted(sight(np.random.default_rng(8), every=6), read(), (), None)


def late(
    source: str, fit: TravelFit, delay_s: float | None, width_ms: tuple[float, float] | None,
    agreements: tuple[Agreement, ...] = (AGREES,),
) -> Seen:  # fmt: skip
    """Return a recording whose readings seem late, and whose line widens with its speed."""
    estimates: tuple[TravelEstimate, ...] = ()
    if delay_s is not None:
        p = 1e-12 if abs(delay_s) > 5e-3 else 0.8
        estimates = (
            TravelEstimate("time_offset", "delay_s", delay_s, 2e-4, 1e-3, p, 0.01, (), (AGREES,)),
        )  # fmt: skip
    recording = seen(source, estimates=estimates, fit=fit)
    if width_ms is None:
        return recording
    value, sigma = width_ms
    size, z = Size("exposure_s", "s", 1e-3 * value, 1e-3 * sigma), value / sigma
    blur = finding("motion_blur", z, 1e-12 if z > 6 else 0.5, (size,), "It widens.")
    of_line = ProfileEvidence("toy", np.arange(9), (replace(blur, agreements=agreements),))
    return replace(recording, profile=of_line)


def sizes(found: Diagnosis) -> dict[str, float]:
    return {e.name: e.parameters[effect(e.name).quantities[0].name].value for e in found.effects}


@pytest.mark.parametrize(
    ("delay_s", "width_ms", "named"),
    [
        (0.008, (0.0, 1.0), {"time_offset": 0.008}),
        (0.008, (16.0, 1.0), {"motion_blur": 0.016}),
        # What half of the exposure does not make is the encoder's own.
        (0.018, (16.0, 1.0), {"motion_blur": 0.016, "time_offset": 0.010}),
        (-0.010, (16.0, 1.0), {"motion_blur": 0.016, "time_offset": -0.018}),
        # Readings that come early, and exposures longer than from picture to picture, are no exposures.
        (-0.008, None, {"time_offset": -0.008}),
        (0.05, None, {"time_offset": 0.05}),
    ],
)
def test_pictures_that_are_late_by_half_an_exposure_are_told_from_late_readings(
    real_probe: Probe, thirty_a_second: TravelFit, delay_s: float, width_ms: tuple[float, float] | None,
    named: dict[str, float],
) -> None:  # fmt: skip
    found = answer(real_probe, None, late("gauge", thirty_a_second, delay_s, width_ms))
    assert found.verdict is Verdict.NAMED
    assert found.members == ()
    assert sizes(found) == pytest.approx(named)


@pytest.mark.parametrize("width_ms", [None, (16.0, 9.0)])
def test_late_pictures_and_late_readings_are_a_class_where_the_width_does_not_tell(
    real_probe: Probe, thirty_a_second: TravelFit, width_ms: tuple[float, float] | None
) -> None:
    found = answer(real_probe, None, late("gauge", thirty_a_second, 0.008, width_ms))
    assert found.verdict is Verdict.CLASS
    assert set(found.members) == {"time_offset", "motion_blur"}
    assert sizes(found) == pytest.approx({"time_offset": 0.008})
    assert 0.45 < found.effects[0].probability < 0.5
    assert found.location is not None
    assert (found.location.fixed_to, found.location.time) == (None, "speed")


@pytest.mark.parametrize(
    ("width_ms", "named"),
    [((16.0, 1.0), {"motion_blur": 0.016, "time_offset": 0.007}), ((0.0, 1.0), {"time_offset": 0.015})],
)
def test_the_width_in_one_recording_tells_of_the_delay_in_the_other(
    real_probe: Probe, thirty_a_second: TravelFit, width_ms: tuple[float, float], named: dict[str, float]
) -> None:
    field = late("field", thirty_a_second, 0.015, None)
    found = answer(real_probe, field, late("gauge", thirty_a_second, None, width_ms))
    assert found.verdict is Verdict.NAMED
    assert sizes(found) == pytest.approx(named)


def test_a_width_that_no_exposure_has_time_for_is_no_sure_exposure_and_moves_no_delay(
    real_probe: Probe, thirty_a_second: TravelFit
) -> None:
    """60 ms of 33 were named, and half of it was taken off a delay of 8 ms: -22 ms, as surely."""
    found = answer(real_probe, None, late("gauge", thirty_a_second, 0.008, (60.0, 5.0)))
    assert sizes(found).get("time_offset", 0.008) == pytest.approx(0.008)
    assert all(e.probability < 0.6 for e in found.effects if e.name == "motion_blur")


def test_the_encoders_own_delay_holds_what_the_width_leaves_open(
    real_probe: Probe, thirty_a_second: TravelFit
) -> None:
    named = answer(real_probe, None, late("gauge", thirty_a_second, 0.018, (16.0, 2.0)))
    (own,) = (e for e in named.effects if e.name == "time_offset")
    assert own.parameters["delay_s"].sd == pytest.approx(np.sqrt(0.2**2 + 1 + 1) * 1e-3)
    within = answer(real_probe, None, late("gauge", thirty_a_second, 0.012, (16.0, 2.0)))
    assert sizes(within) == pytest.approx({"motion_blur": 0.016})
    # An exposure that the halves of the frames do not bear out leaves the delay open.
    open_ = answer(real_probe, None, late("gauge", thirty_a_second, 0.018, (16.0, 2.0), (DIFFERS,)))
    assert open_.verdict is Verdict.CLASS
    assert set(open_.members) == {"time_offset", "motion_blur"}


def test_an_exposure_leaves_no_more_of_the_time_to_the_next_picture_than_is_not_stated(
    real_probe: Probe, thirty_a_second: TravelFit
) -> None:
    """33 ms from picture to picture, 28 ms of which a longer exposure would take."""
    recording = late("gauge", thirty_a_second, 0.014, None)
    assert answer(real_probe, None, recording).verdict is Verdict.CLASS
    long = replace(real_probe, shutter=replace(real_probe.shutter, exposure_s=0.015))
    assert sizes(answer(long, None, recording)) == pytest.approx({"time_offset": 0.014})
    assert answer(long, None, recording).verdict is Verdict.NAMED


def test_parts_that_contradict_each_other_take_the_name_away(real_probe: Probe) -> None:
    found = of_gauge(real_probe, estimates=(replace(PLAY, agreements=(AGREES, DIFFERS)),))
    assert found.verdict is Verdict.CLASS
    assert set(found.members) == {"encoder_backlash", "time_offset"}
    assert found.effects[0].probability < 1e-6


def test_what_both_recordings_show_alike_is_named(real_probe: Probe) -> None:
    both = (seen(source, estimates=(SCALE,)) for source in ("field", "gauge"))
    found = answer(real_probe, *both)
    assert found.verdict is Verdict.NAMED
    (one,) = found.effects
    assert one.name == "encoder_scale"
    assert [c.agrees for c in one.confirmed_by] == [True]


@pytest.mark.parametrize("other", [-0.02, 0.03])
def test_another_size_in_the_other_recording_is_no_confirmation(real_probe: Probe, other: float) -> None:
    there = replace(SCALE, value=other)
    found = answer(real_probe, seen("field", estimates=(there,)), seen("gauge", estimates=(SCALE,)))
    assert found.verdict is Verdict.CLASS
    assert found.effects[0].probability < 0.1


def test_an_effect_that_the_other_recording_would_show_and_does_not_is_not_named(real_probe: Probe) -> None:
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


def test_a_slip_is_named_only_when_the_reading_alone_shows_it_too(real_probe: Probe) -> None:
    alone = of_gauge(real_probe, slips=(SLIP,))
    assert alone.verdict is Verdict.CLASS
    assert alone.members == ("encoder_slip",)
    again = of_gauge(real_probe, slips=(replace(SLIP, agreements=(AGREES,)),))
    assert again.verdict is Verdict.NAMED


DOUBTFUL = replace(SLIP, rivals=(EventKind.OUTLIER,), stray=3)
LEFT = LeftOver(1.36, (90, 119), (6.0, 7.93), 1e-20, 30, False)
MAY_SLIP = replace(LEFT, where=(117, 119), stray=3, by_slip=True)


def test_a_step_that_may_be_stray_pictures_is_told_as_both_and_never_named(real_probe: Probe) -> None:
    found = of_gauge(real_probe, doubtful=(replace(DOUBTFUL, agreements=(AGREES,)),))
    assert found.verdict is Verdict.CLASS
    assert found.members == ("encoder_slip",)
    assert found.effects == ()
    assert (
        "At 1.30 s the reading gains +2.00 mm: a slip of the wheel, or 3 stray pictures" in found.identifiable
    )
    assert "record the passage again, slowly" in found.identifiable
    assert found.global_p <= 1e-20


def test_a_doubtful_step_that_chance_may_make_is_not_told(real_probe: Probe) -> None:
    found = of_gauge(real_probe, doubtful=(replace(DOUBTFUL, p_value=1e-4),))
    assert found.members == ()
    assert found.identifiable == ""


def test_doubtful_steps_of_two_recordings_are_both_told_and_bear_nothing_out(real_probe: Probe) -> None:
    there = replace(DOUBTFUL, time_s=2.5, gain_mm=-1.0)
    found = answer(real_probe, seen("field", doubtful=(there,)), seen("gauge", doubtful=(DOUBTFUL,)))
    assert found.verdict is Verdict.CLASS
    assert found.members == ("encoder_slip",)
    assert "At 2.50 s the reading gains -1.00 mm" in found.identifiable
    assert "At 1.30 s the reading gains +2.00 mm" in found.identifiable


def test_several_doubtful_steps_of_one_recording_may_have_another_cause(real_probe: Probe) -> None:
    """A delay that nobody knows looks like two of opposite sign where the probe turns."""
    back = replace(DOUBTFUL, time_s=2.5, gain_mm=-2.0)
    found = of_gauge(real_probe, doubtful=(DOUBTFUL, back))
    assert found.verdict is Verdict.UNEXPLAINED
    assert found.effects == ()
    assert "gains +2.00 mm" in found.identifiable
    assert "gains -2.00 mm" in found.identifiable


def test_a_doubtful_step_beside_what_no_effect_explains_is_no_class_of_slips(real_probe: Probe) -> None:
    found = of_gauge(real_probe, doubtful=(DOUBTFUL,), unexplained=LEFT)
    assert found.verdict is Verdict.UNEXPLAINED
    assert found.members == ()
    assert "gains +2.00 mm" in found.identifiable
    assert "+1.36 mm in a way that no effect" in found.identifiable
    by_slips = of_gauge(real_probe, doubtful=(DOUBTFUL,), unexplained=MAY_SLIP)
    assert by_slips.members == ("encoder_slip",)


def test_beside_a_doubtful_slip_a_scale_keeps_its_size_but_no_sure_name(real_probe: Probe) -> None:
    """Three pictures at the end, placed wrongly, may be a slip; the encoder's scale is 2 % off."""
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


def test_beside_a_doubtful_step_a_name_is_unsure_and_a_slip_of_its_own_stays(real_probe: Probe) -> None:
    """The step is a column of the fit: what stray pictures may have done is one doubt more, and no misfit."""
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
def test_what_no_effect_of_an_encoder_explains_has_no_name_and_takes_sure_ones_away(
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


def test_what_is_left_and_may_be_a_slip_is_a_class_for_who_knows_slips(real_probe: Probe) -> None:
    found = of_gauge(real_probe, unexplained=MAY_SLIP)
    assert found.verdict is Verdict.CLASS
    assert found.members == ("encoder_slip",)
    assert "the wheel slipped, or 3 pictures in a row are stray" in found.identifiable
    unknown = answer(real_probe, None, seen("gauge", unexplained=LEFT), "encoder_slip")
    assert unknown.verdict is Verdict.UNEXPLAINED


def test_steps_and_what_is_told_to_be_left_make_a_fit_no_noise_of_themselves() -> None:
    nothing = TravelEvidence("gauge", (), (), (), (), None, ())
    assert (nothing.fits_p, nothing.least_p) == (1.0, 1.0)
    for shown in ({"unexplained": LEFT}, {"doubtful": (DOUBTFUL,)}, {"slips": (SLIP,)}):
        some = replace(nothing, **shown)  # type: ignore[arg-type]
        assert (some.fits_p, some.least_p) == (1.0, 1e-20)


def test_what_is_sure_is_named_though_something_else_remains(real_probe: Probe) -> None:
    sure = replace(PLAY, agreements=(AGREES,))
    found = of_gauge(real_probe, estimates=(sure, SCALE))
    assert found.verdict is Verdict.PARTLY
    assert [e.name for e in found.effects] == ["encoder_backlash"]
    assert found.remainder is not None
    assert found.remainder.verdict is Verdict.CLASS
    assert "encoder_scale" in found.remainder.members
    assert found.members == ()
    assert "encoder_scale" in found.record_next


def test_what_is_sure_is_named_beside_what_the_library_lacks(real_probe: Probe) -> None:
    sure = replace(PLAY, agreements=(AGREES,))
    found = answer(real_probe, None, seen("gauge", estimates=(sure, SCALE)), "encoder_scale")
    assert found.verdict is Verdict.PARTLY
    assert found.remainder is not None
    assert found.remainder.verdict is Verdict.UNEXPLAINED
    assert found.remainder.members == ()


def test_a_slip_of_the_gauge_run_is_not_the_inspections(real_probe: Probe) -> None:
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


def test_what_the_library_lacks_is_seen_but_not_named(real_probe: Probe) -> None:
    both = (seen(source, estimates=(SCALE,)) for source in ("field", "gauge"))
    found = answer(real_probe, *both, "encoder_scale")
    assert found.verdict is Verdict.UNEXPLAINED
    assert found.effects == ()
    assert found.location is not None
    assert (found.location.channel, found.location.fixed_to) == ("motion", "pipe")


def test_what_is_within_the_stated_uncertainty_is_nothing(real_probe: Probe) -> None:
    found = of_gauge(real_probe, estimates=(replace(SCALE, p_value=0.2),))
    assert found.verdict is Verdict.NOT_IDENTIFIABLE
    assert found.effects == ()


def test_what_goes_with_speed_as_well_as_with_turning_back_is_not_placed_in_time(real_probe: Probe) -> None:
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
    verdicts = SimpleNamespace(probability=(0.6,), judged=(SimpleNamespace(names=suspected),))
    table = (SimpleNamespace(name="laser_rocking", detectable=detectable_mrad),)
    return SimpleNamespace(searched=searched, verdicts=verdicts, feasibility=table, unsplit=())


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
def test_a_sheet_that_would_be_seen_rocking_is_excluded(of: Any, excluded: bool) -> None:
    assert rocking_excluded(SWING, replace(seen("gauge"), geometry=cast(Any, of))) is excluded


def test_a_swing_that_a_rocking_sheet_may_make_is_a_class(real_probe: Probe) -> None:
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
def test_what_touches_rings_without_a_pattern_is_the_doing_of_what_motion_shows(
    names: tuple[str, ...], claimed: bool, verdict: Verdict
) -> None:
    best = SimpleNamespace(named=False, names=names, library_terms=())
    rings = SimpleNamespace(best=best, verdicts=SimpleNamespace(adequacy=0.5), confirmed=(), unsplit=())
    assert verdict_of_rings(cast(Any, rings), claimed) is verdict


@pytest.mark.parametrize(("width_px", "verdict"), [(1.5, Verdict.NAMED), (9.0, Verdict.CLASS)])
def test_a_name_needs_pictures_on_which_names_were_counted(
    real_probe: Probe, width_px: float, verdict: Verdict
) -> None:
    size = (Size("skewness", "", 1.0, 0.1),)
    skewed = replace(finding("line_skew", 20.0, 1e-12, size, "It is skewed."), agreements=(AGREES,))
    light = ProfileEvidence("gauge", np.arange(3), (skewed,), (Condition("width", width_px, 1.1, 3.2),))
    found = answer(real_probe, None, replace(seen("gauge"), profile=light))
    assert found.verdict is verdict
    assert (found.effects[0].probability > 0.8) is (verdict is Verdict.NAMED)
    assert bool(light.uncovered) is (verdict is Verdict.CLASS)
