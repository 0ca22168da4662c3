"""A gauge run's line compared with instruments, on synthetic pixels.

It also tests the effects that a diagnosis switches on.
"""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pipeline.api.diagnosis.simulated import switches_of, try_diagnosis
from pipeline.instrument.camera.fisheye import KannalaBrandt
from pipeline.machine.display import SilentDisplay
from pipeline.simulator.effects.switch import Switch, the_other_way
from pipeline.simulator.instrument import TrueCamera
from pipeline.simulator.rays import viewing_rays
from pipeline.simulator.window import CylinderWindow
from stages.twin.cells import sigmas
from stages.twin.gauge_line import GaugeLine, GaugeLineParameters, _judged, seen_at
from stages.twin.line_blocks import LineBlocks, light_of

FRAMES, BLOCKS, PIXELS = 12, 30, 160
NOISE = 2.0


def _line(white=np.inf):
    """Return a line seen by a sensor of known noise: its blocks differ in brightness and background."""
    random = np.random.default_rng(4)
    count = FRAMES * BLOCKS
    block = np.repeat(np.arange(count), PIXELS)
    offset = random.uniform(-12, 12, len(block))
    height, ground = random.uniform(60, 150, count), random.uniform(0, 6, count)
    grey = ground[block] + height[block] * np.exp(-0.5 * (offset / 1.3) ** 2)
    grey = np.minimum(grey + NOISE * random.standard_normal(len(block)), white)
    of_frame = np.repeat(np.arange(FRAMES), BLOCKS)
    azimuth = np.tile(np.linspace(-3, 3, BLOCKS), FRAMES)
    blocks = LineBlocks(
        np.arange(FRAMES), of_frame, azimuth, np.full(count, 300.0), np.full(count, 1.3), block, offset, grey,
        np.zeros(2), white,
    )  # fmt: skip
    return GaugeLine(None, None, GaugeLineParameters(), blocks, light_of(blocks))


@pytest.mark.parametrize("white", [np.inf, 110.0])
def test_a_line_at_its_measured_place_leaves_noise_and_a_displaced_one_more(white):
    line = _line(white)
    nowhere = np.zeros(FRAMES * BLOCKS)
    measured = line.chi2(nowhere)
    assert measured.mean() == pytest.approx(1.0, abs=0.08)
    displaced = [line.chi2(nowhere + d).mean() for d in (0.1, 0.5, 3.0)]
    assert displaced == sorted(displaced)
    assert displaced[0] > 1.05 * measured.mean()
    assert displaced[2] > 10 * measured.mean()


def test_the_fit_of_a_wrong_diagnosis_of_the_same_size_is_in_the_report():
    frames = SimpleNamespace(frames=SimpleNamespace(frame=np.arange(FRAMES)))
    line = replace(_line(), recording=frames)
    nowhere, azimuth = np.zeros(FRAMES * BLOCKS), line.blocks.azimuth_rad
    stated, wrong = (size * np.cos(azimuth) for size in (0.4, 0.8))
    found = _judged(line, [Switch("laser_tilt", (0.4, 10.0))], [stated, nowhere, wrong])
    assert found.chi2_diagnosed < found.chi2_stated < found.chi2_wrong
    assert found.sigmas_wrong > found.sigmas > 3


@pytest.mark.parametrize(
    ("switch", "other"),
    [
        (Switch("laser_tilt", (0.4, 10.0)), (0.4, -170.0)),
        (Switch("laser_cone", (0.3,)), (-0.3,)),
        (Switch("sheet_waviness", (2.0, 3.0, 30.0)), (2.0, 3.0, 90.0)),
        (Switch("housing_glass", (1.5,)), (3.0,)),
    ],
)
def test_a_wrong_answer_is_as_far_off_as_none(switch, other):
    assert the_other_way(switch).values == pytest.approx(other)


def test_the_nearer_of_two_instruments_fits_better_and_equal_ones_do_not_differ():
    line = _line()
    azimuth = line.blocks.azimuth_rad
    near, far = (line.chi2(size * np.cos(azimuth)) for size in (0.1, 0.4))
    assert sigmas(far - near) > 3
    assert sigmas(near - far) < -3
    assert sigmas(near - near) == 0


