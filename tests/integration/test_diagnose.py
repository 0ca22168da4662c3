"""The whole diagnosis of a small simulated pair, and of recordings that lack something it needs."""

import json
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from pipeline.api.job import Job, probe_source, recording_source, result_of, run_job
from pipeline.cli import app
from pipeline.errors import InputError, UnusableError
from pipeline.instrument.probe_file import read_probe, read_with_source
from pipeline.machine.configuration import resolve
from pipeline.machine.display import SilentDisplay
from pipeline.machine.plan import Selection, Source
from pipeline.recording import open_recording
from pipeline.simulator.scene import scene_from
from stages.diagnose.diagnose import Diagnosed, Noticed, diagnosis_stages
from stages.diagnose.result import Verdict
from tests.shared_data import PROJECT_ROOT
from tests.simulated import SCENES, rendered, shipped, smaller

pytestmark = pytest.mark.slow
# A third of the usual samples a ring: enough for a tilt of 0.8°. A run of the field passes on as many.
QUICK = ["--set", "rings.azimuths=480"]
TILT = {"laser_tilt": {"tilt_deg": 0.8, "direction_deg": 40.0}}


def gauge_scene():
    return smaller(
        shipped("gauge-2-inch"), 2, 120, frame_rate=15.0, effects=TILT,
        rendering={"line_samples": 2}, codec="ffv1",
    )  # fmt: skip


def field_scene(gauge):
    """An inspection with the instrument of the gauge run."""
    field = smaller(shipped("bent-2-inch"), 2, 60, effects=TILT, rendering={"line_samples": 2}, codec="ffv1")
    values = field.model_dump(mode="json", exclude_defaults=True)
    same = gauge.model_dump(mode="json", exclude_defaults=True)
    values |= {"probe": same["probe"], "probe_seed": same["probe_seed"]}
    return scene_from(values, SCENES / "scene.yaml")


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pair")
    gauge = gauge_scene()
    return rendered(field_scene(gauge), folder)[0], rendered(gauge, folder)[0]


@pytest.fixture(scope="module")
def field_run(pair, tmp_path_factory):
    run = tmp_path_factory.mktemp("field") / "run"
    assert CliRunner().invoke(app, ["run", str(pair[0]), "-o", str(run), *QUICK]).exit_code == 0
    return run


@pytest.fixture(scope="module")
def first_call(pair, field_run, tmp_path_factory):
    """The folder of a diagnosis that reuses a run of the field, and the states of its stages."""
    out = tmp_path_factory.mktemp("out")
    words = ["diagnose", "--run", str(field_run), "--gauge", str(pair[1]), "-o", str(out)]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    return out, states(out)


@pytest.fixture(scope="module")
def diagnosed(first_call):
    return first_call[0]


def test_the_tilt_is_named_with_its_size_and_lowers_held_out_residuals(diagnosed):
    answer = json.loads((diagnosed / "diagnosis.json").read_text())
    assert answer["verdict"] == "named"
    assert set(answer["made_by"]["input_sha256"]) == {"field", "gauge", "probe"}
    assert read_with_source(diagnosed / "probe.yaml")[1].made_by == answer["made_by"]
    (tilt,) = answer["effects"]
    assert tilt["name"] == "laser_tilt"
    size = tilt["parameters"]["tilt_deg"]
    assert size["value"] == pytest.approx(0.8, abs=4 * size["sd"] + 0.03)
    assert answer["fit"]["heldout_after"] < 0.5 * answer["fit"]["heldout_before"]


def test_page_arrays_and_corrected_probe_are_there(diagnosed, pair):
    page = (diagnosed / "diagnosis.html").read_text()
    assert "Left out: laser tilt" in page
    assert page.count("data:image/png;base64,") >= 5
    assert "http://" not in page
    assert "https://" not in page
    arrays = np.load(diagnosed / "arrays.npz")
    assert np.nanstd(arrays["after_mm"]) < 0.5 * np.nanstd(arrays["before_mm"])
    stated, found = read_probe(pair[1] / "probe.yaml"), read_probe(diagnosed / "probe.yaml")
    lean = found.parameters - stated.parameters
    tilt = np.degrees([lean[found.parameter_names.index(n)] for n in ("tilt_x", "tilt_y")])
    assert tilt == pytest.approx(0.8 * np.array([np.cos(np.radians(40)), np.sin(np.radians(40))]), abs=0.05)
    assert found.calibrated_from == open_recording(pair[1]).name


ANSWERS = ("diagnosis.json", "diagnosis.html", "probe.yaml", "arrays.npz")


