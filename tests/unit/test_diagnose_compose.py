"""Channels are combined into one answer: a name needs agreement of a second, independent estimate."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from pipeline.instrument.probe import Probe
from stages.diagnose.compose import verdict_of_rings
from stages.diagnose.correct import encoder_effects
from stages.diagnose.gauge import answer as of_rings
from stages.diagnose.gauge.examine import Examined
from stages.diagnose.profile.evidence import Condition, ProfileEvidence
from stages.diagnose.profile.finding import Size, finding
from stages.diagnose.result import EffectFound, FitQuality, Location, Verdict
from stages.diagnose.rocking import rocking_excluded
from stages.diagnose.travel.events import with_events
from tests.diagnosed import AGREES, DIFFERS, PLAY, SCALE, SLIP, SWING, answer, of_gauge, seen
from tests.travel_cases import read
from tests.travel_cases import seen as sight
from tests.unit.wall_points import Bore, plain_probe, ring_points


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
def test_a_rocking_sheet_that_rings_would_show_is_excluded(of: Any, excluded: bool) -> None:
    assert rocking_excluded(SWING, replace(seen("gauge"), geometry=cast(Any, of))) is excluded


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
    rings = SimpleNamespace(best=best, verdicts=SimpleNamespace(adequacy=0.5), confirmed=(), unsplit=())
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


@pytest.mark.parametrize(("width_px", "verdict"), [(1.5, Verdict.NAMED), (9.0, Verdict.CLASS)])
def test_a_name_needs_pictures_of_a_kind_on_which_names_were_validated(
    real_probe: Probe, width_px: float, verdict: Verdict
) -> None:
    size = (Size("skewness", "", 1.0, 0.1),)
    skewed = replace(finding("line_skew", 20.0, 1e-12, size, "It is skewed."), agreements=(AGREES,))
    light = ProfileEvidence("gauge", np.arange(3), (skewed,), (Condition("width", width_px, 1.1, 3.2),))
    found = answer(real_probe, None, replace(seen("gauge"), profile=light))
    assert found.verdict is verdict
    assert (found.effects[0].probability > 0.8) is (verdict is Verdict.NAMED)
    assert bool(light.uncovered) is (verdict is Verdict.CLASS)


def test_evidence_of_image_formation_in_the_line_is_not_reported_as_improbable(real_probe: Probe) -> None:
    """A sound probe was consistent, but "chance alone would show as much with probability 9e-8"."""
    faint = finding("line_skew", 5.6, 3e-8, (Size("skewness", "", 0.1, 0.02),), "It is skewed.")
    clear = replace(faint, z=20.0)
    told = []
    for skewed in (faint, clear):
        light = ProfileEvidence("gauge", np.arange(3), (skewed,))
        told.append(answer(real_probe, None, replace(seen("gauge"), profile=light)).global_p)
    assert told == [1.0, pytest.approx(3e-8)]


def rings_of_a_class(monkeypatch: pytest.MonkeyPatch, moved_px: float) -> Examined:
    """Return rings that a drift, from a class of two names, moves by ``moved_px``."""
    monkeypatch.setattr(of_rings, "ring_shift_alone_px", lambda fit, term: term.shift_px)
    monkeypatch.setattr(of_rings, "verdict_of", lambda examined: Verdict.CLASS)
    drift = EffectFound("baseline_drift", 0.5, {}, "The baseline gets longer.", "", ())
    monkeypatch.setattr(of_rings, "effects_found", lambda examined: (drift,))
    monkeypatch.setattr(of_rings, "members", lambda examined: ("laser_cone", "baseline_drift"))
    monkeypatch.setattr(of_rings, "candidates", lambda examined: ())
    monkeypatch.setattr(of_rings, "unknown_law_descriptions", lambda examined: ())
    best = SimpleNamespace(fit=SimpleNamespace(terms=(SimpleNamespace(shift_px=moved_px),)), names=("a",))
    rings = SimpleNamespace(
        best=best, searched=searched_rings(), location=None, quality=None, feasibility=(),
        global_p=0.0, shortcomings=(), verdicts=None,
    )  # fmt: skip
    return cast(Any, rings)


def searched_rings() -> Any:
    """Return rings of a 4 inch bore with a line 1.7 px wide; one mm of the sheet is 6 px."""
    rings = ring_points(plain_probe(), Bore(50.8), 40)
    return SimpleNamespace(
        run=SimpleNamespace(width_px=np.full(9, 1.7)),
        nothing=SimpleNamespace(linearised=SimpleNamespace(rings=rings)), by_chance=0.5,
    )  # fmt: skip


def light(source: str, name: str, *size: Size) -> ProfileEvidence:
    """Return a certain effect on the line's light."""
    found = replace(finding(name, 20.0, 1e-12, size, "It is seen."), agreements=(AGREES,))
    return ProfileEvidence(source, np.arange(3), (found,))


