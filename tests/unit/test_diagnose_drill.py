"""Scores of diagnoses: each rate counts what it says, and broken files are refused."""

import json

import pytest

from pipeline.errors import InputError
from stages.diagnose.drill.answer import (
    Answer,
    Concealed,
    Fit,
    Location,
    NamedEffect,
    read_answer,
    read_concealed,
)
from stages.diagnose.drill.score import Rate, Trial, calibration, confusion, heldout_removed, score

TILT = Concealed(name="laser_tilt", values=(0.6, 40.0))
CONE = Concealed(name="laser_cone", values=(0.1,))
LASER = Location(channel="ring", fixed_to="laser", time="static")


def named(*names, probability=0.99, value=0.6, sd=0.01):
    effects = tuple(
        NamedEffect(name=n, probability=probability, parameters={"tilt_deg": {"value": value, "sd": sd}})
        for n in names
    )
    return Answer(verdict="named", effects=effects, location=LASER)


def classed(*names):
    return Answer.model_validate({"verdict": "class", "class": names, "location": LASER.model_dump()})


CONSISTENT, UNEXPLAINED = Answer(verdict="consistent"), Answer(verdict="unexplained", location=LASER)


def test_a_finding_where_nothing_is_hidden_is_a_false_alarm():
    trials = [Trial("a", (), CONSISTENT), Trial("b", (), named("laser_tilt")), Trial("c", (), UNEXPLAINED)]
    result = score(trials)
    assert (result.false_alarms.count, result.false_alarms.of) == (2, 3)
    assert result.misnamed.count == 1


def test_not_identifiable_is_neither_an_alarm_nor_a_detection():
    said = Answer(verdict="not_identifiable")
    assert score([Trial("a", (), said), Trial("b", (TILT,), said)]).false_alarms.count == 0
    assert score([Trial("b", (TILT,), said)]).detected.count == 0


def test_exact_names_classes_and_wrong_names_are_counted_apart():
    trials = [
        Trial("a", (TILT,), named("laser_tilt")),
        Trial("b", (TILT,), classed("laser_tilt", "principal_point")),
        Trial("c", (TILT,), named("principal_point")),
        Trial("d", (TILT,), classed("focal_scale")),
    ]
    result = score(trials)
    assert result.named_exactly.count == 1
    assert result.contained.count == 2
    assert result.misnamed.count == 1
    assert result.fixed_to_right.count == 4


def test_half_a_pair_is_no_pair():
    trials = [
        Trial("a", (TILT, CONE), named("laser_tilt")),
        Trial("b", (TILT, CONE), named("laser_tilt", "laser_cone")),
    ]
    assert score(trials).pairs_named.count == 1


def test_an_unknown_effect_is_owned_as_unknown_or_as_one_of_its_likes():
    trials = [
        Trial("a", (TILT,), UNEXPLAINED, ("laser_tilt",)),
        Trial("b", (TILT,), classed("principal_point", "sensor_tilt"), ("laser_tilt",)),
        Trial("c", (TILT,), named("baseline"), ("laser_tilt",)),
    ]
    result = score(trials)
    assert (result.unknown_owned.count, result.unknown_misnamed.count) == (2, 1)
    assert result.named_exactly.of == 0


def test_sizes_are_judged_in_their_own_sigma():
    close, far = named("laser_tilt", value=0.61), named("laser_tilt", value=0.65)
    result = score([Trial("a", (TILT,), close), Trial("b", (TILT,), far)])
    assert result.size_in_95.count == 1
    assert result.size_bias_sigma == pytest.approx(3.0)


def test_probabilities_are_held_against_how_often_they_are_right():
    trials = [Trial("a", (TILT,), named("laser_tilt", probability=0.9))] * 9
    trials += [Trial("b", (TILT,), named("baseline", probability=0.9))]
    [(mean, share)] = calibration(trials)
    assert mean == pytest.approx(0.9)
    assert share.share == pytest.approx(0.9)


def test_confusion_tells_names_from_verdicts():
    table = confusion([Trial("a", (TILT,), UNEXPLAINED), Trial("b", (), CONSISTENT)])
    assert table == {("laser_tilt", "(unexplained)"): 1, ("nothing", "(consistent)"): 1}


def test_what_is_removed_is_counted_above_the_noise_floor():
    fit = Fit(rms_before=1, rms_after=0.1, heldout_before=0.5, heldout_after=0.1, noise_floor=0.1)
    assert heldout_removed(Answer(verdict="named", fit=fit)) == pytest.approx(1.0)
    nothing = Fit(rms_before=0.1, rms_after=0.1, heldout_before=0.1, heldout_after=0.1, noise_floor=0.1)
    assert heldout_removed(Answer(verdict="consistent", fit=nothing)) is None


def test_an_interval_of_no_failures_does_not_reach_certainty():
    low, high = Rate(300, 300).interval
    assert high == 1.0
    assert 0.985 < low < 0.99


def test_answers_and_truth_are_read_and_refused(tmp_path):
    file = tmp_path / "diagnosis.json"
    file.write_text(
        json.dumps({"format": 1, "verdict": "class", "class": ["laser_tilt"], "effects": [], "more": 1})
    )
    assert read_answer(file).members == ("laser_tilt",)
    file.write_text('{"verdict": "perhaps"}')
    with pytest.raises(InputError, match="verdict"):
        read_answer(file)
    file.write_text('{"verdict": "cla')
    with pytest.raises(InputError, match="cut short"):
        read_answer(file)
    with pytest.raises(InputError, match="No such file"):
        read_answer(tmp_path / "none.json")
    truth = tmp_path / "truth.json"
    truth.write_text('{"effects": [["laser_tilt", [0.6, 40.0]], ["laser_cone", 0.1]]}')
    assert read_concealed(truth) == (TILT, CONE)
    truth.write_text('{"effects": [7]}')
    with pytest.raises(InputError, match="effects"):
        read_concealed(truth)
