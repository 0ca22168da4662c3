"""Calibrate and diagnose when things go wrong: kills, a full disk, no permission, inputs that change."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest
from typer.testing import CliRunner

from pipeline.api import calibrate as calibrating
from pipeline.api.diagnosis import diagnose as diagnosing
from pipeline.cli import app
from pipeline.commands import calibrate_camera as calibrating_camera
from pipeline.errors import InputError
from pipeline.machine.stage import Context, Parameters, Stage
from pipeline.recording.base import Recording
from stages.calibrate.boards import Pictures
from tests.bad_recordings import cut_sample
from tests.faults import obeying_permissions, on_small_disk
from tests.patience import patience
from tests.shared_data import PROJECT_ROOT

RESULTS = ("a.bin", "b.bin", "answer.json")
# Writes the files of one call of a command; the process is killed at the given step.
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
from pipeline.files.disk import written_together
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
    """Return by which calls the present files were written; empty where there is no answer."""
    if not (folder / "answer.json").exists():
        return set()
    contents = [(folder / name).read_bytes() for name in RESULTS]
    assert all(len(c) == 5000 and len(set(c)) == 1 for c in contents)
    return {c[:1] for c in contents}


def test_killed_at_any_step_the_files_present_are_all_of_one_call(tmp_path: Path) -> None:
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
        assert sorted(p.name for p in folder.iterdir()) == sorted(RESULTS), "left-over files are removed"
    assert killed > 8
    assert answers[0] == {b"1"}
    assert set() in answers  # the old answer is removed before the first new file replaces its own
    assert answers[-1] == {b"2"}


_FULL = """
from pipeline.files.disk import written_together
from pipeline.errors import InputError
from pipeline.machine.stage import Context, Parameters, Stage
from pipeline.recording.base import Recording
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


def test_when_the_disk_fills_the_results_of_the_earlier_call_stay(tmp_path: Path) -> None:
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
    """The command has reached the point at which it writes its results."""


def unexpectedly(*_: object, **__: object) -> None:
    raise ReachedError


@pytest.mark.parametrize("spoil", [removed, other_bytes, cut_off])
@pytest.mark.parametrize("name", ["frames.mkv", "frames.csv", "encoder.csv"])
def test_a_recording_that_changes_while_it_is_measured_gives_no_result(
    recording: Path, monkeypatch: pytest.MonkeyPatch, name: str, spoil: Callable[[Path], None]
) -> None:
    """The measurement is skipped: the change of the recording is reported whatever was measured."""

    def meddling(*_: object) -> None:
        spoil(recording / name)

    meddle_with_calibration(monkeypatch, meddling)
    kept = (recording / name).read_bytes()
    for command in ("calibrate", "diagnose"):
        (recording / name).write_bytes(kept)
        output = recording.parent / f"out-{command}"
        done = CliRunner().invoke(app, [command, str(recording), "-o", str(output)])
        assert isinstance(done.exception, InputError), done.output
        assert done.exception.file == recording / name
        assert "changed while" in str(done.exception) or "cannot be read any more" in str(done.exception)
        assert "same command again" in done.exception.hint
        assert not (output / "probe.yaml").exists()


@dataclass(frozen=True)
class Measured:
    """The result of the stage that changes the recording."""


def measure_meddled(recording: Recording, *, parameters: Parameters, context: Context) -> Measured:
    MEDDLING[-1]()
    return Measured()


def measure_meddled_pictures(pictures: Pictures, *, parameters: Parameters, context: Context) -> Measured:
    MEDDLING[-1]()
    return Measured()


MEDDLING: list[Callable[[], None]] = []


def meddle_with_calibration(monkeypatch: pytest.MonkeyPatch, meddling: Callable[[], None]) -> None:
    MEDDLING.append(meddling)
    stage = Stage("measured", "1", Parameters, measure_meddled)
    monkeypatch.setattr(calibrating, "require_gauge", lambda recording: None)
    monkeypatch.setattr(calibrating, "STAGES", (stage,))
    monkeypatch.setattr(calibrating, "EXPORTERS", ())
    monkeypatch.setattr(calibrating, "result_of", unexpectedly)
    monkeypatch.setattr(diagnosing, "diagnosis_stages", lambda *_: (stage.for_role("field"),))
    monkeypatch.setattr(diagnosing, "EXPORTERS", ())
    monkeypatch.setattr(diagnosing, "result_of", unexpectedly)


def test_a_recording_of_which_only_the_file_times_change_is_accepted(
    recording: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    meddle_with_calibration(monkeypatch, lambda: os.utime(recording / "frames.mkv", (1, 1)))
    done = CliRunner().invoke(app, ["calibrate", str(recording), "-o", str(recording.parent / "out")])
    assert isinstance(done.exception, ReachedError), done.output


def test_pictures_that_change_while_they_are_read_give_no_camera(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pictures = tmp_path / "pictures"
    pictures.mkdir()
    (pictures / "1.png").write_bytes(b"first")
    (pictures / "2.png").write_bytes(b"second")

    MEDDLING.append(lambda: other_bytes(pictures / "2.png"))
    stage = Stage("boards", "1", Parameters, measure_meddled_pictures)
    monkeypatch.setattr(calibrating_camera, "STAGES", (stage,))
    monkeypatch.setattr(calibrating_camera, "EXPORTERS", ())
    monkeypatch.setattr(calibrating_camera, "result_of", unexpectedly)
    words = ["calibrate-camera", str(pictures), "--columns", "9", "--rows", "6", "--square-mm", "10"]
    done = CliRunner().invoke(app, [*words, "-o", str(tmp_path / "out")])
    assert isinstance(done.exception, InputError), done.output
    assert done.exception.file == pictures / "2.png"
    assert not (tmp_path / "out" / "camera.yaml").exists()


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
def test_a_spoiled_recording_is_refused_with_its_name_before_anything_is_written(
    recording: Path, command: str, name: str, spoil: Callable[[Path], None], told: str
) -> None:
    spoil(recording / name)
    done = CliRunner().invoke(app, [command, str(recording), "-o", str(recording.parent / "out")])
    assert isinstance(done.exception, InputError), done.output
    assert told in str(done.exception)
    assert not (recording.parent / "out").exists()


@pytest.mark.parametrize("command", ["calibrate", "diagnose", "prove"])
def test_a_folder_without_write_permission_is_reported_before_the_work_begins(
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
        cwd=PROJECT_ROOT, capture_output=True, text=True, preexec_fn=obeying_permissions,
        timeout=patience(60),
    )  # fmt: skip
    locked.chmod(0o755)
    assert done.returncode == 2, done.stderr
    if command != "calibrate":  # this recording is not of a gauge, which is reported first
        assert "locked: cannot be written: Permission denied" in done.stderr
        assert "What to do" in done.stderr
