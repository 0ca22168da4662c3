"""Calibrate, diagnose and prove when things go wrong: killed, no room, no permission, inputs that change."""

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
from pipeline.commands import calibrate as calibrating
from pipeline.commands import calibrate_camera as calibrating_camera
from pipeline.commands import diagnose as diagnosing
from pipeline.commands.prove_geometry import wall_errors
from pipeline.errors import InputError
from pipeline.simulator.seal import seal_truth
from stages.diagnose.drill.cases import Case
from tests.bad_recordings import cut_sample
from tests.faults import obeying_permissions, on_small_disk
from tests.shared_data import PROJECT_ROOT

RESULTS = ("a.bin", "b.bin", "answer.json")
# A call of a command as far as its files go; it is killed at the step that is asked for.
_WRITING = """
import os, signal, sys
from pathlib import Path
folder, generation, last_step = Path(sys.argv[1]), sys.argv[2].encode(), int(sys.argv[3])
steps = 0
def counted(function):
    def step(*arguments, **named):
        global steps
        steps += 1
        if steps == last_step:
            os.kill(os.getpid(), signal.SIGKILL)
        return function(*arguments, **named)
    return step
from pipeline.disk import written_together
for name in ("mkdir", "replace", "unlink", "rename", "rmdir"):
    setattr(Path, name, counted(getattr(Path, name)))
os.fsync = counted(os.fsync)
with written_together(folder, last="answer.json") as new:
    for name in ("a.bin", "b.bin", "answer.json"):
        with (new / name).open("wb") as file:
            file.write(5000 * generation)
            file.flush()
            os.fsync(file.fileno())
"""


def generations(folder: Path) -> set[bytes]:
    """Return which calls the files are of, each of them whole; empty where the answer is not there."""
    if not (folder / "answer.json").exists():
        return set()
    contents = [(folder / name).read_bytes() for name in RESULTS]
    assert all(len(c) == 5000 and len(set(c)) == 1 for c in contents)
    return {c[:1] for c in contents}


def test_killed_at_any_step_the_answer_stands_for_all_files_of_one_call(tmp_path: Path) -> None:
    killed, answers = 0, []
    while True:
        folder = tmp_path / str(killed)
        for generation, step in (("1", "0"), ("2", str(killed + 1))):
            done = subprocess.run(
                [sys.executable, "-c", _WRITING, str(folder), generation, step], cwd=PROJECT_ROOT
            )
        answers.append(generations(folder))
        assert answers[-1] in (set(), {b"1"}, {b"2"})
        if done.returncode == 0:
            break
        assert done.returncode == -signal.SIGKILL
        killed += 1
        again = [sys.executable, "-c", _WRITING, str(folder), "3", "0"]
        subprocess.run(again, cwd=PROJECT_ROOT, check=True)
        assert generations(folder) == {b"3"}
        assert sorted(p.name for p in folder.iterdir()) == sorted(RESULTS), "what was left is swept"
    assert killed > 8
    assert answers[0] == {b"1"}
    assert set() in answers  # the old answer is taken away before the first new file takes its place
    assert answers[-1] == {b"2"}


_FULL = """
from pipeline.disk import written_together
from pipeline.errors import InputError
def write(generation):
    with written_together(disk / "out", last="answer.json") as new:
        for name in ("a.bin", "b.bin", "answer.json"):
            (new / name).write_bytes(5000 * generation)
write(b"1")
refused = 0
for kib in range(28, 80, 4):
    resize(kib)
    try:
        write(b"2")
        break
    except InputError as error:
        refused += 1
        assert "cannot be written: No space left on device" in str(error), error
        assert sorted(p.name for p in (disk / "out").iterdir()) == ["a.bin", "answer.json", "b.bin"]
        assert {f.read_bytes()[:1] for f in (disk / "out").iterdir()} == {b"1"}
assert {f.read_bytes() for f in (disk / "out").iterdir()} == {5000 * b"2"}
print(refused)
"""


def test_on_a_disk_that_fills_the_results_of_the_earlier_call_stay(tmp_path: Path) -> None:
    assert int(on_small_disk(tmp_path, _FULL)) >= 3


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    return cut_sample(tmp_path / "cut", frames=8)


def removed(file: Path) -> None:
    file.unlink()


def other_bytes(file: Path) -> None:
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(content)


def cut_off(file: Path) -> None:
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])


