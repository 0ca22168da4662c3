"""Calibration and diagnosis from a script: typed, equal to the commands' results, and with clear refusals."""

import json
from dataclasses import replace
from typing import Annotated

import numpy as np
import pytest
from typer.testing import CliRunner

from pipeline.api import boresight
from pipeline.api.diagnosis import diagnose as diagnosing
from pipeline.cli import app
from pipeline.instrument.probe import Probe
from pipeline.machine.stage import Context, Of, Parameters, Stage
from pipeline.recording.base import Recording
from stages.diagnose.as_json import to_json
from stages.diagnose.diagnose import Diagnosed
from stages.diagnose.result import Diagnosis, EffectFound, FitQuality, Location, Value, Verdict
from tests.bad_recordings import cut_sample

TILT = EffectFound(
    "laser_tilt", 0.99, {"tilt_deg": Value(0.61, 0.01), "direction_deg": Value(40.0, float("nan"))},
    "The sheet leans by 0.61 ± 0.01°.", "δr = −r x",
)  # fmt: skip
FOUND = Diagnosis(
    "field", "gauge", Verdict.NAMED, 1e-9, effects=(TILT,), members=("laser_tilt", "principal_point"),
    fit=FitQuality("px", 0.4, 0.08, 0.41, 0.08, float("nan")), record_next="Roll the probe by a full turn.",
)  # fmt: skip


def test_a_diagnosis_is_read_as_it_was_written(tmp_path):
    (tmp_path / "diagnosis.json").write_text(json.dumps(to_json(FOUND), allow_nan=False))
    answer = boresight.open_diagnosis(str(tmp_path)).answer
    assert (answer.verdict, answer.global_p) == ("named", 1e-9)
    assert answer.members == ("laser_tilt", "principal_point")
    assert answer.record_next == "Roll the probe by a full turn."
    (effect,) = answer.effects
    assert (effect.name, effect.probability, effect.statement) == ("laser_tilt", 0.99, TILT.statement)
    tilt, direction = effect.parameters["tilt_deg"], effect.parameters["direction_deg"]
    assert (tilt.value, tilt.sd, direction.value) == (0.61, 0.01, 40.0)
    assert np.isnan(direction.sd), "an unknown value is not taken for a number"


def test_every_effect_has_its_place_and_the_names_that_cannot_be_distinguished_from_it():
    place = Location("motion", "time", "event", frames=(131, 133))
    (alone,) = to_json(replace(FOUND, location=place))["effects"]
    assert alone["location"] == {
        "channel": "motion",
        "fixed_to": "time",
        "time": "event",
        "frames": [131, 133],
    }
    assert alone["credible_set"] == ["laser_tilt"], "a sure name is the only one"
    (doubted,) = to_json(replace(FOUND, verdict=Verdict.CLASS))["effects"]
    assert doubted["credible_set"] == ["laser_tilt", "principal_point"]
    two = to_json(replace(FOUND, location=place, effects=(TILT, TILT)))["effects"]
    assert [e["location"] for e in two] == [None, None], "a class of both belongs to neither"


def test_a_folder_without_a_diagnosis_is_refused(tmp_path):
    with pytest.raises(boresight.InputError, match=r"diagnosis\.json"):
        boresight.open_diagnosis(tmp_path)


def test_a_run_of_an_older_boresight_is_refused_with_the_reason(tmp_path):
    parts = ("probe", "input_sha256", "configuration", "stages", "metrics", "reader_warnings")
    older = {"format": 1, "state": "completed", **{part: {} for part in parts}}
    (tmp_path / "run.json").write_text(json.dumps(older))
    with pytest.raises(
        boresight.InputError, match=r"run\.json.*older boresight: it lacks warnings"
    ) as refusal:
        boresight.open_run(tmp_path)
    assert "run it again" in refusal.value.hint
    (tmp_path / "run.json").write_text(json.dumps(older | {"warnings": []}))
    boresight.open_run(tmp_path)


def find_tilt(
    field: Annotated[Recording, Of("field")], probe: Probe, *, parameters: Parameters, context: Context
) -> Diagnosed:
    context.warn("frames 3 to 5 were left out")
    return Diagnosed(replace(FOUND, recording=field.name), probe, None)


@pytest.fixture
def recording(tmp_path, monkeypatch):
    """A short recording, and a diagnosis whose stage names a tilt at once."""
    stage = Stage("diagnosis", "1", Parameters, find_tilt)
    monkeypatch.setattr(diagnosing, "diagnosis_stages", lambda *_: (stage,))
    return cut_sample(tmp_path / "recording", 20)


def test_a_diagnosis_from_a_script_equals_that_of_the_command(tmp_path, recording):
    found = boresight.diagnose(recording, output=tmp_path / "script")
    assert found.answer.effects[0].parameters["tilt_deg"].value == 0.61
    assert "diagnosis: frames 3 to 5 were left out" in found.warnings
    assert found.consequence == ""
    told = CliRunner().invoke(app, ["diagnose", str(recording), "-o", str(tmp_path / "command")])
    assert told.exit_code == 0, told.output
    assert "laser_tilt (99.0%): The sheet leans" in told.output
    assert "frames 3 to 5" in told.output
    for name in ("diagnosis.json", "probe.yaml"):
        assert (tmp_path / "script" / name).read_bytes() == (tmp_path / "command" / name).read_bytes()
    assert repr(boresight.open_diagnosis(tmp_path / "command").answer) == repr(found.answer)


def test_missing_inputs_of_a_diagnosis_are_reported_before_it_starts(tmp_path, recording):
    with pytest.raises(boresight.InputError, match="no recording"):
        boresight.diagnose(output=tmp_path / "out")
    with pytest.raises(boresight.InputError, match="needs an inspection and a gauge run"):
        boresight.diagnose(recording, output=tmp_path / "out", apply=True)
    assert not (tmp_path / "out").exists()


def test_an_inspection_is_refused_for_calibration(tmp_path, recording):
    with pytest.raises(boresight.InputError, match="it is not a gauge run"):
        boresight.calibrate(recording, tmp_path / "out", settings=["gauge.iterations=9"])
    assert not (tmp_path / "out").exists()
