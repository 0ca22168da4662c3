"""Wall errors of a proof: with the true instrument they are noise, with a wrong one its error."""

import json
from pathlib import Path

import numpy as np
import pytest

from pipeline.artefacts.measured import RingSamples, RingValidity
from pipeline.commands import prove_cases
from pipeline.commands.prove_cases import wall_errors
from pipeline.drill.cases import Case
from pipeline.files.json_yaml import Section
from pipeline.instrument.probe_file import probe_from, write_probe
from pipeline.simulator.build import build_truth
from pipeline.simulator.scene import read_scene, write_scene
from tests.exact_rings import exact_rings

SMALL = Path(__file__).resolve().parents[2] / "configs" / "priors" / "small" / "straight-4-inch.yaml"
NOISE_PX = 0.1


@pytest.fixture(scope="module")
def concealed():
    """The scene of a tilted sheet, its truth, and its rings with noise."""
    scene = read_scene(SMALL).model_copy(
        update={
            "frames": 8,
            "truth": "stated",
            "effects": {"laser_tilt": {"tilt_deg": 0.5, "direction_deg": 40.0}},
        }
    )
    truth = build_truth(scene, SMALL)
    azimuth, frames = np.linspace(-np.pi, np.pi, 480, endpoint=False), np.array([0, 2, 4, 6])
    centre = truth.stated.camera.centre_px
    # The wall's errors use every fourth sample: only these must exist.
    radius = np.full((len(frames), 480), np.nan)
    radius[:, ::4] = exact_rings(truth, frames, azimuth[::4], centre)
    radius += np.random.default_rng(1).normal(0, NOISE_PX, radius.shape)
    plain = np.ones_like(radius, np.float32)
    valid = np.where(np.isfinite(radius), RingValidity.VALID, RingValidity.NO_LINE).astype(np.uint8)
    return (
        scene,
        truth,
        RingSamples(frames, azimuth, centre, radius.astype(np.float32), plain, plain, plain, valid),
    )


def errors(concealed, folder, monkeypatch, changes):
    """Return the wall errors for a diagnosis that writes a probe with ``changes`` to the sheet."""
    scene, _, rings = concealed
    monkeypatch.setattr(prove_cases, "open_recording", lambda path: path)
    monkeypatch.setattr(prove_cases, "measured_rings", lambda *_: rings)
    (folder / "truth" / "a-field").mkdir(parents=True)
    write_scene(scene, folder / "truth" / "a-field" / "truth_scene.yaml")
    stated = probe_from(
        Section(SMALL, {**scene.probe, "laser": {**scene.probe["laser"], **changes}}, "probe")
    )
    (folder / "answer").mkdir()
    write_probe(stated, folder / "answer" / "probe.yaml")
    return wall_errors(Case("a", None, folder / "a-field"), folder / "answer", folder / "truth")


def test_an_uncorrected_probe_errs_by_the_concealed_effect_and_the_true_one_by_noise(
    concealed, tmp_path, monkeypatch
):
    found = errors(concealed, tmp_path, monkeypatch, {})
    # A tilt of 0.5° moves the wall by about 1 mm at 50.8 mm, and 0.1 px of this camera are about 0.08 mm.
    assert 0.04 < found.oracle_mm < 0.15
    assert found.stated_mm == pytest.approx(found.corrected_mm)
    assert found.stated_mm > 4 * found.oracle_mm


def test_a_corrected_probe_errs_no_more_than_the_true_one_and_is_kept(concealed, tmp_path, monkeypatch):
    direction = concealed[1].instrument.laser.sheet
    true = dict(zip(direction.PARAMETER_NAMES, direction.parameters.tolist(), strict=True))
    tilt = np.array([true["tilt_x"], true["tilt_y"]])
    changes = {
        "tilt_deg": float(np.degrees(np.arctan(np.hypot(*tilt)))),
        "tilt_direction_deg": float(np.degrees(np.arctan2(tilt[1], tilt[0]))),
    }
    found = errors(concealed, tmp_path, monkeypatch, changes)
    assert found.corrected_mm < 1.1 * found.oracle_mm
    assert found.stated_mm > 4 * found.corrected_mm
    assert json.loads((tmp_path / "answer" / "wall_errors.json").read_text()) == vars(found)


def test_without_the_scene_there_is_no_wall_error(tmp_path):
    (tmp_path / "probe.yaml").write_text("camera: {}\n")
    assert wall_errors(Case("a", None, tmp_path / "a-field"), tmp_path, tmp_path / "truth") is None
