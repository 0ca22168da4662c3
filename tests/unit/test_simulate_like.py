"""A scene that refers to a measured pipe: its wall, its route, what is added, and what is refused."""

from types import SimpleNamespace

import numpy as np
import pytest

from pipeline.api.like import Changed, _seen_light, change, photo_as_reflectance
from pipeline.artefacts.measured import WallTexture
from pipeline.errors import InputError
from pipeline.geometry.axis import straight_axis
from pipeline.simulator.build import plain_truth
from pipeline.simulator.instrument import TrueSensor
from pipeline.simulator.scene import scene_from
from pipeline.simulator.sensor import exposed
from pipeline.simulator.wall import MeasuredPipe, read_measured, write_measured
from pipeline.simulator.wall.grid import Wall, WallGrid
from stages.twin.lamp_light import Figure
from stages.twin.noise import CameraNoise
from stages.twin.reflectance import LUMA_BGR

PROBE = {
    "camera": {
        "model": "kannala_brandt", "image_size": [400, 300], "focal_px": [90.0, 90.0],
        "centre_px": [199.0, 148.0], "distortion": [-0.011, 0.001, 0.0, 0.0],
    },
    "laser": {
        "baseline_mm": 22.0, "opening_angle_deg": 180.0, "tilt_deg": 0.0, "tilt_direction_deg": 0.0,
        "line_sigma_mm": 0.15, "wavelength_nm": 520,
    },
    "shutter": {"kind": "global", "exposure_s": 0.0015},
    "standard_uncertainty": {
        "focal_px": 0.06, "centre_px": 0.06, "distortion": [0.0002, 0.0002, 0.0001, 0.0],
        "baseline_mm": 0.008, "tilt_deg": 0.006, "opening_angle_deg": 0.012,
    },
}  # fmt: skip


def _pipe():
    random = np.random.default_rng(1)
    shape, texture = WallGrid(0.0, 0.5, 300, 180), WallGrid(0.0, 0.5, 300, 240)
    radius = (50 + 0.1 * random.standard_normal((300, 180))).astype(np.float32)
    albedo = random.integers(40, 200, (300, 240, 3)).astype(np.float32) / 255
    T_pc = np.tile(np.eye(4), (11, 1, 1))
    T_pc[:, 2, 3] = np.linspace(0, 20, 11)
    T_pc[:, 0, 3] = 0.3 * np.sin(np.linspace(0, 3, 11))
    return MeasuredPipe(
        Wall(straight_axis(-50, 300), shape, radius, texture, albedo), np.arange(11) / 10, T_pc
    )


@pytest.fixture
def scene(tmp_path):
    write_measured(_pipe(), tmp_path / "measured.npz")
    values = {
        "name": "like", "frames": 11, "frame_rate": 10.0, "pattern": ["laser", "led"], "probe": PROBE,
        "truth": "stated", "motion": {"measured": "measured.npz"},
        "pipe": {
            "diameter_mm": 100.0, "measured": "measured.npz", "relief": {"roughness_mm": 0.0},
            "surface": {"gloss": 0.0},
        },
    }  # fmt: skip
    return scene_from(values, tmp_path / "scene.yaml"), tmp_path / "scene.yaml"


def test_wall_and_route_are_the_measured_ones(scene):
    truth, pipe = plain_truth(*scene), _pipe()
    np.testing.assert_array_equal(truth.wall.radius_mm, pipe.wall.radius_mm)
    np.testing.assert_allclose(truth.wall.albedo_bgr, pipe.wall.albedo_bgr, atol=1e-6)
    np.testing.assert_allclose(truth.poses(), pipe.T_pc, atol=1e-9)


def test_at_twice_the_speed_the_same_places_are_passed_in_half_the_frames(scene):
    described, file = scene
    fast = change(described, Changed(speed=2.0))
    assert fast.frames == 6
    np.testing.assert_allclose(plain_truth(fast, file).poses(), _pipe().T_pc[::2], atol=1e-9)


def test_a_defect_is_added_to_the_wall_at_its_place_only(scene):
    described, file = scene
    pitted = plain_truth(change(described, Changed(defects=("pit,75,40,8,8,1.5",))), file)
    deeper = pitted.wall.radius_mm - _pipe().wall.radius_mm
    row, column = np.unravel_index(np.argmax(deeper), deeper.shape)
    assert deeper.max() == pytest.approx(1.5, abs=0.3)
    assert pitted.wall.shape.distance_mm[row] == pytest.approx(75, abs=4)
    assert np.degrees(pitted.wall.shape.azimuth_rad[column]) == pytest.approx(40, abs=6)
    assert np.abs(deeper[:100]).max() == 0


@pytest.mark.parametrize("text", ["pit,75,40,8,8", "pit,75,forty,8,8,1"])
def test_an_invalid_defect_is_refused(scene, text):
    with pytest.raises(InputError, match="KIND,DISTANCE"):
        change(scene[0], Changed(defects=(text,)))


def test_a_route_is_either_measured_or_made_of_legs(scene):
    described, file = scene
    values = described.model_dump(mode="json", exclude_defaults=True)
    for motion in ({}, {"measured": "measured.npz", "legs": [{"duration_s": 1.0, "speed_mm_s": 9.0}]}):
        with pytest.raises(InputError, match="either legs or a measured way"):
            scene_from(values | {"motion": motion}, file)


@pytest.mark.parametrize("content", [None, b"no archive"])
def test_a_file_without_a_measured_pipe_is_refused(tmp_path, content):
    file = tmp_path / "measured.npz"
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(InputError, match="measured pipe"):
        read_measured(file)


def test_unphotographed_wall_gets_the_mean_around_it():
    bgra = np.full((60, 80, 4), 100, np.uint8)
    bgra[20:30, 20:30] = 0
    filled = photo_as_reflectance(WallTexture(bgra, 0.0, 0.2, -np.pi, 2 * np.pi / 80))
    np.testing.assert_allclose(filled, 100 / 255, atol=1e-3)


@pytest.mark.parametrize("shot", [0.02, 0.0])
@pytest.mark.parametrize("slope", [1.0, 219 / 255])
def test_grey_of_the_rendered_camera_has_the_noise_of_the_recorded_one(slope, shot):
    """The electrons of the grey picture were given to each of its three colours: too little noise.

    Without shot noise the camera was arbitrary.
    """
    dark = 1.2  # variance of recorded grey; ``shot`` is its growth per grey level
    noise = CameraNoise(
        Figure(0.0, 0.1),
        255.0,
        Figure(dark + 1 / 12, 0.1),
        Figure(shot, 1e-3),
        Figure(0.0, 0.0),
        Figure(1.0, 0.1),
    )
    state = SimpleNamespace(noise=noise, line=None, lamp=None)
    sensor = TrueSensor(**_seen_light(SimpleNamespace(state=state), 0.0, slope)["sensor"])
    for level in (40.0, 120.0):
        light = np.full((200, 200, 3), level / slope / 255, np.float32)
        grey = slope * (exposed(light, sensor, 7, 1) @ LUMA_BGR)
        rounded = (slope * np.linalg.norm(LUMA_BGR)) ** 2 / 12
        assert grey.var() - rounded == pytest.approx(dark + shot * level, rel=0.05)
