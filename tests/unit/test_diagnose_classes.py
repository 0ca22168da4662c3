"""Classes of effects that one kind of recording cannot distinguish, and what to record next."""

import re

import pytest

from pipeline.physics.catalogue import CLASSES, EFFECTS
from stages.diagnose.record_next import record_next
from stages.diagnose.result import Diagnosis, Verdict, class_of, classes_of


@pytest.mark.parametrize("name", EFFECTS)
def test_an_effect_is_in_its_own_class(name):
    assert name in class_of(name)
    assert set(class_of(name)) in ({name}, *map(set, CLASSES))


def test_members_of_joined_classes_are_in_the_order_of_the_catalogue():
    joined = classes_of(["principal_point", "laser_cone"])
    assert set(joined) == {*CLASSES[0], *CLASSES[2]}
    assert list(joined) == [name for name in EFFECTS if name in joined]


def test_what_is_certain_is_no_cause_of_what_remains_unless_it_may_be_there_twice():
    """A narrower image was named, and then listed among the causes of the wave beside it."""
    assert set(classes_of(["sheet_waviness"], ["pixel_aspect"])) == {"sheet_waviness", "ovality"}
    assert "sheet_waviness" in classes_of(["sheet_waviness"], ["sheet_waviness"])


def test_what_to_record_next_names_each_recording_once():
    sentence = record_next(["laser_tilt", "principal_point", "sensor_tilt"])
    assert sentence.startswith("To tell laser_tilt, principal_point and sensor_tilt apart, record: ")
    assert sentence.count("several diameters") == 1
    assert "off-centre sweep of 8 mm" in sentence
    assert (
        record_next(["outside_index"])
        == "To confirm outside_index, record: a log of pressure and temperature."
    )


@pytest.mark.parametrize("name", [name for name in EFFECTS if name != "speckle"])  # the noise is no finding
def test_what_to_record_next_can_be_recorded(name):
    wanted = record_next([name]).partition("record: ")[2].split("; ")
    assert all(re.match("(a|an|the|bores|frames|rings|runs) ", part) for part in wanted), wanted


def test_an_unknown_effect_is_in_no_class():
    pair = ("laser_cone", "focal_scale")
    both = Diagnosis("", "", Verdict.CLASS, 0.0, members=pair)
    left = both.not_knowing(("focal_scale",))
    assert (left.verdict, left.members) == (Verdict.CLASS, ("laser_cone",))
    assert "focal_scale" not in left.record_next
    assert both.not_knowing(pair).verdict is Verdict.UNEXPLAINED
    assert both.not_knowing(()) is both