def test_a_line_without_any_prediction_is_unexplained():
    line = _line()
    assert line.chi2(np.full(FRAMES * BLOCKS, np.nan)).min() > 10


def test_a_point_behind_glass_is_seen_where_the_viewing_ray_passes_through_it():
    model = KannalaBrandt((1600, 1200), (360.0, 360.0), (800.0, 600.0), (-0.011, 0.001, 0.0, 0.0))
    random = np.random.default_rng(2)
    azimuth = random.uniform(-3, 3, 40)
    xyz_c = np.stack([50 * np.cos(azimuth), 50 * np.sin(azimuth), random.uniform(10, 90, 40)], -1)
    camera = TrueCamera(model, windows=(CylinderWindow(20.0, 1.5), CylinderWindow(22.0, 1.0)))
    origin, ray = viewing_rays(camera, seen_at(camera, xyz_c))
    miss = np.linalg.norm(np.cross(xyz_c - origin, ray), axis=1)
    assert miss.max() < 1e-4
    plain = np.linalg.norm(seen_at(camera, xyz_c) - model.project(xyz_c).uv, axis=1)
    assert plain.max() > 1


def _diagnosis(folder, effects):
    document = {"verdict": "named", "global_p": 1e-9, "effects": effects}
    (folder / "diagnosis.json").write_text(json.dumps(document), "utf-8")
    record = {"probe": {"path": str(folder / "stated.yaml")}}
    (folder / "run.json").write_text(json.dumps(record), "utf-8")
    return folder


def _effect(name, probability=1.0, course=None, **sizes):
    numbers = {k: {"value": v, "sd": 0.01} for k, v in sizes.items()}
    return {"name": name, "probability": probability, "parameters": numbers, "course": course}


def test_effects_of_a_diagnosis_are_switched_on_with_their_size_and_course(tmp_path):
    step = {"kind": "step", "time_s": {"value": 4.6, "sd": 0.1}, "probability": 1.0}
    tilt = _effect("laser_tilt", course=step, tilt_deg=0.35, direction_deg=25.0)
    unsure, unknown = _effect("laser_cone", 0.1, cone_deg=0.2), _effect("gremlins")
    slip = _effect("encoder_slip", slip_mm=3.0, time_s=4.0)
    said = switches_of(_diagnosis(tmp_path, [tilt, unsure, unknown, slip]) / "diagnosis.json")
    assert [s.text for s in said.found] == ["laser_tilt~step=0.35@25.0/4.6s", "encoder_slip=3.0/4.0s"]
    assert [s.name for s in said.of_line] == ["laser_tilt"]
    assert len(said.inexpressible) == 2
    assert said.by_chance == 1e-9, "the probability of a name is not the chance of a mismatch"


def test_an_exposure_is_not_judged_by_the_line_and_not_withdrawn(tmp_path):
    """Poses are measured in the same late pictures: with them the line is where it was."""
    folder = _diagnosis(tmp_path, [_effect("motion_blur", exposure_s=0.016)])
    assert switches_of(folder / "diagnosis.json").of_line == ()
    tried = try_diagnosis(folder, tmp_path / "gauge", SilentDisplay())
    assert tried.withdrawn == ()
    assert "cannot show motion blur" in tried.cannot_tell[0]


def test_without_a_gauge_run_pictures_decide_nothing_and_this_is_reported(tmp_path):
    folder = _diagnosis(tmp_path, [_effect("laser_tilt", tilt_deg=0.3, direction_deg=0.0)])
    tried = try_diagnosis(folder, tmp_path / "gauge", SilentDisplay())
    assert tried.gauge is None
    assert tried.found == tried.withdrawn == ()
    assert "no gauge run" in tried.cannot_tell[-1]


def test_an_effect_whose_law_includes_its_course_gets_no_second_one(tmp_path):
    course = {"kind": "exponential", "time_s": {"value": 3.5, "sd": 0.1}}
    drift = _effect("baseline_drift", course=course, drift_mm=0.3, time_s=3.5)
    (switch,) = switches_of(_diagnosis(tmp_path, [drift]) / "diagnosis.json").of_line
    assert switch.text == "baseline_drift=0.3/3.5s"
