"""Every bad input ends in a clear error or in a counted rejection, and earlier results are kept."""

from __future__ import annotations

import html
import json
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from pipeline.cli import main
from tests.bad_recordings import (
    Spoil,
    black,
    cut_sample,
    emptied,
    is_laser,
    lights_swapped,
    noise,
    noised,
    repainted,
    replaced,
    rewritten,
    spoilt,
    truncated,
    without,
)
from tests.disk_limit import file_size_limit
from tests.shared_data import PROJECT_ROOT

RECORDING, PROBE = "recording.yaml", "probe.yaml"
REFUSED, UNUSABLE = 2, 3
QUICK = ("--set", "rings.azimuths=360")


@dataclass(frozen=True)
class Told:
    code: int
    out: str
    err: str


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return cut_sample(tmp_path_factory.mktemp("cut") / "recording")


@pytest.fixture
def boresight(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., Told]:
    """Return a function that runs the command line in this process."""

    def call(*arguments: str | Path) -> Told:
        monkeypatch.setattr(sys, "argv", ["boresight", *map(str, arguments)])
        code = 0
        try:
            main()
        except SystemExit as ending:
            code = int(ending.code or 0)
        told = capsys.readouterr()
        return Told(code, told.out, " ".join(told.err.split()))

    return call


REFUSALS: dict[str, tuple[Spoil, tuple[str, ...]]] = {
    "empty video": (truncated(0), ("frames.mkv", "cannot be opened as a video", "copy it again")),
    "video without frames": (truncated(0.002), ("frames.mkv", "holds no video frames")),
    "corrupt head": (noised(0, 400), ("frames.mkv", "cannot be opened as a video")),
    "no video": (without("frames.mkv"), ("frames.mkv", "is missing")),
    "time runs back": (replaced("frames.csv", "^10,[^,]*", "10,0.1"), ("frames.csv", "from 0.3 to 0.1")),
    "encoder time back": (replaced("encoder.csv", "^0.5000", "0.2"), ("encoder.csv", "from 0.49 to 0.2")),
    "empty table": (emptied("frames.csv"), ("frames.csv, line 1", "no column frame")),
    "NaN time": (replaced("frames.csv", "^10,[^,]*", "10,nan"), ("frames.csv, line 12", "a finite number")),
    "light misspelt": (replaced("frames.csv", "laser", "lazer"), ("line 2", "did you mean laser?")),
    "missing key": (replaced(RECORDING, "^frame_rate.*\n", ""), ("key frame_rate: is missing",)),
    "empty key": (replaced(RECORDING, "^frame_rate:.*", "frame_rate:"), ("key frame_rate: is empty",)),
    "misspelt key": (replaced(RECORDING, "^frame_rate", "frame_rat"), ("did you mean frame_rate?",)),
    "mistyped value": (replaced(RECORDING, "30.0", "fast"), ("key frame_rate: is 'fast'",)),
    "empty YAML": (emptied(RECORDING), ("recording.yaml: holds nothing",)),
    "broken YAML": (replaced(RECORDING, "^name.*", "name: ["), ("recording.yaml, line", "not valid YAML")),
    "NaN diameter": (replaced(RECORDING, "101.6", ".nan"), ("pipe.nominal_diameter_mm: is nan",)),
    "zero diameter": (replaced(RECORDING, "101.6", "0"), ("pipe.nominal_diameter_mm: is 0",)),
    "negative diameter": (replaced(RECORDING, "101.6", "-101.6"), ("greater than 0",)),
    "zero focal length": (replaced(PROBE, "366.0747", "0.0"), ("probe.yaml, key camera.focal_px",)),
    "negative baseline": (replaced(PROBE, "23.4594", "-23.4594"), ("key laser.baseline_mm", "above|greater")),
    "negative image size": (replaced(PROBE, "- 1600", "- -1600"), ("key camera.image_size",)),
    "other image size": (replaced(PROBE, "- 1600", "- 800"), ("1600 x 1200 pixels", "800 x 1200")),
    "unknown camera": (replaced(PROBE, "kannala_brandt", "kanala_brant"), ("did you mean kannala_brandt?",)),
    "another camera": (replaced(PROBE, "kannala_brandt", "pinhole"), ("camera.distortion", "5 numbers")),
    "unknown uncertainty": (replaced(PROBE, "baseline_mm: 0.008", "baselin_mm: 1.0"), ("baseline_mm?",)),
    "empty probe": (emptied(PROBE), ("probe.yaml: holds nothing",)),
    "no probe": (without(PROBE), ("probe.yaml is named as probe but does not exist", "--probe FILE")),
    "one encoder reading": (rewritten("encoder.csv", lambda lines: lines[:1]), ("has 1 readings",)),
}


