"""The diagnosis from end to end on a small simulated pair, and on recordings that lack what it needs."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from pipeline.cli import app
from pipeline.instrument.probe_file import read_probe, read_with_source
from pipeline.machine.stage import quiet_context
from pipeline.recording import open_recording
from pipeline.simulator.scene import scene_from
from stages.diagnose.diagnose import diagnose
from stages.diagnose.result import Verdict
from tests.simulated import SCENES, rendered, shipped, smaller

pytestmark = pytest.mark.slow
TILT = {"laser_tilt": {"tilt_deg": 0.8, "direction_deg": 40.0}}


def gauge_scene():
    return smaller(
        shipped("gauge-2-inch"), 2, 120, frame_rate=15.0, effects=TILT,
        rendering={"line_samples": 2}, codec="ffv1",
    )  # fmt: skip


def field_scene(gauge):
    """An inspection with the gauge's own instrument."""
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
def diagnosed(pair, tmp_path_factory):
    out = tmp_path_factory.mktemp("out")
    field, gauge = pair
    done = CliRunner().invoke(app, ["diagnose", str(field), "--gauge", str(gauge), "-o", str(out)])
    assert done.exit_code == 0, done.output
    return out


def test_the_tilt_is_named_sized_and_borne_out(diagnosed):
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


class Still:
    """A source whose laser and lit frames never change."""

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
        (too_short, Verdict.NOT_IDENTIFIABLE, "The probe travels only"),
        (without_texture, Verdict.NOT_IDENTIFIABLE, "No frame of the field shows the wall's texture"),
        (without_encoder, Verdict.CLASS, "no encoder: its scale, slips, play and delay cannot be told"),
        (without_motion, Verdict.NOT_IDENTIFIABLE, "travels only 0 mm"),
        (of_another_size, Verdict.CLASS, "not of 76.2 mm as stated"),
    ],
)
def test_what_a_recording_lacks_is_told_and_nothing_is_guessed(pair, spoilt, verdict, said):
    recording = spoilt(open_recording(pair[0]))
    probe = read_probe(pair[0] / "probe.yaml")
    found = diagnose(recording, None, probe, quiet_context()).found
    assert found.verdict is verdict
    assert not found.effects
    assert any(said in s for s in found.shortcomings), found.shortcomings


def test_a_gauge_of_another_probe_is_left_out_and_said_to_be(pair, tmp_path):
    field, gauge = pair
    other = tmp_path / "gauge"
    shutil.copytree(gauge, other)
    text = (other / "probe.yaml").read_text()
    (other / "probe.yaml").write_text(text.replace("baseline_mm: 21.8", "baseline_mm: 25.8", 1))
    done = CliRunner().invoke(app, ["diagnose", str(field), "--gauge", str(other), "-o", str(tmp_path / "o")])
    assert done.exit_code == 0, done.output
    answer = json.loads((tmp_path / "o" / "diagnosis.json").read_text())
    assert answer["gauge"] == ""
    assert answer["effects"] == []
    assert any("another probe" in s and "baseline_mm" in s for s in answer["shortcomings"])
