"""The proof: answers beside opened truth, without a diagnosis of its own where answers are there."""

import json

import pytest
from typer.testing import CliRunner

from pipeline.cli import app
from pipeline.errors import InputError
from stages.diagnose.drill.cases import Case, DiagnosisFailedError, diagnose_apart, find_cases

TILT = {"name": "laser_tilt", "probability": 0.99, "parameters": {"tilt_deg": {"value": 0.61, "sd": 0.01}}}


@pytest.fixture
def drill(tmp_path):
    """Two probes, one with a tilted sheet, and the answers to both."""
    for name, effects in (("a", [["laser_tilt", [0.6, 40.0]]]), ("b", [])):
        for kind in ("gauge", "field"):
            recording = tmp_path / "recordings" / f"{name}-{kind}"
            truth = tmp_path / "truth" / recording.name
            recording.mkdir(parents=True)
            truth.mkdir(parents=True)
            (recording / "recording.yaml").write_text("name: x\n")
            (truth / "truth.json").write_text(json.dumps({"effects": effects}))
    for name, answer in (("a", {"verdict": "named", "effects": [TILT]}), ("b", {"verdict": "consistent"})):
        folder = tmp_path / "out" / "answers" / name
        folder.mkdir(parents=True)
        (folder / "diagnosis.json").write_text(json.dumps({"format": 1, "effects": [], **answer}))
    return tmp_path


def test_answers_are_scored_against_the_opened_truth(drill):
    words = ["prove", "--sealed", str(drill / "recordings"), "--truth", str(drill / "truth")]
    done = CliRunner().invoke(app, [*words, "-o", str(drill / "out")])
    assert done.exit_code == 0, done.output
    proof = json.loads((drill / "out" / "proof.json").read_text())
    rates = {r["name"]: r for r in proof["rates"]}
    assert (rates["named_exactly"]["share"], rates["named_exactly"]["of"]) == (1.0, 1)
    assert (rates["false_alarms"]["share"], rates["false_alarms"]["of"]) == (0.0, 1)
    assert rates["pairs_named"]["share"] is None
    assert "laser_tilt" in (drill / "out" / "proof.html").read_text()


def test_sealed_recordings_without_their_truth_are_refused(drill):
    words = ["prove", "--sealed", str(drill / "recordings"), "-o", str(drill / "out")]
    done = CliRunner().invoke(app, words)
    assert isinstance(done.exception, InputError)
    assert "--truth" in str(done.exception)


def test_a_folder_without_recordings_is_no_drill(tmp_path):
    with pytest.raises(InputError, match="NAME-gauge"):
        find_cases(tmp_path)


def test_a_diagnosis_that_ends_without_an_answer_is_an_error_not_an_answer(tmp_path):
    case = Case("a", tmp_path / "a-gauge", None)
    with pytest.raises(DiagnosisFailedError, match="a: the diagnosis ended with"):
        diagnose_apart(case, tmp_path / "out")
    assert not (tmp_path / "out" / "diagnosis.json").exists()
