"""The disk fills, permissions go, inputs change, the clock is set back.

All are reported by name, and nothing is lost.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from pipeline.api.job import open_job, run_job
from pipeline.errors import InputError
from pipeline.export.catalogue import EXPORTERS
from pipeline.machine.configuration import resolve
from pipeline.machine.display import SilentDisplay
from pipeline.machine.outcome import RunOutcome
from pipeline.machine.plan import Selection
from stages.catalogue import PIPELINE
from tests.bad_recordings import cut_sample
from tests.faults import MeddlingDisplay, obeying_permissions, on_small_disk
from tests.patience import patience
from tests.run_content import run_content
from tests.shared_data import PROJECT_ROOT
from tests.toys import run_toys, toy_job

QUICK = ("rings.azimuths=360",)
LONG_AGO_S = 10**8


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return cut_sample(tmp_path_factory.mktemp("good") / "cut", frames=16)


@pytest.fixture(scope="module")
def whole(good: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The result of a run without faults."""
    folder = tmp_path_factory.mktemp("whole") / "run"
    run(good, folder)
    return run_content(folder)


def run(recording: Path, folder: Path, display: SilentDisplay | None = None) -> RunOutcome:
    job = open_job(recording, folder, None, PIPELINE, EXPORTERS, resolve(PIPELINE, None, QUICK))
    return run_job(job, Selection(), display or SilentDisplay())


def states(folder: Path) -> dict[str, str]:
    return {s["name"]: s["state"] for s in json.loads((folder / "run.json").read_text())["stages"]}


def cut_off(file: Path) -> None:
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])


def mirrored(file: Path) -> None:
    """Replace the recording by another one: as many frames of the same size, in reverse order."""
    lines = file.read_text().splitlines(keepends=True)
    file.write_text("".join([lines[0], *lines[:0:-1]]))


def other_bytes(file: Path) -> None:
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(content)


def test_inputs_that_change_while_stages_work(good: Path, tmp_path: Path, whole: dict[str, str]) -> None:
    """Change the inputs while each stage that reads pictures works.

    Once restored with old file times, the run goes on.
    """
    copy = shutil.copytree(good, tmp_path / "cut")
    spoils: list[tuple[str, str, Callable[[Path], object]]] = [
        ("rings", "frames.mkv", Path.unlink),
        ("rings", "frames.csv", mirrored),
        ("motion", "frames.mkv", cut_off),
        ("motion", "encoder.csv", Path.unlink),
        ("texture", "frames.mkv", other_bytes),
    ]
    done: list[str] = []
    for stage, name, spoil in spoils:
        with pytest.raises(InputError, match=r"was changed while|cannot be read any more") as refusal:
            run(copy, tmp_path / "run", MeddlingDisplay({stage: partial(spoil, copy / name)}))
        assert refusal.value.file == copy / name
        assert "same command" in refusal.value.hint
        told = states(tmp_path / "run")
        # A stage that runs at the same time may notice it first, and stop.
        assert told[stage] in ("unusable", "cancelled")
        assert "unusable" in told.values()
        assert all(told[d] in ("completed", "reused") for d in done)
        done = [n for n, state in told.items() if state in ("completed", "reused")]
        shutil.copy(good / name, copy / name)
        os.utime(copy / name, (LONG_AGO_S, LONG_AGO_S))
    ended = run(copy, tmp_path / "run")
    assert [s.state.value for s in ended.stages[:4]] == ["reused"] * 4
    assert run_content(tmp_path / "run") == whole


def removed(folder: Path) -> None:
    # Files are still being written: files that appear during the removal make a second round necessary.
    while folder.exists():
        shutil.rmtree(folder, ignore_errors=True)


def moved_away(folder: Path) -> None:
    folder.rename(folder.with_name("elsewhere"))


def file_in_its_place(folder: Path) -> None:
    moved_away(folder)
    folder.write_text("not a folder")


@pytest.mark.parametrize("lose", [removed, moved_away, file_in_its_place])
@pytest.mark.parametrize("stage", ["draw", "total"])
def test_a_run_folder_that_is_removed_during_a_run_ends_it_with_an_error(
    tmp_path: Path, stage: str, lose: Callable[[Path], object]
) -> None:
    folder = tmp_path / "run"
    job = toy_job(folder)
    with pytest.raises(InputError, match=r"run(/\.boresight)?: cannot be written"):
        run_job(job, Selection(), MeddlingDisplay({stage: partial(lose, folder)}))
    assert not folder.is_dir(), "a part of the run folder was made again"
    if (tmp_path / "elsewhere").is_dir():
        run_toys(tmp_path / "whole")
        run_toys(tmp_path / "elsewhere")
        assert run_content(tmp_path / "elsewhere") == run_content(tmp_path / "whole")