@pytest.mark.parametrize("name", REFUSALS)
def test_inputs_that_cannot_be_read(
    name: str, good: Path, tmp_path: Path, boresight: Callable[..., Told]
) -> None:
    spoil, messages = REFUSALS[name]
    told = boresight("run", spoilt(good, tmp_path, spoil), "-o", tmp_path / "run")
    assert told.code == REFUSED, told.err
    assert [m for m in messages if not any(part in told.err for part in m.split("|"))] == []
    assert "Traceback" not in told.err
    assert not (tmp_path / "run").exists()


UNUSABLES: dict[str, Spoil] = {
    "no ring": repainted(lambda n, p: black(n, p) if is_laser(n) else p),
    "most of the video lost": noised(0.005, 200_000),
}


ALIKE: dict[str, Spoil] = {
    "not in a pipe": repainted(noise),
    "flat pictures": repainted(lambda n, p: np.full_like(p, 90)),
    "saturated pictures": repainted(lambda n, p: np.full_like(p, 255)),
}


@pytest.mark.parametrize("name", ALIKE)
def test_recordings_without_lights(
    name: str, good: Path, tmp_path: Path, boresight: Callable[..., Told]
) -> None:
    told = boresight("run", spoilt(good, tmp_path, ALIKE[name]), "-o", tmp_path / "run", *QUICK)
    assert told.code == UNUSABLE, told.err
    assert "states two lights" in told.err
    assert "all pictures look the same" in told.err
    assert "What to do" in told.err


def test_exchanged_laser_and_led_labels_are_corrected(
    good: Path, tmp_path: Path, boresight: Callable[..., Told]
) -> None:
    recording = spoilt(good, tmp_path, rewritten("frames.csv", lights_swapped))
    for stage in ("premises", "rings"):
        told = boresight("run", recording, "-o", tmp_path / "run", "--only", stage, *QUICK)
        assert told.code == 0, told.err
    assert "24 pictures in another light than frames.csv states: frame 0, 1, 2" in told.err
    assert counts(tmp_path / "run", "rings")["ring samples rejected: frame_rejected"] == 0


@pytest.mark.parametrize("name", UNUSABLES)
def test_recordings_without_a_ring(
    name: str, good: Path, tmp_path: Path, boresight: Callable[..., Told]
) -> None:
    told = boresight("run", spoilt(good, tmp_path, UNUSABLES[name]), "-o", tmp_path / "run", *QUICK)
    assert told.code == UNUSABLE, told.err
    assert "no laser ring was found in any frame Frames: " in told.err
    assert "What to do" in told.err
    assert json.loads((tmp_path / "run" / "run.json").read_text())["state"] == "unusable"


def counts(run: Path, stage: str) -> dict[str, float]:
    stages = json.loads((run / "run.json").read_text())["stages"]
    return {n["name"]: n["value"] for s in stages if s["name"] == stage for n in s["numbers"]}


@pytest.mark.parametrize(
    ("spoil", "rejected"),
    [
        (repainted(lambda n, p: black(n, p) if n in (4, 6) else p), 2),
        (noised(0.4, 5000), 9),
    ],
    ids=["two black laser frames", "damage amid the video"],
)
def test_frames_that_cannot_be_used_are_counted(
    spoil: Spoil, rejected: int, good: Path, tmp_path: Path, boresight: Callable[..., Told]
) -> None:
    recording = spoilt(good, tmp_path, spoil)
    for stage in ("premises", "rings"):
        told = boresight("run", recording, "-o", tmp_path / "run", "--only", stage, *QUICK)
        assert told.code == 0, told.err
    assert counts(tmp_path / "run", "rings")["ring samples rejected: frame_rejected"] == rejected * 360


