"""Scores of diagnoses: each rate counts what its name says, and broken files are refused."""

import json
from collections.abc import Iterable
from dataclasses import replace
from types import SimpleNamespace

import pytest

from pipeline.drill.answer import (
    Answer,
    Concealed,
    Feasibility,
    Fit,
    Location,
    NamedEffect,
    Remainder,
    read_answer,
    read_concealed,
)
from pipeline.drill.score import (
    Rate,
    Trial,
    calibration,
    confusion,
    figures,
    heldout_removed,
    shuffled,
    size_errors,
)
from pipeline.errors import InputError


def score(trials: Iterable[Trial]) -> SimpleNamespace:
    return SimpleNamespace(**{figure.name: figure for figure in figures(trials)})


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


def test_not_identifiable_is_neither_a_false_alarm_nor_a_detection():
    said = Answer(verdict="not_identifiable")
    assert score([Trial("a", (), said), Trial("b", (TILT,), said)]).false_alarms.count == 0
    assert score([Trial("b", (TILT,), said)]).detected.count == 0


def test_exact_names_classes_and_wrong_names_are_counted_separately():
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


def test_one_of_two_concealed_effects_does_not_count_as_both():
    trials = [
        Trial("a", (TILT, CONE), named("laser_tilt")),
        Trial("b", (TILT, CONE), named("laser_tilt", "laser_cone")),
    ]
    assert score(trials).pairs_named.count == 1


def test_for_an_effect_left_out_unexplained_or_a_class_of_similar_ones_is_right():
    trials = [
        Trial("a", (TILT,), UNEXPLAINED, ("laser_tilt",)),
        Trial("b", (TILT,), classed("principal_point", "sensor_tilt"), ("laser_tilt",)),
        Trial("c", (TILT,), named("baseline"), ("laser_tilt",)),
    ]
    result = score(trials)
    assert (result.unknown_owned.count, result.unknown_misnamed.count) == (2, 1)
    assert result.named_exactly.of == 0


def test_an_effect_left_out_that_no_oracle_could_detect_does_not_count():
    trials = [Trial("a", (TILT,), CONSISTENT, ("laser_tilt",), oracle_snr=snr) for snr in (3.0, 9.0, None)]
    assert score(trials).unknown_owned.of == 2


def test_a_name_for_an_effect_left_out_that_no_oracle_could_detect_is_wrong():
    trials = [Trial("a", (TILT,), named("baseline"), ("laser_tilt",), oracle_snr=snr) for snr in (3.0, 9.0)]
    result = score(trials)
    assert (result.misnamed.count, result.unknown_misnamed.count, result.unknown_misnamed.of) == (2, 2, 2)


def test_sizes_are_compared_in_units_of_their_stated_sigma():
    close, far = named("laser_tilt", value=0.61), named("laser_tilt", value=0.65)
    result = score([Trial("a", (TILT,), close), Trial("b", (TILT,), far)])
    assert result.size_in_95.count == 1
    assert result.size_bias_sigma.value == pytest.approx(3.0)


def test_probabilities_are_compared_with_how_often_they_are_right():
    trials = [Trial("a", (TILT,), named("laser_tilt", probability=0.9))] * 9
    trials += [Trial("b", (TILT,), named("baseline", probability=0.9))]
    [(mean, share)] = calibration(trials)
    assert mean == pytest.approx(0.9)
    assert share.share == pytest.approx(0.9)


def test_the_confusion_table_separates_names_from_verdicts():
    table = confusion([Trial("a", (TILT,), UNEXPLAINED), Trial("b", (), CONSISTENT)])
    assert table == {("laser_tilt", "(unexplained)"): 1, ("nothing", "(consistent)"): 1}


def test_the_removed_part_is_counted_above_the_noise_floor():
    fit = Fit(rms_before=1, rms_after=0.1, heldout_before=0.5, heldout_after=0.1, noise_floor=0.1)
    assert heldout_removed(Answer(verdict="named", fit=fit)) == pytest.approx(1.0)
    nothing = Fit(rms_before=0.1, rms_after=0.1, heldout_before=0.1, heldout_after=0.1, noise_floor=0.1)
    assert heldout_removed(Answer(verdict="consistent", fit=nothing)) is None
    unknown = Fit.model_validate(fit.model_dump() | {"noise_floor": None})
    assert heldout_removed(Answer(verdict="named", fit=unknown)) is None


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
    with pytest.raises(InputError, match="may be incomplete"):
        read_answer(file)
    with pytest.raises(InputError, match="No such file"):
        read_answer(tmp_path / "none.json")
    truth = tmp_path / "truth.json"
    truth.write_text('{"effects": [["laser_tilt", [0.6, 40.0]], ["laser_cone", 0.1]]}')
    assert read_concealed(truth) == (TILT, CONE)
    truth.write_text('{"effects": [7]}')
    with pytest.raises(InputError, match="effects"):
        read_concealed(truth)


def feasible(answer, detectable, left=1.0):
    entry = {"name": "laser_tilt", "detectable": detectable, "left": left, "typical": 0.05}
    return answer.model_copy(update={"feasibility": (Feasibility.model_validate(entry),)})


def test_detection_is_counted_only_where_an_oracle_would_be_sure():
    trials = [
        Trial("a", (TILT,), CONSISTENT, oracle_snr=7.9),
        Trial("b", (TILT,), CONSISTENT, oracle_snr=8.0),
        Trial("c", (TILT,), named("laser_tilt"), oracle_snr=30.0),
        Trial("d", (TILT,), CONSISTENT),
    ]
    result = score(trials)
    assert (result.detected.count, result.detected.of) == (1, 2)
    assert (result.detected_any.count, result.detected_any.of) == (1, 4)


