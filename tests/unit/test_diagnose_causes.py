"""A class as a person can use it: likely causes with their courses, the rest summed up, few recordings."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from pipeline.api.diagnosis.causes import class_shown
from stages.diagnose.causes import Cause, Causes, CourseShare
from stages.diagnose.combine import weighed as by
from stages.diagnose.effects.courses import with_courses
from stages.diagnose.effects.library import LIBRARY
from stages.diagnose.field.answer import _met
from stages.diagnose.gauge import doubts
from stages.diagnose.gauge.hypotheses import Judged
from stages.diagnose.gauge.judge import Unfitted, Verdicts
from stages.diagnose.gauge.run import Term
from stages.diagnose.gauge.sets import PATTERNS, Member
from stages.diagnose.gauge.unknown_laws import Unknown
from stages.diagnose.record_next import record_next
from stages.diagnose.result import Confirmation, Diagnosis, EffectFound, Remainder, Value, Verdict

MODELS = with_courses(LIBRARY)


def term(name: str, shape: tuple[float, ...] = (), size: float = 1e-3) -> Term:
    return Term(MODELS[name], shape, np.full(len(MODELS[name].amplitudes), size))


def judged(*terms: Term) -> Judged:
    return Judged(cast(Any, SimpleNamespace(terms=terms)), cast(Any, None), (), 0.0, 0.0, 0.0)


def gauge_run(sets: list[tuple[tuple[Term, ...], float]], **given: Any) -> Any:
    """Return a gauge run with fitted sets and their probabilities, the best first.

    All names are confirmed, unless ``given`` says otherwise.
    """
    fitted = tuple(judged(*terms) for terms, _ in sets)
    count, chance = len(fitted[0].library_terms), [p for _, p in sets]
    verdicts = Verdicts((), fitted, np.array(chance), 1.0, cast(Any, None), (), 25)
    agrees = Confirmation("1", "1", True)
    seen = {"best": fitted[0], "verdicts": verdicts, "feasibility": [], "quality": None, "sizes": ()} | {
        "confirmed": ((agrees,),) * count, "unknown_laws": (Unknown(0.0, 0.0),) * count,
    }  # fmt: skip
    return SimpleNamespace(**seen | given)


@pytest.fixture
def same_shift(monkeypatch: pytest.MonkeyPatch) -> None:
    """All effects and patterns move rings by 1 px."""
    monkeypatch.setattr(doubts, "shift_px", lambda fit, term: 1.0)


def chances(found: Causes) -> dict[str, float]:
    return {c.name: round(c.probability, 4) for c in found.laws if c.probability > 0}


def test_a_law_gathers_its_courses_and_gives_what_is_doubtful_to_what_makes_it_so(same_shift):
    """Courses of one law stood as causes of their own, and a name of 21 % as one of 80 %."""
    far, late = term("laser_tilt, distance", (100.0,)), term("laser_tilt, exponential", (2.0,))
    cone = Member(LIBRARY["laser_cone"], (), 0.0)
    sensor = Unfitted((Member(LIBRARY["sensor_tilt"], (), 0.0),), (np.ones(2),), 0.0, 0.01)
    beside = Unfitted((Member(far.model, far.shape, 0.0), cone), (far.amplitude, np.ones(1)), 0.0, 0.1)
    pattern = Unfitted((Member(*PATTERNS[0], 0.0),), (np.ones(2),), 0.0, 0.05)
    asked = [SimpleNamespace(name=n) for n in ("laser_tilt", "laser_cone", "baseline")]
    seen = gauge_run([((far,), 0.59), ((late,), 0.25)], confirmed=((),), feasibility=asked)
    seen.verdicts = replace(seen.verdicts, unfitted=(beside, pattern, sensor))
    found = by.weighed(seen, ())
    # To the tilt's .94 comes a tenth for unknown causes.
    total = 1 + 0.094
    tilt = found.of("laser_tilt")
    assert tilt is not None
    assert tilt.probability == pytest.approx(0.94 / total)
    assert doubts.chances(seen) == pytest.approx([tilt.probability])
    assert found.outside == pytest.approx((0.094 + 0.05) / total)
    assert chances(found) == pytest.approx(
        {"laser_tilt": tilt.probability, "laser_cone": 0.11 / total, "sensor_tilt": 0.01 / total}, abs=1e-4
    )
    assert [c.name for c in found.laws[3:]] == ["baseline", "ovality", "pipe_bend"]
    assert [(c.kind, round(c.probability, 3)) for c in tilt.courses] == [
        ("distance", 0.734),
        ("exponential", 0.266),
    ]
    assert "in proportion to the distance" in tilt.courses[0].statement
    assert found.of("focal_scale") is None
    assert by.weighed(cast(Any, SimpleNamespace(best=None, verdicts=None)), ()) == Causes()


def test_exclusive_causes_add_up_to_one_and_doubt_changes_no_order(same_shift):
    """A cone of 40 % beside a tilt of 60 % came first, at 40 %, once the tilt was doubted."""
    tilt, cone = term("laser_tilt"), term("laser_cone")
    unsure = by.weighed(gauge_run([((tilt,), 0.6), ((cone,), 0.4)], confirmed=((),)), ())
    assert chances(unsure) == {"laser_tilt": 0.566, "laser_cone": 0.3774}
    assert sum(c.probability for c in unsure.laws) + unsure.outside == pytest.approx(1.0)
    assert unsure.outside == pytest.approx(0.06 / 1.06)


def test_a_step_is_told_at_the_time_of_the_answer(same_shift):
    """The page told 1.97 s, that of the best fit, and the answer its mean, 1.94 s."""
    step = term("laser_tilt, step", (1.97,))
    mean = SimpleNamespace(time_s=Value(1.94, 0.08))
    (tilt, *_) = by.weighed(gauge_run([((step,), 1.0)], sizes=(mean,)), ()).laws
    assert "1.94 s" in tilt.courses[0].statement


def test_a_rival_far_less_likely_than_any_other_is_left_out(same_shift):
    """Its share of a law was 0 over 0."""
    sets = [((term("laser_tilt"),), 1.0), ((term("laser_cone"),), 5e-324)]
    assert chances(by.weighed(gauge_run(sets), ())) == {"laser_tilt": 1.0}


def test_a_law_with_two_courses_at_once_is_doubted_once(same_shift):
    both = (term("laser_tilt"), term("laser_tilt, step", (5.0,)))
    found = by.weighed(gauge_run([((both[1],), 0.6), (both, 0.4)], confirmed=((),)), ())
    assert chances(found) == {"laser_tilt": 0.9091}
    assert found.outside == pytest.approx(0.1 / 1.1)


def test_two_orders_of_one_law_are_one_form_with_both_sentences(same_shift):
    """Of two waves, the page said "89 % of that … 18 % of that" and stated one."""
    two, three, four = (term("sheet_waviness", (n,)) for n in (2.0, 3.0, 4.0))
    (found, *_) = by.weighed(gauge_run([((two, three), 0.7), ((two,), 0.2), ((two, four), 0.1)]), ()).laws
    assert [round(c.probability, 9) for c in found.courses] == [0.7, 0.2, 0.1]
    both = [t.model.statement(t.shape, t.amplitude) for t in (two, three)]
    assert found.courses[0].statement == " ".join(both)
    assert found.courses[1].statement == both[0]
    assert record_next(("sheet_waviness",), Causes((found,))) == record_next(("sheet_waviness",))


def test_a_law_that_only_impossible_sets_have_is_no_cause(same_shift):
    """It divided by its probability of nothing."""
    found = by.weighed(gauge_run([((term("laser_tilt"),), 1.0), ((term("laser_cone"),), 0.0)]), ())
    assert chances(found) == {"laser_tilt": 1.0}


def test_what_rings_were_not_asked_about_is_as_likely_as_what_looks_like_it():
    """A step of the focal length was to be told from an encoder's scale and from vignetting first of all."""
    focal, baseline = (
        Cause(n, p, (CourseShare("step", 1.0, f"{n} steps."),))
        for n, p in (("focal_scale", 0.8), ("baseline", 0.1))
    )
    members = ("focal_scale", "baseline", "encoder_scale", "vignetting", "encoder_slip")
    found = Diagnosis("f", "g", Verdict.CLASS, 1e-9, members=members, causes=Causes((focal, baseline)))
    either = "baseline (or encoder scale or vignetting, which looks like it), 10 %"
    assert [c.name for c in class_shown(found).causes] == ["focal scale, 80 %", either, "encoder slip"]
    assert record_next(members[:4], found.causes).startswith("To tell focal_scale, baseline, ")
    unlikely = replace(found, causes=Causes((focal, replace(baseline, probability=0.001))))
    assert [c.name for c in class_shown(unlikely).causes] == ["focal scale, 80 %", "encoder slip"]
    others = "Any other effect of the library, alone or beside one of these: less than 1 %."
    assert class_shown(unlikely).rest == (others,)
    least = Causes((replace(focal, probability=0.0), replace(baseline, probability=0.0001)))
    assert class_shown(replace(unlikely, causes=least)).rest == (others,)