class ReachedError(Exception):
    """The command went on to write its results."""


def unexpectedly(*_: object, **__: object) -> None:
    raise ReachedError


@pytest.mark.parametrize("spoil", [removed, other_bytes, cut_off])
@pytest.mark.parametrize("name", ["frames.mkv", "frames.csv", "encoder.csv"])
def test_a_recording_that_changes_while_it_is_measured_gives_no_result(
    recording: Path, monkeypatch: pytest.MonkeyPatch, name: str, spoil: Callable[[Path], None]
) -> None:
    """What the commands measure is left out here: the change is told whatever was made of the recording."""

    def meddling(*_: object) -> None:
        spoil(recording / name)

    monkeypatch.setattr(calibrating, "require_gauge", lambda recording: None)
    monkeypatch.setattr(calibrating, "extract_rings", meddling)
    monkeypatch.setattr(calibrating, "calibrate_gauge", lambda *_: None)
    monkeypatch.setattr(calibrating, "written_together", unexpectedly)
    kept = (recording / name).read_bytes()
    for command in ("calibrate", "diagnose"):
        (recording / name).write_bytes(kept)
        monkeypatch.setattr(diagnosing, "diagnose_recordings", meddling)
        monkeypatch.setattr(diagnosing, "resimulate", lambda examination: None)
        output = recording.parent / f"out-{command}"
        done = CliRunner().invoke(app, [command, str(recording), "-o", str(output)])
        assert isinstance(done.exception, InputError), done.output
        assert done.exception.file == recording / name
        assert "changed while" in str(done.exception) or "cannot be read any more" in str(done.exception)
        assert "same command again" in done.exception.hint
        assert not output.exists()


