"""A class as a person can use it: likely causes with their courses, the rest summed up, few recordings."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from pipeline.api.diagnosis.causes import class_shown
from pipeline.api.diagnosis.report import Shown, write_page
from stages.diagnose import weighed as by
from stages.diagnose.as_json import to_json
from stages.diagnose.causes import Cause, Causes, CourseShare
from stages.diagnose.effects.courses import with_courses
from stages.diagnose.effects.library import LIBRARY
from stages.diagnose.field.answer import _met
from stages.diagnose.gauge import answer
from stages.diagnose.gauge.hypotheses import Judged
from stages.diagnose.gauge.judge import Unfitted, Verdicts
from stages.diagnose.gauge.run import Term
from stages.diagnose.gauge.sets import PATTERNS, Member
from stages.diagnose.record_next import record_next
from stages.diagnose.result import Confirmation, Diagnosis, EffectFound, Remainder, Verdict

MODELS = with_courses(LIBRARY)
FAR, LATE = (
    CourseShare("distance", 0.8, "The sheet tilts with the way."),
    CourseShare("exponential", 0.195, "The sheet tilts ever more slowly."),
)
TILT = Cause("laser_tilt", 0.8, (FAR, LATE, CourseShare("ramp", 0.005, "The sheet tilts evenly.")))
CAUSES = Causes(
    (
        TILT, Cause("centre_drift", 0.07, (CourseShare("exponential", 1.0, "The axis drifts."),)),
        Cause("principal_point", 0.03, (CourseShare("distance", 1.0, "The axis moves."),)),
        Cause("sensor_tilt", 0.003, (CourseShare("distance", 1.0, "The sensor tilts."),)),
        Cause("outside_index", 0.02, (CourseShare("constant", 1.0, "Gas."),)), Cause("laser_cone", 0.0),
    ),
    outside=0.1,
)  # fmt: skip
MEMBERS = ("laser_tilt", "principal_point", "sensor_tilt", "centre_drift")
FOUND = Diagnosis("field", "gauge", Verdict.CLASS, 1e-9, members=MEMBERS, causes=CAUSES)


def term(name: str, shape: tuple[float, ...] = (), size: float = 1e-3) -> Term:
    return Term(MODELS[name], shape, np.full(len(MODELS[name].amplitudes), size))


def judged(*terms: Term) -> Judged:
    return Judged(cast(Any, SimpleNamespace(terms=terms)), cast(Any, None), (), 0.0, 0.0, 0.0)


def test_a_law_gathers_its_courses_and_gives_what_is_doubtful_to_what_makes_it_so(monkeypatch):
    """Courses of one law stood as causes of their own, and a name of 21 % as one of 80 %."""
    far, late = term("laser_tilt, distance", (100.0,)), term("laser_tilt, exponential", (2.0,))
    cone = Member(LIBRARY["laser_cone"], (), 0.0)
    sensor = Unfitted((Member(LIBRARY["sensor_tilt"], (), 0.0),), (np.ones(2),), 0.0, 0.01)
    beside = Unfitted((Member(far.model, far.shape, 0.0), cone), (far.amplitude, np.ones(1)), 0.0, 0.1)
    pattern = Unfitted((Member(*PATTERNS[0], 0.0),), (np.ones(2),), 0.0, 0.05)
    verdicts = Verdicts(
        (),
        (judged(far), judged(late)),
        np.array([0.6, 0.25]),
        1.0,
        cast(Any, None),
        (beside, pattern, sensor),
        25,
    )
    shared = answer.Doubted(0.38, {"sensor_tilt": 0.38}, 0.1)
    monkeypatch.setattr(by, "doubted", lambda seen: (shared,))
    asked = [SimpleNamespace(name=n) for n in ("laser_tilt", "laser_cone", "baseline")]
    seen: Any = SimpleNamespace(best=judged(far), verdicts=verdicts, feasibility=asked)
    found = by.weighed(seen, ())
    assert {c.name: round(c.probability, 9) for c in found.laws} == {
        "laser_tilt": 0.38, "sensor_tilt": 0.38, "laser_cone": 0.1,
        "baseline": 0.0, "ovality": 0.0, "pipe_bend": 0.0,
    }  # fmt: skip
    assert found.outside == pytest.approx(0.1 + 0.05)
    tilt = found.of("laser_tilt")
    assert tilt is not None
    assert [(c.kind, round(c.probability, 3)) for c in tilt.courses] == [
        ("distance", 0.737),
        ("exponential", 0.263),
    ]
    assert "in proportion to the distance" in tilt.courses[0].statement
    assert found.of("focal_scale") is None
    assert by.weighed(cast(Any, SimpleNamespace(best=None, verdicts=None)), ()) == Causes()


def test_the_page_groups_a_class_by_law_and_sums_up_what_is_unlikely(tmp_path):
    """A page counted 24 names in a row, most of them of less than 1 %."""
    shown = class_shown(FOUND)
    assert [c.name.partition(";")[0] for c in shown.causes] == [
        "laser tilt, 80 %", "centre drift, 7 %", "principal point, 3 %",
    ]  # fmt: skip
    assert "how its size changes over the run is not certain" in shown.causes[0].name
    assert shown.causes[0].courses == (f"80 % of that: {FAR.statement}", f"20 % of that: {LATE.statement}")
    assert shown.causes[1].courses == ("The axis drifts.",)
    assert [s.rpartition(": ")[2] for s in shown.rest] == ["10 %.", "2 %."]
    tilt = EffectFound("laser_tilt", 0.8, {}, FAR.statement, "δr = −r x")
    write_page(replace(FOUND, effects=(tilt,)), Shown(), tmp_path)
    page = (tmp_path / "diagnosis.html").read_text()
    assert page.count("sensor") == 0
    assert page.count(FAR.statement) == 1


def test_a_class_of_what_rings_were_not_asked_about_stands_without_probabilities(tmp_path):
    alone = Diagnosis("field", "", Verdict.CLASS, 1e-9, members=("encoder_scale", "baseline"))
    assert [c.name for c in class_shown(alone).causes] == ["encoder scale", "baseline"]
    assert class_shown(alone).rest == ()
    left = Remainder(Verdict.CLASS, None, ("encoder_scale", *MEMBERS))
    beside = Diagnosis("field", "gauge", Verdict.PARTLY, 1e-9, remainder=left, causes=CAUSES)
    assert class_shown(beside).causes[-1].name == "encoder scale"
    assert len(class_shown(beside).causes) == 4
    write_page(beside, Shown(), tmp_path)
    page = (tmp_path / "diagnosis.html").read_text()
    assert "Something more remains. These recordings cannot tell which of these it is" in page
    write_page(replace(FOUND, members=("laser_tilt",)), Shown(), tmp_path)
    page = (tmp_path / "diagnosis.html").read_text()
    assert "Most likely it is this, but these recordings do not make it certain" in page
    assert "cannot tell which of these it is" not in page


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


def test_the_file_keeps_every_name_of_the_class_and_has_no_key_of_the_page():
    told = to_json(FOUND)
    assert told["class"] == list(MEMBERS)
    assert "causes" not in told


def test_few_recordings_are_asked_for_and_those_first_that_separate_the_most():
    """A page asked for 20 recordings; what set the likeliest two apart was another speed."""
    sentence = record_next(MEMBERS, CAUSES)
    assert sentence.startswith(
        "To tell laser_tilt, principal_point and centre_drift apart, record: the same way "
    )
    assert sentence.count(";") == 2
    every = record_next(tuple(LIBRARY))
    assert every.count(";") == 2
    assert "and the others apart" in every


@pytest.mark.parametrize(
    ("kinds", "first"),
    [
        (("distance", "ramp"), "the same way at another speed, with a stop"),
        (("ramp", "exponential"), "a longer run"),
        (("reversal", "speed"), "the way to and fro"),
    ],
)
def test_courses_of_one_law_are_told_apart_by_their_own_recording(kinds, first):
    courses = tuple(CourseShare(kind, 0.5, "") for kind in kinds)
    sentence = record_next(("baseline",), Causes((Cause("baseline", 0.9, courses),)))
    assert sentence == f"To tell how baseline changes over the run, record: {first}."


def test_a_recording_that_serves_against_one_other_cause_is_asked_for_against_that_alone():
    assert "against ovality" not in record_next(("sheet_waviness", "laser_cone"))
    assert "roll" in record_next(("sheet_waviness", "ovality"))
    assert record_next(()) == ""
    none = Causes((Cause("baseline", 0.0),))
    assert record_next(("baseline",), none) == record_next(("baseline",))