@pytest.mark.parametrize("part", [".", ".boresight"])
def test_permissions_that_are_removed_during_a_run_end_it_with_an_error(tmp_path: Path, part: str) -> None:
    folder = tmp_path / "run"
    command = [sys.executable, "-m", "tests.toys", str(folder), "draw.pause_s=0.2"]
    pipes = {"stderr": subprocess.PIPE, "text": True, "cwd": PROJECT_ROOT}
    process = subprocess.Popen(command, preexec_fn=obeying_permissions, **pipes)
    while not (folder / "run.json").is_file():
        assert process.poll() is None
        time.sleep(0.01)
    (folder / part).chmod(0o555)
    _, told = process.communicate(timeout=patience(60))
    (folder / part).chmod(0o755)
    assert process.returncode == 1
    assert "cannot be written: Permission denied" in told
    run_toys(folder, "draw.pause_s=0.2")
    run_toys(tmp_path / "whole", "draw.pause_s=0.2")
    assert run_content(folder) == run_content(tmp_path / "whole")


_FILLING = """
import shutil
from pipeline.errors import InputError
from tests.run_content import run_content
from tests.toys import run_toys
run_toys(disk.parent / "whole", "draw.count=2000")
whole, kib, refusals = run_content(disk.parent / "whole"), 0, 0
while True:
    kib += 4
    resize(kib)
    try:
        run_toys(disk / "run", "draw.count=2000")
        break
    except InputError as error:
        assert "cannot be written: " in str(error), error
        assert "No space left on device" in str(error) or "is the disk full?" in str(error), error
        refusals += 1
    resize(16384)
    run_toys(disk / "run", "draw.count=2000")
    assert run_content(disk / "run") == whole, kib
    shutil.rmtree(disk / "run")
assert run_content(disk / "run") == whole
print(refusals)
"""


def test_a_disk_that_fills_after_any_number_of_pages(tmp_path: Path) -> None:
    assert int(on_small_disk(tmp_path, _FILLING)) > 10


_FILLING_REALLY = """
import shutil
from pipeline.errors import InputError
from tests.integration.test_faults import run, states
from tests.run_content import run_content
for kib in {sizes}:
    resize(kib)
    try:
        run(Path({good!r}), disk / "run")
        raise AssertionError("it fitted")
    except InputError as error:
        assert "cannot be written: No space left on device" in str(error), error
        assert "same command then continues" in error.hint
    resize(16384)
    resumed = run(Path({good!r}), disk / "run")
    print(*(s.state.value for s in resumed.stages))
    shutil.copytree(disk / "run", disk.parent / str(kib))
    shutil.rmtree(disk / "run")
"""


def test_a_real_run_on_a_disk_that_fills(good: Path, tmp_path: Path, whole: dict[str, str]) -> None:
    told = on_small_disk(tmp_path, _FILLING_REALLY.format(sizes=(900, 3000), good=str(good)))
    reused = [line.count("reused") for line in told.splitlines()]
    assert 0 < reused[0] < reused[1], "what was computed before the disk was full is kept"
    for kib in (900, 3000):
        assert run_content(tmp_path / str(kib)) == whole


def test_a_clock_set_back_during_a_run_changes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The clock is set back between two calls and within one; the folder has files of every age."""
    run_toys(tmp_path / "whole")
    job, now = toy_job(tmp_path / "run"), time.time

    def set_back() -> None:
        monkeypatch.setattr(time, "time", lambda: now() - LONG_AGO_S)

    run_job(job, Selection(only="draw"), SilentDisplay())
    run_job(job, Selection(), MeddlingDisplay({"smooth": set_back}))
    assert run_content(tmp_path / "run") == run_content(tmp_path / "whole")
    for k, file in enumerate(sorted((tmp_path / "run").rglob("*"), reverse=True)):
        os.utime(file, (LONG_AGO_S + k, LONG_AGO_S - k))
    assert [s.state.value for s in run_job(job, Selection(), SilentDisplay()).stages] == ["reused"] * 3
    assert run_content(tmp_path / "run") == run_content(tmp_path / "whole")