@pytest.mark.parametrize(
    ("spoil", "noticed"),
    [
        (truncated(0.5), "there are 10 images, the table of frames lists 24"),
        (rewritten("frames.csv", lambda lines: lines[:15]), "there are 24 images, the table"),
        (rewritten("frames.csv", lambda lines: [*lines, "24,0.8,laser\n"]), "the 24 in common"),
        (rewritten("encoder.csv", lambda lines: lines[: len(lines) // 2]), "encoder ends 0.38 s before"),
        (replaced("encoder.csv", "^0.4000,[^\n]*", "0.4000,99.0"), "the encoder jumps by up to"),
        (without("encoder.csv"), "encoder.csv is named as encoder but does not exist"),
    ],
    ids=["truncated", "short table", "long table", "encoder ends early", "encoder jumps", "encoder removed"],
)
def test_repairs_of_a_recording_are_reported(
    spoil: Spoil, noticed: str, good: Path, tmp_path: Path, boresight: Callable[..., Told]
) -> None:
    recording = spoilt(good, tmp_path, spoil)
    told = boresight("run", recording, "-o", tmp_path / "run", "--only", "premises", *QUICK)
    assert told.code == 0, told.err
    first, last = told.err.index("Look at this first"), told.err.index("Before you rely on this run")
    assert noticed in told.err[first:last], "reported before anything else"
    assert noticed in told.err[last:], "and reported again at the end"
    warnings = json.loads((tmp_path / "run" / "run.json").read_text())["reader_warnings"]
    assert any(noticed in w for w in warnings)


def test_a_probe_that_does_not_fit_the_recording_is_reported(
    good: Path, tmp_path: Path, boresight: Callable[..., Told]
) -> None:
    """The stated principal point is 3 px off, 50 times its σ: the adjustment corrects and reports it."""
    recording = spoilt(good, tmp_path, replaced(PROBE, "796.8972", "799.9"))
    told = boresight("run", recording, "-o", tmp_path / "run", *QUICK)
    assert told.code == 0, told.err
    (warning,) = json.loads((tmp_path / "run" / "run.json").read_text())["warnings"]
    assert "the stated probe does not fit this recording" in warning
    assert "run boresight diagnose" in warning.lower()
    assert warning in told.err
    assert warning in html.unescape((tmp_path / "run" / "report.html").read_text())


def test_a_full_disk_keeps_what_was_computed(
    good: Path, tmp_path: Path, boresight: Callable[..., Told]
) -> None:
    run = tmp_path / "run"
    with file_size_limit(600_000):
        told = boresight("run", good, "-o", run, *QUICK)
    assert told.code == REFUSED
    assert "cannot be written: File too large" in told.err
    assert "the same command then continues" in told.err
    kept = {s["name"]: s["state"] for s in json.loads((run / "run.json").read_text())["stages"]}
    assert kept["rings"] == "completed"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--set", "rings.azimuth=360"), "azimuths"),
        (("--set", "rings.azimuths=many"), "rings.azimuths"),
        (("--set", "rings.azimuths=0"), "90"),
        (("--from", "ring"), "rings"),
    ],
)
def test_for_unknown_keys_and_stages_the_nearest_known_name_is_suggested(
    arguments: tuple[str, ...], message: str, good: Path, tmp_path: Path, boresight: Callable[..., Told]
) -> None:
    told = boresight("run", good, "-o", tmp_path / "run", *arguments)
    assert told.code == REFUSED
    assert message in told.err
    assert not (tmp_path / "run").exists()


def arrays(run: Path) -> dict[str, bytes]:
    """Return the arrays of a run: rings and radius map."""
    chunks = (p for p in (run / "rings.zarr").rglob("*") if p.is_file() and p.name != "zarr.json")
    rings = {str(p.relative_to(run)): p.read_bytes() for p in chunks}
    with np.load(run / "radius_map.npz") as wall:
        return rings | {name: wall[name].tobytes() for name in wall.files}


def start(recording: Path, run: Path) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "pipeline.cli", "run", str(recording), "-o", str(run), *QUICK]
    return subprocess.Popen(command, cwd=PROJECT_ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)


def wait_for(run: Path, line: str, process: subprocess.Popen[bytes]) -> None:
    log = run / ".boresight" / "run.log"
    while process.poll() is None and not (log.exists() and line in log.read_text()):
        time.sleep(0.02)


@pytest.fixture(scope="module")
def undisturbed(good: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    run = tmp_path_factory.mktemp("undisturbed") / "run"
    _, told = (process := start(good, run)).communicate()
    assert process.returncode == 0, told
    return arrays(run)


def test_a_run_killed_in_two_stages_ends_with_the_same_result(
    good: Path, tmp_path: Path, undisturbed: dict[str, bytes]
) -> None:
    run = tmp_path / "run"
    for line in ("stage rings starts", "stage motion starts"):
        process = start(good, run)
        wait_for(run, line, process)
        process.kill()
        process.communicate()
        assert process.returncode == -9
    _, told = (process := start(good, run)).communicate()
    assert process.returncode == 0, told
    assert arrays(run) == undisturbed
    assert {"radius_mm", "sigma_mm", "count"} < undisturbed.keys()
    assert any("radius_px" in name for name in undisturbed)