def test_a_recording_that_is_only_touched_is_no_fault(
    recording: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(calibrating, "require_gauge", lambda recording: None)
    monkeypatch.setattr(calibrating, "extract_rings", lambda *_: os.utime(recording / "frames.mkv", (1, 1)))
    monkeypatch.setattr(calibrating, "calibrate_gauge", lambda *_: None)
    monkeypatch.setattr(calibrating, "written_together", unexpectedly)
    done = CliRunner().invoke(app, ["calibrate", str(recording), "-o", str(recording.parent / "out")])
    assert isinstance(done.exception, ReachedError | AttributeError), done.output


def test_pictures_that_change_while_they_are_read_give_no_camera(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pictures = tmp_path / "pictures"
    pictures.mkdir()
    (pictures / "1.png").write_bytes(b"first")
    (pictures / "2.png").write_bytes(b"second")

    def meddling(*_: object) -> tuple[list[object], tuple[int, int], list[object]]:
        other_bytes(pictures / "2.png")
        return [], (8, 8), []

    class Report:
        def with_rejected(self, rejected: object) -> object:
            return self

    monkeypatch.setattr(calibrating_camera, "find_boards", meddling)
    monkeypatch.setattr(calibrating_camera, "calibrate_boards", lambda *_: Report())
    words = ["calibrate-camera", str(pictures), "--columns", "9", "--rows", "6", "--square-mm", "10"]
    done = CliRunner().invoke(app, [*words, "-o", str(tmp_path / "out")])
    assert isinstance(done.exception, InputError), done.output
    assert done.exception.file == pictures / "2.png"
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("name", "spoil", "told"),
    [
        ("frames.mkv", removed, "is missing"),
        ("frames.csv", cut_off, r"frames.csv"),
        ("probe.yaml", cut_off, "probe.yaml"),
        ("recording.yaml", cut_off, "recording.yaml"),
    ],
)
@pytest.mark.parametrize("command", ["calibrate", "diagnose"])
def test_a_spoiled_recording_is_refused_by_name_before_anything_is_written(
    recording: Path, command: str, name: str, spoil: Callable[[Path], None], told: str
) -> None:
    spoil(recording / name)
    done = CliRunner().invoke(app, [command, str(recording), "-o", str(recording.parent / "out")])
    assert isinstance(done.exception, InputError), done.output
    assert told in str(done.exception)
    assert not (recording.parent / "out").exists()


@pytest.mark.parametrize("command", ["calibrate", "diagnose", "prove"])
def test_a_folder_that_may_not_be_written_is_told_before_work_is_put_in(
    recording: Path, tmp_path: Path, command: str
) -> None:
    locked = tmp_path / "locked"
    locked.mkdir()
    locked.chmod(0o555)
    if command == "calibrate":
        (recording / "recording.yaml").write_text(
            (recording / "recording.yaml").read_text().replace("inspection", "gauge")
            + "bore: [{length_mm: 100, diameter_mm: 101.6}]\nbore_tolerance_mm: 0.01\n"
        )
    words = ["prove"] if command == "prove" else [command, str(recording)]
    done = subprocess.run(
        [sys.executable, "-m", "pipeline.cli", *words, "-o", str(locked)],
        cwd=PROJECT_ROOT, capture_output=True, text=True, preexec_fn=obeying_permissions, timeout=60,
    )  # fmt: skip
    locked.chmod(0o755)
    assert done.returncode == 2, done.stderr
    if command != "calibrate":  # this recording is no gauge's, which is told first
        assert "locked: cannot be written: Permission denied" in done.stderr
        assert "What to do" in done.stderr


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
        ("out/answers/a/diagnosis.json", half_of, "removed is made again"),
        ("truth/a-gauge/truth.json", other_truth, "is not what was sealed"),
        ("truth/a-gauge/nonce.txt", lambda f: f.unlink(), "without it no hash can be checked"),
        ("truth/a-gauge", shutil.rmtree, "nonce.txt"),
        ("recordings/a-gauge/recording.yaml", half_of, "is not what was sealed"),
        ("recordings/a-gauge/sealed.yaml", half_of, "sealed.yaml"),
    ],
)
def test_a_proof_is_not_scored_from_what_was_changed(
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


def test_a_truth_that_may_not_be_read_is_named(drill: Path) -> None:
    answered(drill, "b")
    (drill / "truth" / "a-gauge" / "truth.json").chmod(0)
    done = subprocess.run(
        [sys.executable, "-m", "pipeline.cli", *proof(drill)],
        cwd=PROJECT_ROOT, capture_output=True, text=True, preexec_fn=obeying_permissions, timeout=60,
    )  # fmt: skip
    assert done.returncode == 2
    assert "a-gauge/truth.json: cannot be read" in done.stderr
    assert "mend its permissions" in done.stderr


def test_a_diagnosis_that_was_killed_is_no_failure_of_the_diagnosis(
    drill: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    killed = [sys.executable, "-c", "import os; os.kill(os.getpid(), 9)"]
    monkeypatch.setattr("stages.diagnose.drill.cases._command", lambda *_: killed)
    done = CliRunner().invoke(app, proof(drill))
    assert isinstance(done.exception, InputError), done.output
    assert "b: the diagnosis ended with -9" in str(done.exception)
    assert "same command again" in done.exception.hint
    assert not (drill / "out" / "proof.json").exists()


def test_wall_errors_kept_half_are_worked_out_again(tmp_path: Path) -> None:
    case = Case("a", None, None)
    (tmp_path / "wall_errors.json").write_text('{"stated_mm": 1')
    kept = next(iter(tmp_path.iterdir()))
    assert wall_errors(case, tmp_path, tmp_path) is None
    kept.write_text('{"stated_mm": 1.0, "corrected_mm": 0.5, "oracle_mm": 0.4}')
    assert wall_errors(case, tmp_path, tmp_path).corrected_mm == 0.5


# Stands for a diagnosis that takes its time; the proof is killed while it is at work.
_SLOW_PROOF = """
import sys
from stages.diagnose.drill import cases
cases._command = lambda case, output, without: [sys.executable, "-c", "import time; time.sleep(600)"]
sys.argv[1:] = {words!r}
from pipeline.cli import main
main()
"""


def children_of(pid: int) -> Iterator[int]:
    for task in Path(f"/proc/{pid}/task").iterdir():
        yield from map(int, (task / "children").read_text().split())


def test_a_proof_killed_amid_a_diagnosis_leaves_no_process_and_no_rest(drill: Path) -> None:
    command = [sys.executable, "-c", _SLOW_PROOF.format(words=proof(drill))]
    process = subprocess.Popen(command, cwd=PROJECT_ROOT)
    until = time.monotonic() + 60
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
    assert any(name.startswith(".apart-") for name in left), "else this test shows nothing"
    answered(drill, "b")
    assert CliRunner().invoke(app, proof(drill)).exit_code == 0
    assert sorted(p.name for p in (drill / "out" / "answers").iterdir()) == ["a", "b"]