def test_what_remains_by_the_encoder_is_not_weighed_by_the_gauge_run():
    """Of a clock that was late by .204 s, the page said "time offset, less than 1 %"."""
    left = Remainder(Verdict.CLASS, None, ("encoder_backlash", "time_offset"))
    laws = (Cause("laser_cone", 0.91), Cause("dome_axial", 0.09), Cause("time_offset", 1e-9))
    found = Diagnosis("f", "g", Verdict.PARTLY, 1e-9, remainder=left, causes=Causes(laws))
    assert [c.name for c in class_shown(found).causes] == ["encoder backlash", "time offset"]
    assert class_shown(found).rest == ()


def test_a_name_that_the_inspection_contradicts_loses_its_probability_by_the_gauge_run():
    """The page said "laser tilt, more than 99 %", and what looks like a tilt stood nowhere on it."""
    tilt = EffectFound("laser_tilt", 0.995, {}, "The sheet is tilted.", "")
    left = Remainder(Verdict.CLASS, None, ("laser_cone", "focal_scale"))
    laws = (
        Cause("laser_tilt", 0.995, (CourseShare("constant", 1.0, "The sheet is tilted."),)),
        Cause("laser_cone", 0.6, (CourseShare("constant", 1.0, "The sheet is a cone."),)),
        *(Cause(name, 0.0) for name in ("principal_point", "sensor_tilt", "focal_scale")),
    )
    partly = Diagnosis(
        "f", "g", Verdict.PARTLY, 1e-9, effects=(tilt,), remainder=left, causes=Causes(laws, 0.003)
    )
    found = _met(partly, {"laser_tilt": Confirmation("0.60", "0.30", False)})
    assert found.verdict is Verdict.CLASS
    assert found.effects[0].probability == pytest.approx(0.995 / 1.995)
    shown = [c.name for c in class_shown(found).causes]
    assert [name for name in shown if "%" in name] == ["laser cone, 60 %"]
    assert {"laser tilt", "principal point", "sensor tilt"} < set(shown)
    assert "principal_point" in found.record_next