def states(folder):
    """Return the state of each stage as run.json gives it."""
    stages = json.loads((folder / "run.json").read_text())["stages"]
    return {stage["name"]: stage["state"] for stage in stages}


def contents(folder):
    return {name: (folder / name).read_bytes() for name in ANSWERS}


def results(folder):
    """Return every file of the answer, for any verdict, except the record of how it was made."""
    files = {f.name: f.read_bytes() for f in folder.iterdir() if f.is_file() and f.name != "run.json"}
    assert {"diagnosis.json", "arrays.npz"} <= set(files)
    return files


def test_a_second_diagnosis_computes_nothing(diagnosed, field_run, pair):
    before = contents(diagnosed)
    words = ["diagnose", "--run", str(field_run), "--gauge", str(pair[1]), "-o", str(diagnosed)]
    assert CliRunner().invoke(app, words).exit_code == 0
    assert set(states(diagnosed).values()) == {"reused"}
    assert len(states(diagnosed)) == 14
    assert contents(diagnosed) == before


def wait_for_stage(name, folder, process):
    """Wait until the result of a stage is complete."""
    while process.poll() is None and not list(folder.glob(f".boresight/{name}-*/manifest.json")):
        time.sleep(0.01)


def test_killed_and_resumed_it_ends_with_the_same_bytes(diagnosed, pair, tmp_path):
    # Each call is in a separate process, after `diagnosed` has compiled the kernels: what compiling in the
    # same process changes in the last digits is tested elsewhere.
    # The inspection alone takes a third of the time; with a gauge run the same runner resumes the stages.
    words = [sys.executable, "-m", "pipeline.cli", "diagnose", str(pair[0]), *QUICK, "-o"]
    undisturbed, command = [*words, str(tmp_path / "whole")], [*words, str(tmp_path / "out")]
    subprocess.run(undisturbed, cwd=PROJECT_ROOT, stderr=subprocess.DEVNULL, check=True)
    first = subprocess.Popen(command, cwd=PROJECT_ROOT, stderr=subprocess.DEVNULL)
    # Killed in the middle of a stage: the one before it is complete.
    wait_for_stage("line_profile", tmp_path / "out", first)
    first.kill()
    assert first.wait() == -signal.SIGKILL
    assert not (tmp_path / "out" / "diagnosis.json").exists()
    subprocess.run(command, cwd=PROJECT_ROOT, stderr=subprocess.DEVNULL, check=True)
    assert states(tmp_path / "out")["field rings"] == "reused"
    assert states(tmp_path / "out")["diagnosis"] == "completed"
    assert results(tmp_path / "out") == results(tmp_path / "whole")


def test_ctrl_c_ends_it_with_130(pair, tmp_path):
    command = [sys.executable, "-m", "pipeline.cli", "diagnose", str(pair[0]), "-o", str(tmp_path / "out")]
    first = subprocess.Popen(command, cwd=PROJECT_ROOT, stderr=subprocess.DEVNULL)
    wait_for_stage("rings", tmp_path / "out", first)
    first.send_signal(signal.SIGINT)
    assert first.wait() == 130
    assert json.loads((tmp_path / "out" / "run.json").read_text())["state"] == "cancelled"


def test_the_results_of_a_run_of_the_field_are_reused(first_call):
    out, stood = first_call
    assert stood["field rings"] == stood["field triangulate"] == "reused"
    assert stood["gauge rings"] == stood["diagnosis"] == "completed"
    assert json.loads((out / "run.json").read_text())["configuration"]["rings"]["azimuths"] == 480


def test_the_inspection_is_reconstructed_once_with_what_was_found(pair, field_run, diagnosed, tmp_path):
    out = shutil.copytree(diagnosed, tmp_path / "out")
    words = ["diagnose", "--run", str(field_run), "--gauge", str(pair[1]), "-o", str(out), "--apply"]
    for expected in ("completed", "reused"):
        done = CliRunner().invoke(app, words)
        assert done.exit_code == 0, done.output
        assert states(out)["diagnosis"] == "reused"
        assert set(states(out / "run").values()) == {expected}
    assert not (out / "run-stated").exists()


