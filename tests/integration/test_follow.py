"""A recording is followed while it is written; the result equals that of a run made afterwards."""

from __future__ import annotations

import csv
import re
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from pipeline.commands.follow import Snapshot, new_sections, restarted, snapshots
from pipeline.errors import Cancelled, InputError
from pipeline.instrument.probe_file import read_probe
from pipeline.recording import open_recording
from stages.preview import preliminary_sections
from stages.rings import RingParameters
from tests.bad_recordings import cut_sample
from tests.quiet import quiet_context
from tests.shared_data import PROJECT_ROOT

QUICK = ("--set", "rings.azimuths=360")
FEW = RingParameters.model_validate({"azimuths": 360})


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return cut_sample(tmp_path_factory.mktemp("followed") / "cut", frames=24)


def written_slowly(whole: Path, growing: Path, pieces: int, pause_s: float) -> None:
    """Write a recording as a recorder does: the description first, then tables and video piece by piece."""
    growing.mkdir()
    for name in ("recording.yaml", "probe.yaml"):
        shutil.copy(whole / name, growing / name)
    rest = {n: (whole / n).read_bytes() for n in ("encoder.csv", "frames.csv", "frames.mkv")}
    for k in range(pieces):
        for name, content in rest.items():
            with (growing / name).open("ab") as file:
                file.write(content[len(content) * k // pieces : len(content) * (k + 1) // pieces])
        time.sleep(pause_s)


def run(recording: Path, output: Path, *more: str) -> None:
    command = [sys.executable, "-m", "pipeline.cli", "run", str(recording), "-o", str(output), *QUICK, *more]
    told = subprocess.run(command, cwd=PROJECT_ROOT, capture_output=True, text=True)
    assert told.returncode == 0, told.stderr


def test_following_and_a_later_run_give_the_same_result(whole: Path, tmp_path: Path) -> None:
    growing = tmp_path / "cut"
    writer = threading.Thread(target=written_slowly, args=(whole, growing, 6, 0.3))
    writer.start()
    run(growing, tmp_path / "followed", "--follow", "--quiet-s", "4")
    writer.join()
    run(whole, tmp_path / "afterwards")
    for name in ("radius_map.npz", "trajectory.csv", "defects.json", "model.glb"):
        followed, afterwards = (tmp_path / kind / name for kind in ("followed", "afterwards"))
        assert followed.read_bytes() == afterwards.read_bytes(), name
    page = (tmp_path / "followed" / "live.html").read_text("utf-8")
    with (whole / "frames.csv").open() as file:
        rings = sum(row["illumination"] == "laser" for row in csv.DictReader(file))
    assert f"<dd>{rings}</dd>" in page, "every ring is on the page when the recording is complete"
    assert 'http-equiv="refresh"' not in page
    (diameter,) = re.findall(r"([\d.]+) ± ", page)
    assert abs(float(diameter) - 101.6) < 1.0


def test_the_preliminary_diameter_is_about_right_and_no_section_is_reported_twice(whole: Path) -> None:
    recording = open_recording(whole)
    probe = read_probe(recording.probe_file)
    early = preliminary_sections(recording, probe, -1, FEW, quiet_context())
    late = preliminary_sections(recording, probe, early[3].frame, FEW, quiet_context())
    assert [s.frame for s in late] == [s.frame for s in early[4:]]
    assert all(abs(s.diameter_mm - 101.6) < 3 * s.diameter_sigma_mm + 0.1 for s in early)
    assert all(0 < s.diameter_sigma_mm < 0.3 and s.seen > 0.5 for s in early)


def copied(whole: Path, tmp_path: Path) -> Path:
    return shutil.copytree(whole, tmp_path / "followed")


def half_written(file: Path) -> None:
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])


@pytest.mark.parametrize(
    ("name", "spoil"),
    [("frames.mkv", Path.unlink), ("probe.yaml", half_written), ("probe.yaml", Path.unlink)],
)
def test_unreadable_files_are_tried_again_until_the_recording_is_complete(
    whole: Path, tmp_path: Path, name: str, spoil: Callable[[Path], None]
) -> None:
    """A drive that drops out, or a file being written, does not end following; it is reported at the end."""
    folder = copied(whole, tmp_path)
    snapshot = Snapshot(open_recording(folder), "", complete=False)
    spoil(folder / name)
    assert new_sections(snapshot, None, -1, quiet_context()) == ()
    with pytest.raises(InputError, match=name):
        new_sections(replace(snapshot, complete=True), None, -1, quiet_context())


def test_when_the_recorder_starts_again_the_display_starts_again(whole: Path, tmp_path: Path) -> None:
    folder = copied(whole, tmp_path)
    assert not restarted(Snapshot(open_recording(folder), "", complete=False), shown=20)
    cut_sample(tmp_path / "anew", frames=8)
    for file in (tmp_path / "anew").iterdir():
        shutil.copy(file, folder / file.name)
    assert restarted(Snapshot(open_recording(folder), "", complete=False), shown=20)
    assert not restarted(Snapshot(None, "not there", complete=False), shown=20)


def test_files_may_appear_and_vanish_while_they_are_counted(tmp_path: Path) -> None:
    stop = threading.Event()

    def come_and_go() -> None:
        while not stop.is_set():
            for k in range(20):
                (tmp_path / f"{k}.csv").write_text("x" * k)
            for k in range(20):
                (tmp_path / f"{k}.csv").unlink()

    writer = threading.Thread(target=come_and_go)
    writer.start()
    try:
        seen = snapshots(tmp_path, 60.0, 0.0, threading.Event())
        assert all(next(seen).recording is None for _ in range(100))
    finally:
        stop.set()
        writer.join()


def test_missing_files_are_waited_for_and_reported_at_the_end(tmp_path: Path) -> None:
    seen = list(snapshots(tmp_path / "none", 0.2, 0.05, threading.Event()))
    assert [g.complete for g in seen] == [False, True]
    assert all(g.recording is None and g.problem for g in seen)


def test_a_request_to_stop_ends_following(tmp_path: Path) -> None:
    wish = threading.Event()
    wish.set()
    with pytest.raises(Cancelled):
        next(snapshots(tmp_path, 1.0, 0.05, wish))
