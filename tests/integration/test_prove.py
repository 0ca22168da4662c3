"""`boresight prove`: answers are compared with the opened truth; existing answers are not computed again."""

import json
import subprocess
from pathlib import Path

import pytest
from typer.testing import CliRunner

from pipeline.cli import app
from pipeline.commands.prove_cases import NotRenderedError, require_seal
from pipeline.drill.cases import Case, DiagnosisFailedError, diagnose_apart, find_cases
from pipeline.errors import InputError
from pipeline.simulator.truth_files import seal_truth

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
    rates = {r["name"]: r for r in proof["figures"]}
    assert (rates["named_exactly"]["value"], rates["named_exactly"]["of"]) == (1.0, 1)
    assert (rates["false_alarms"]["value"], rates["false_alarms"]["of"]) == (0.0, 1)
    assert rates["pairs_named"]["value"] is None
    assert "laser_tilt" in (drill / "out" / "proof.html").read_text()


def test_sealed_recordings_without_their_truth_are_refused(drill):
    words = ["prove", "--sealed", str(drill / "recordings"), "-o", str(drill / "out")]
    done = CliRunner().invoke(app, words)
    assert isinstance(done.exception, InputError)
    assert "--truth" in str(done.exception)


def test_a_folder_without_recordings_is_refused(tmp_path):
    with pytest.raises(InputError, match="NAME-gauge"):
        find_cases(tmp_path)


def test_a_diagnosis_that_ends_without_an_answer_is_an_error(tmp_path):
    (tmp_path / "a-gauge").mkdir()
    (tmp_path / "a-gauge" / "recording.yaml").write_text("name: x\n")
    case = Case("a", tmp_path / "a-gauge", None)
    with pytest.raises(DiagnosisFailedError, match="a: the diagnosis ended with"):
        diagnose_apart(case, tmp_path / "out")
    assert not (tmp_path / "out" / "diagnosis.json").exists()


def test_the_diagnosing_process_is_given_the_recordings_without_truth_beside_them(tmp_path, monkeypatch):
    recording = tmp_path / "recordings" / "a-gauge"
    recording.mkdir(parents=True)
    (recording / "recording.yaml").write_text("name: x\n")
    (tmp_path / "truth" / "a-gauge").mkdir(parents=True)
    seen = {}

    def process(command, cwd, **kwargs):
        given = [Path(word) for word in command if "a-gauge" in word]
        seen["given"] = given
        seen["beside"] = sorted(p.name for p in given[0].parent.iterdir())
        seen["inside"] = sorted(p.name for p in given[0].iterdir())
        answer = Path(command[command.index("-o") + 1])
        answer.mkdir()
        (answer / "diagnosis.json").write_text('{"verdict": "consistent"}')
        return subprocess.CompletedProcess(command, 0)

    monkeypatch.setattr("pipeline.drill.cases.subprocess.run", process)
    diagnose_apart(Case("a", recording, None), tmp_path / "out" / "a")
    assert (seen["beside"], seen["inside"]) == (["a-gauge"], ["recording.yaml"])
    assert str(tmp_path / "truth") not in " ".join(map(str, seen["given"]))
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["a"]


def test_an_existing_answer_is_not_computed_again(drill, monkeypatch):
    monkeypatch.setattr("pipeline.drill.cases.subprocess.run", lambda *_, **__: pytest.fail("made again"))
    for case in find_cases(drill / "recordings"):
        diagnose_apart(case, drill / "out" / "answers" / case.name)


@pytest.mark.parametrize("changed", ["recordings", "truth"])
def test_a_case_changed_after_sealing_is_not_scored(drill, changed):
    for path in (drill / "recordings").iterdir():
        seal_truth(drill / "truth" / path.name, path)
    file = {"recordings": "recording.yaml", "truth": "truth.json"}[changed]
    (case,) = (c for c in find_cases(drill / "recordings") if c.name == "a")
    require_seal(case, drill / "truth")
    with (drill / changed / "a-field" / file).open("a") as out:
        out.write(" ")
    with pytest.raises(InputError, match=f"a-field.*{file} is not what was sealed"):
        require_seal(case, drill / "truth")


def test_a_case_without_an_answer_is_counted_and_reported(drill):
    (drill / "out" / "answers" / "a" / "diagnosis.json").unlink()
    words = ["prove", "--sealed", str(drill / "recordings"), "--truth", str(drill / "truth")]
    done = CliRunner().invoke(app, [*words, "-o", str(drill / "out"), "--workers", "2"])
    assert done.exit_code == 0, done.output
    proof = json.loads((drill / "out" / "proof.json").read_text())
    figures = {r["name"]: r for r in proof["figures"]}
    assert len(proof["unanswered"]) == 1
    assert (figures["detected_any"]["value"], figures["detected_any"]["of"]) == (0.0, 1)


def test_a_pair_that_cannot_be_rendered_is_reported_and_counts_nowhere(tmp_path, monkeypatch):
    def refused(drawing, index):
        raise NotRenderedError(f"pair {index} could not be rendered: nothing would show")

    monkeypatch.setattr("pipeline.commands.prove.draw_case", refused)
    done = CliRunner().invoke(app, ["prove", "-o", str(tmp_path / "out"), "--cases", "2"])
    assert done.exit_code == 0, done.output
    proof = json.loads((tmp_path / "out" / "proof.json").read_text())
    assert [text[:6] for text in proof["not_rendered"]] == ["pair 0", "pair 1"]
    assert proof["unanswered"] == proof["trials"] == []
    assert "nothing would show" in (tmp_path / "out" / "proof.html").read_text()
