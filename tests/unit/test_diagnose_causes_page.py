"""What a person reads of a class: the page, the file, and the recordings that are asked for."""

from dataclasses import replace

import pytest

from pipeline.api.diagnosis.causes import class_shown
from pipeline.api.diagnosis.report import Shown, write_page
from stages.diagnose.as_json import to_json
from stages.diagnose.causes import Cause, Causes, CourseShare
from stages.diagnose.effects.library import LIBRARY
from stages.diagnose.record_next import record_next
from stages.diagnose.result import Diagnosis, EffectFound, Remainder, Verdict
from tests.unit.found_causes import CAUSES, FAR, FOUND, LATE, MEMBERS, TILT


def test_the_page_groups_a_class_by_law_and_sums_up_what_is_unlikely(tmp_path):
    """A page counted 24 names in a row, most of them of less than 1 %."""
    shown = class_shown(FOUND)
    assert [c.name.partition(";")[0] for c in shown.causes] == [
        "laser tilt, 80 %", "centre drift, 7 %", "principal point, 3 %",
    ]  # fmt: skip
    assert "which of these forms it has is not certain" in shown.causes[0].name
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


def test_a_class_of_unlikely_names_alone_shows_all_of_them():
    """The page showed no cause, and not one of the names in diagnosis.json."""
    baseline = Cause("baseline", 0.004, (CourseShare("constant", 1.0, "The baseline is off."),))
    members, causes = ("baseline", "vignetting", "laser_cone"), Causes((baseline, Cause("laser_cone", 0.0)))
    found = Diagnosis("f", "g", Verdict.CLASS, 1e-9, members=members, causes=replace(causes, outside=0.99))
    assert [c.name for c in class_shown(found).causes] == [
        "baseline (or vignetting, which looks like it), less than 1 %", "laser cone, less than 1 %",
    ]  # fmt: skip
    assert [s.rpartition(": ")[2] for s in class_shown(found).rest] == ["99 %."]


@pytest.mark.parametrize(("chance", "words"), [(0.2, "It may be this:"), (0.8, "Most likely it is this")])
def test_a_single_cause_is_most_likely_only_above_one_half(chance, words, tmp_path):
    """Of a cause of 20 %, with 80 % for causes outside the library, the page said "most likely"."""
    causes = Causes((replace(TILT, probability=chance),), outside=1 - chance)
    write_page(replace(FOUND, members=("laser_tilt",), causes=causes), Shown(), tmp_path)
    page = (tmp_path / "diagnosis.html").read_text()
    assert [w for w in ("It may be this:", "Most likely it is this") if w in page] == [words]


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
    for names in (("baseline",), ("encoder_scale", "baseline"), ("laser_tilt", "sensor_tilt")):
        assert record_next(names, none) == record_next(names) != ""
