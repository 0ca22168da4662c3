"""`boresight prove` when things go wrong: kills, changed answers and truth, unreadable files."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

from pipeline.cli import app
from pipeline.commands.prove_cases import wall_errors
from pipeline.drill.cases import Case
from pipeline.errors import InputError
from pipeline.simulator.truth_files import seal_truth
from tests.faults import obeying_permissions
from tests.patience import patience
from tests.shared_data import PROJECT_ROOT


def cut_off(file: Path) -> None:
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])


@pytest.fixture
def drill(tmp_path: Path) -> Path:
    """Two sealed probes, one with a tilted sheet, and the answer to one of them."""
    for name, effects in (("a", [["laser_tilt", [0.6, 40.0]]]), ("b", [])):
        recording, truth = tmp_path / "recordings" / f"{name}-gauge", tmp_path / "truth" / f"{name}-gauge"
        for folder in (recording, truth):
            folder.mkdir(parents=True)
        (recording / "recording.yaml").write_text("name: x\n")
        (truth / "truth.json").write_text(json.dumps({"effects": effects}))
        seal_truth(truth, recording)
    answered(tmp_path, "a")
    return tmp_path


def answered(drill: Path, name: str) -> Path:
    folder = drill / "out" / "answers" / name
    folder.mkdir(parents=True)
    (folder / "diagnosis.json").write_text(json.dumps({"format": 1, "verdict": "consistent", "effects": []}))
    return folder


def proof(drill: Path) -> list[str]:
    words = ["prove", "--sealed", str(drill / "recordings"), "--truth", str(drill / "truth")]
    return [*words, "-o", str(drill / "out")]


def half_of(file: Path) -> Path:
    cut_off(file)
    return file


def other_truth(file: Path) -> Path:
    file.write_text(json.dumps({"effects": []}))
    return file


@pytest.mark.parametrize(
    ("place", "spoil", "told"),
    [
        ("out/answers/a/diagnosis.json", half_of, "delete it, and the same command makes it again"),
        ("truth/a-gauge/truth.json", other_truth, "is not what was sealed"),
        ("truth/a-gauge/nonce.txt", lambda f: f.unlink(), "without it no hash can be checked"),
        ("truth/a-gauge", shutil.rmtree, "nonce.txt"),
        ("recordings/a-gauge/recording.yaml", half_of, "is not what was sealed"),
        ("recordings/a-gauge/sealed.yaml", half_of, "sealed.yaml"),
    ],
)
def test_a_proof_is_not_scored_with_changed_files(
    drill: Path, place: str, spoil: Callable[[Path], object], told: str
) -> None:
    answered(drill, "b")
    assert CliRunner().invoke(app, proof(drill)).exit_code == 0
    first = (drill / "out" / "proof.json").read_bytes()
    spoil(drill / place)
    done = CliRunner().invoke(app, proof(drill))
    assert isinstance(done.exception, InputError), done.output
    assert told in str(done.exception)
    assert (drill / "out" / "proof.json").read_bytes() == first


def test_a_truth_file_without_read_permission_is_named(drill: Path) -> None:
    answered(drill, "b")
    (drill / "truth" / "a-gauge" / "truth.json").chmod(0)
    done = subprocess.run(
        [sys.executable, "-m", "pipeline.cli", *proof(drill)],
        cwd=PROJECT_ROOT, capture_output=True, text=True, preexec_fn=obeying_permissions,
        timeout=patience(60),
    )  # fmt: skip
    assert done.returncode == 2
    assert "a-gauge/truth.json: cannot be read" in done.stderr
    assert "correct its permissions" in done.stderr


def test_a_killed_diagnosis_does_not_count_as_a_failed_one(
    drill: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    killed = [sys.executable, "-c", "import os; os.kill(os.getpid(), 9)"]
    monkeypatch.setattr("pipeline.drill.cases._command", lambda *_: killed)
    done = CliRunner().invoke(app, proof(drill))
    assert isinstance(done.exception, InputError), done.output
    assert "b: the diagnosis ended with -9" in str(done.exception)
    assert "same command again" in done.exception.hint
    assert not (drill / "out" / "proof.json").exists()


# Stands in for a diagnosis that is killed after its first stage, and completes once that stage's result is
# there.
_KILLED_ONCE = """
import os, pathlib, signal, sys
if {signal} == signal.SIGINT:
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # what a shell starts in the background ignores it
answer = pathlib.Path(sys.argv[1])
stage = answer / "stage"
if not stage.exists():
    stage.mkdir(parents=True)
    os.kill(os.getpid(), {signal})
(answer / "diagnosis.json").write_text('{{"verdict": "consistent", "effects": []}}')
"""


@pytest.mark.parametrize("ended_by", [signal.SIGKILL, signal.SIGINT])
def test_a_stopped_diagnosis_continues_after_its_completed_stages(
    drill: Path, monkeypatch: pytest.MonkeyPatch, ended_by: signal.Signals
) -> None:
    script = _KILLED_ONCE.format(signal=int(ended_by))
    monkeypatch.setattr(
        "pipeline.drill.cases._command",
        lambda case, output, without: [sys.executable, "-c", script, str(output)],
    )
    assert isinstance(CliRunner().invoke(app, proof(drill)).exception, InputError)
    done = CliRunner().invoke(app, proof(drill))
    assert done.exit_code == 0, done.output
    written = json.loads((drill / "out" / "proof.json").read_text())
    assert written["unanswered"] == []
    assert written["seconds"] is None, "the duration of a diagnosis that was stopped is unknown"
    assert sorted(p.name for p in (drill / "out" / "answers").iterdir()) == ["a", "b"]


def test_wall_errors_written_in_part_are_computed_again(tmp_path: Path) -> None:
    case = Case("a", None, None)
    (tmp_path / "wall_errors.json").write_text('{"stated_mm": 1')
    kept = next(iter(tmp_path.iterdir()))
    assert wall_errors(case, tmp_path, tmp_path) is None
    kept.write_text('{"stated_mm": 1.0, "corrected_mm": 0.5, "oracle_mm": 0.4}')
    assert wall_errors(case, tmp_path, tmp_path).corrected_mm == 0.5


# Stands in for a slow diagnosis; the proof is killed while it works.
_SLOW_PROOF = """
import sys
from pipeline.drill import cases
cases._command = lambda case, output, without: [sys.executable, "-c", "import time; time.sleep(600)"]
sys.argv[1:] = {words!r}
from pipeline.cli import main
main()
"""


def children_of(pid: int) -> Iterator[int]:
    for task in Path(f"/proc/{pid}/task").iterdir():
        yield from map(int, (task / "children").read_text().split())


def test_a_proof_killed_during_a_diagnosis_leaves_no_process_and_no_partial_files(drill: Path) -> None:
    command = [sys.executable, "-c", _SLOW_PROOF.format(words=proof(drill))]
    process = subprocess.Popen(command, cwd=PROJECT_ROOT)
    until = time.monotonic() + patience(60)
    while not (below := [c for c in children_of(process.pid)]):
        assert process.poll() is None
        assert time.monotonic() < until
        time.sleep(0.05)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    while any(Path(f"/proc/{child}").exists() for child in below):
        assert time.monotonic() < until, "a diagnosis goes on without its proof"
        time.sleep(0.05)
    left = [p.name for p in (drill / "out" / "answers").iterdir()]
    assert any(name.startswith(".apart-") for name in left), "otherwise this test shows nothing"
    answered(drill, "b")
    assert CliRunner().invoke(app, proof(drill)).exit_code == 0
    assert sorted(p.name for p in (drill / "out" / "answers").iterdir()) == ["a", "b"]