def test_a_run_of_another_recording_is_refused_with_its_name(pair, tmp_path):
    record = {
        "state": "completed", "recording": {"path": str(pair[0])}, "configuration": {},
        "probe": {"path": str(pair[0] / "probe.yaml")}, "input_sha256": {"recording": "0" * 64},
    }  # fmt: skip
    (tmp_path / "run.json").write_text(json.dumps(record))
    words = ["diagnose", str(pair[0]), "--run", str(tmp_path), "-o", str(tmp_path / "out")]
    done = CliRunner().invoke(app, words)
    assert isinstance(done.exception, InputError)
    assert "the recording differs from the one of the run" in str(done.exception)
    (tmp_path / "run.json").write_text(json.dumps(record | {"configuration": {"rings": {"gone": 1}}}))
    open_field = open_recording(pair[0])
    same = {
        "recording": open_field.content_key,
        "probe": probe_source(read_probe(pair[0] / "probe.yaml")).key,
    }
    old = record | {"configuration": {"rings": {"gone": 1}}, "input_sha256": same}
    (tmp_path / "run.json").write_text(json.dumps(old))
    done = CliRunner().invoke(app, words)
    assert isinstance(done.exception, InputError)
    assert "rings.gone" in str(done.exception)


class Still:
    """A frame source whose laser frames are all the same picture, and whose lit frames are."""

    def __init__(self, recording):
        self.recording, self.image_size = recording, recording.source.image_size

    def read(self, frames, planes):
        kinds = dict(
            zip(self.recording.frames.frame.tolist(), self.recording.frames.illumination, strict=True)
        )
        first = {k: next(n for n, kind in kinds.items() if kind == k) for k in set(kinds.values())}
        images = {k: next(iter(self.recording.source.read([n], planes)))[1].copy() for k, n in first.items()}
        return ((int(n), images[kinds[int(n)]]) for n in frames)


def only(recording, keep):
    frames = recording.frames
    table = replace(
        frames, frame=frames.frame[keep], time_s=frames.time_s[keep], illumination=frames.illumination[keep]
    )
    return replace(recording, frames=table)


def too_short(recording):
    return only(recording, np.arange(len(recording.frames.frame)) < 6)


def without_texture(recording):
    return only(recording, recording.frames.illumination == "laser")


def without_encoder(recording):
    return replace(recording, encoder=None)


def without_motion(recording):
    still = replace(recording.encoder, distance_mm=0 * recording.encoder.distance_mm)
    return replace(recording, source=Still(recording), encoder=still)


def of_another_size(recording):
    return replace(recording, pipe=replace(recording.pipe, nominal_diameter_mm=76.2))


@pytest.mark.parametrize(
    ("spoilt", "verdict", "said"),
    [
        (too_short, Verdict.NOT_IDENTIFIABLE, "Only 3 pictures show the lit wall"),
        (without_texture, Verdict.NOT_IDENTIFIABLE, "No frame of the inspection shows the wall's texture"),
        (without_encoder, Verdict.CLASS, "no encoder: its scale, slips, play and delay are not visible"),
        (without_motion, Verdict.NOT_IDENTIFIABLE, "travels only 0 mm"),
    ],
)
def test_what_a_recording_lacks_is_reported_and_no_effect_is_named(pair, spoilt, verdict, said, tmp_path):
    found = field_alone(spoilt(open_recording(pair[0])), pair[0], tmp_path)
    assert found.verdict is verdict
    assert not found.effects
    assert any(said in s for s in found.shortcomings), found.shortcomings


def test_a_field_whose_size_the_ring_contradicts_is_refused(pair, tmp_path):
    with pytest.raises(UnusableError, match=r"diameter of 50\.\d+ mm, but the pipe's is stated as 76\.2 mm"):
        field_alone(of_another_size(open_recording(pair[0])), pair[0], tmp_path)


def field_alone(recording, folder, tmp_path):
    """The result of a diagnosis of an inspection alone."""
    probe = read_probe(folder / "probe.yaml")
    stages = diagnosis_stages(with_field=True, with_gauge=False)
    sources = (recording_source(recording, "field"), probe_source(probe), Source(Noticed, Noticed(), ""))
    configuration = resolve(stages, None, QUICK[1:])
    job = Job("diagnose", sources, stages, (), configuration, tmp_path / "out", at_once=1)
    run_job(job, Selection(), SilentDisplay())
    return result_of(job, Diagnosed).found


def test_a_gauge_of_another_probe_is_left_out_with_a_message(pair, diagnosed, tmp_path):
    field, gauge = pair
    out, other = shutil.copytree(diagnosed, tmp_path / "out"), tmp_path / "gauge"
    shutil.copytree(gauge, other)
    text = (other / "probe.yaml").read_text()
    (other / "probe.yaml").write_text(text.replace("baseline_mm: 21.8", "baseline_mm: 25.8", 1))
    words = ["diagnose", str(field), "--gauge", str(other), "-o", str(out), *QUICK]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    answer = json.loads((out / "diagnosis.json").read_text())
    assert answer["gauge"] == ""
    assert answer["effects"] == []
    assert any("another probe" in s and "baseline_mm" in s for s in answer["shortcomings"])