def test_without_an_oracle_the_snr_is_taken_from_the_feasibility_of_the_answer():
    assert Trial("a", (TILT,), feasible(CONSISTENT, 0.3)).snr == pytest.approx(10.0)
    assert Trial("a", (TILT, CONE), feasible(CONSISTENT, 0.3)).snr is None
    assert Trial("a", (TILT,), feasible(CONSISTENT, None)).snr is None


def test_identifiable_effects_stand_out_even_with_their_closest_rival_free():
    assert Trial("a", (TILT,), feasible(CONSISTENT, 0.3, left=0.26)).identifiable
    assert not Trial("a", (TILT,), feasible(CONSISTENT, 0.3, left=0.24)).identifiable
    assert not Trial("a", (), feasible(CONSISTENT, 0.3)).identifiable
    told = [Trial("a", (TILT,), feasible(named("laser_tilt"), 0.3, left=x)) for x in (0.9, 0.01)]
    assert score(told).named_identifiable.of == 1


def test_with_the_answers_of_other_cases_every_score_is_bad():
    feasibility = (
        Feasibility(name="laser_tilt", detectable=0.1),
        Feasibility(name="laser_cone", detectable=0.01),
    )
    tilt = Trial("a", (TILT,), named("laser_tilt").model_copy(update={"feasibility": feasibility}))
    cone = Trial("b", (CONE,), named("laser_cone").model_copy(update={"feasibility": feasibility}))
    null = Trial("c", (), CONSISTENT)
    true, swapped = score([tilt, cone, null]), score(shuffled([tilt, cone, null]))
    assert (true.false_alarms.count, true.named_exactly.value, true.misnamed.count) == (0, 1.0, 0)
    assert (swapped.false_alarms.count, swapped.named_exactly.value, swapped.misnamed.count) == (1, 0.0, 2)
    assert swapped.contained.count == 0


def test_a_location_counts_if_channel_anchor_and_time_are_all_right():
    wrong = named("laser_tilt").model_copy(update={"location": LASER.model_copy(update={"time": "drift"})})
    result = score([Trial("a", (TILT,), named("laser_tilt")), Trial("b", (TILT,), wrong)])
    assert (result.located.count, result.channel_right.count, result.time_right.count) == (1, 2, 1)


def test_the_table_has_every_demanded_figure_once_with_its_count():
    rows = {row.name: row for row in figures([Trial("a", (TILT,), named("laser_tilt"), oracle_snr=20.0)])}
    assert {
        "false_alarms", "detected", "located", "named_identifiable", "contained", "misnamed", "pairs_named",
        "unknown_owned", "unknown_misnamed", "size_in_95", "size_bias_sigma", "heldout_removed",
    } <= set(rows)  # fmt: skip
    assert rows["detected"].text.startswith("Detected at SNR ≥ 8: 1 of 1, 100.0% [20.")
    assert rows["false_alarms"].text.startswith("False alarms where nothing is hidden: none to count")


def test_partly_counts_sure_effects_as_named_and_the_remainder_as_a_class():
    tilt = NamedEffect(name="laser_tilt", probability=0.99)
    left = Remainder.model_validate({"verdict": "class", "class": ["focal_scale", "laser_cone"]})
    partly = Answer(verdict="partly", effects=(tilt,), remainder=left)
    both = (Concealed(name="laser_tilt", values=(0.5, 10.0)), Concealed(name="laser_cone", values=(0.2,)))
    trial = Trial("a", both, partly)
    assert (trial.found, trial.exact, trial.misnamed, trial.contained) == (True, False, False, True)
    wrong = Trial("b", both[1:], partly)
    assert (wrong.misnamed, Trial("c", (), partly).misnamed) == (True, True)
    assert score([Trial("c", (), partly)]).false_alarms.count == 1


def test_an_effect_on_pictures_only_is_scored_without_a_channel():
    flicker = Trial("a", (Concealed(name="light_flicker", values=(0.1,)),), Answer(verdict="unexplained"))
    assert (score([flicker]).located.of, score([flicker]).contained.count) == (0, 0)
    named = replace(
        flicker, answer=Answer(verdict="named", effects=(NamedEffect(name="light_flicker", probability=1),))
    )
    assert score([named]).named_exactly.count == 1
    assert score([named]).size_in_95.of == 0


def test_sizes_of_a_law_that_occurs_twice_are_compared_with_the_right_ones():
    def waves(amplitude, order):
        return Concealed(name="sheet_waviness", values=(amplitude, order, 0.0))

    def told(amplitude, order):
        numbers = {"amplitude_mrad": {"value": amplitude, "sd": 0.1}, "order": {"value": order, "sd": 0.0}}
        return NamedEffect(name="sheet_waviness", probability=0.99, parameters=numbers)

    answer = Answer(verdict="named", effects=(told(0.52, 3), told(2.01, 2)))
    trial = Trial("a", (waves(2.0, 2), waves(0.5, 3), TILT), answer)
    assert sorted(size_errors(trial)) == pytest.approx([0.1, 0.2])
    # Each size is compared with one truth only, however near it is to a second.
    one = Trial("b", (waves(2.0, 3), waves(0.5, 3)), Answer(verdict="named", effects=(told(0.5, 3),) * 2))
    assert sorted(map(abs, size_errors(one))) == pytest.approx([0.0, 15.0])
    assert (one.exact, one.misnamed) == (True, False)
    # Waves of another order, or one too many, are a wrong name, though the law is concealed.
    for wrong in ((told(0.5, 3), told(2.0, 4)), (told(0.5, 3), told(0.5, 3))):
        trial = Trial("c", (waves(2.0, 2), waves(0.5, 3)), Answer(verdict="named", effects=wrong))
        assert (trial.exact, trial.misnamed) == (False, True)
        assert size_errors(trial) == pytest.approx([0.0])