@pytest.mark.parametrize(
    ("moved_px", "sd_mm", "verdict"),
    [(0.07, 0.03, Verdict.NAMED), (0.3, 0.03, Verdict.PARTLY), (0.07, 0.002, Verdict.PARTLY)],
)
def test_residuals_smaller_than_the_uncertainty_of_a_named_light_effect_are_not_reported(
    real_probe: Probe, monkeypatch: pytest.MonkeyPatch, moved_px: float, sd_mm: float, verdict: Verdict
) -> None:
    """Beside a line with glowing wall, .07 px of drift gave the verdict "partly" and a class of 13 names."""
    rings = rings_of_a_class(monkeypatch, moved_px)
    glow = light("gauge", "subsurface", Size("transport_mm", "mm", 0.3, sd_mm))
    found = answer(real_probe, None, replace(seen("gauge"), profile=glow, geometry=rings))
    assert found.verdict is verdict
    assert [e.name for e in found.effects] == ["subsurface"]
    told = [s for s in found.shortcomings if "less than the size of subsurface is uncertain" in s]
    assert bool(told) is (verdict is Verdict.NAMED)
    assert all("such as laser_cone, baseline_drift, moves them" in s for s in told)


@pytest.mark.parametrize(
    ("name", "size"),
    [
        ("vignetting", (Size("falloff", "", 0.3, 0.06),)),
        ("ambient_light", (Size("relative", "", 0.05, 0.02),)),
        ("dust", (Size("attenuation", "", 0.4, 0.1),)),
        ("speckle", (Size("contrast", "", 0.1, 0.02),)),
        ("ghost_ring", (Size("relative", "", 0.02, 0.01),)),
    ],
)
def test_light_that_cannot_move_the_line_so_far_excuses_no_residual(
    real_probe: Probe, monkeypatch: pytest.MonkeyPatch, name: str, size: tuple[Size, ...]
) -> None:
    """Each excused .05 px or more.

    With its size known to 20 %, it was assumed to move the line by .2 widths.
    """
    rings, seen_light = rings_of_a_class(monkeypatch, 0.05), light("gauge", name, *size)
    found = answer(real_probe, None, replace(seen("gauge"), profile=seen_light, geometry=rings))
    assert found.remainder is not None
    assert {"laser_cone", "baseline_drift"} <= set(found.remainder.members)


def test_light_in_the_inspection_alone_excuses_no_residual_of_the_gauge_run(
    real_probe: Probe, monkeypatch: pytest.MonkeyPatch
) -> None:
    rings = rings_of_a_class(monkeypatch, 0.07)
    glow = light("field", "subsurface", Size("transport_mm", "mm", 0.3, 0.03))
    field, gauge = replace(seen("field"), profile=glow), replace(seen("gauge"), geometry=rings)
    found = answer(real_probe, field, gauge)
    assert found.remainder is not None
    assert {"laser_cone", "baseline_drift"} <= set(found.remainder.members)
    assert answer(real_probe, field, replace(gauge, profile=glow)).remainder is None


@pytest.mark.parametrize(
    ("name", "size", "verdict"),
    [
        ("subsurface", (Size("transport_mm", "mm", 0.3, 0.06),), Verdict.NAMED),
        ("beam_decentre", (), Verdict.PARTLY),
        ("saturation", (Size("exposure_gain", "", 3.0, 2.0),), Verdict.PARTLY),
    ],
)
def test_a_repeated_residual_is_due_to_light_only_where_the_light_can_move_the_line_so_far(
    real_probe: Probe, name: str, size: tuple[Size, ...], verdict: Verdict
) -> None:
    """A claim without a size excused a whole width of the line: 1.4 px, with noise of .1 px."""
    quality = FitQuality("px", 0.31, 0.3, 0.29, 0.284, 0.126)
    rings = Examined(searched_rings(), None, (), (), quality=quality, location=Location("ring", None, None))
    gauge = replace(seen("gauge"), profile=light("gauge", name, *size), geometry=rings)
    assert answer(real_probe, None, gauge).verdict is verdict
