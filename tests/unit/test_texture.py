"""The texture stage on a drawn pipe whose reflectance and light are known."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest

from pipeline.artefacts.measured import WallTexture
from pipeline.errors import UnusableError
from pipeline.export.pictures import write_unrolled
from stages.texture import TEXTURE, TextureParameters, photograph_wall
from tests.quiet import quiet_context
from tests.unit.drawn_pipe import (
    RADIUS,
    draw,
    poses,
    recording_of,
    reflectance,
    seen_wall,
    small_probe,
    trajectory_of,
)

FRAMES = 20


def texture_of(images, T_pc, kind="led", context=None, **parameters):
    return photograph_wall(
        recording_of(images, kind), small_probe(), trajectory_of(T_pc), seen_wall(T_pc),
        TextureParameters(**parameters), context or quiet_context(),
    )  # fmt: skip


def ratio_to_truth(texture):
    """Return the picture over the true reflectance, (H, W) of green, scaled to median 1."""
    height, width = texture.bgra.shape[:2]
    s = texture.distance_from_mm + texture.mm_per_px * np.arange(height)
    psi = texture.azimuth_from_rad + texture.rad_per_px * np.arange(width)
    true = reflectance(*np.meshgrid(s, psi, indexing="ij"))[..., 1]
    ratio = texture.bgra[..., 1] / true
    return ratio / np.median(ratio)


@pytest.fixture(scope="module")
def plain():
    T = poses(FRAMES)
    return texture_of([draw(small_probe(), t) for t in T], T)


def test_reflectance_is_recovered_up_to_one_gain(plain):
    # Grey steps of 1 in 60 to 250 are 0.3 % rms; 4 px of 0.6 mm a wave add little.
    ratio = ratio_to_truth(plain)
    assert np.std(ratio) < 0.012
    assert np.percentile(np.abs(ratio - 1), 99) < 0.03


@pytest.mark.parametrize("vignetting", [0.0, 6.0])
def test_the_photo_is_as_bright_as_recorded_at_the_laser_ring(vignetting):
    """A frame's grey levels where its laser ring would be are compared with the photo of the same wall."""
    probe, every, dark = small_probe(), poses(7), 0.6
    images = [draw(probe, t, exposure=dark, vignetting=vignetting) for t in every]
    T, plain = every[3], texture_of(images, every)
    psi = plain.azimuth_from_rad + plain.rad_per_px * np.arange(plain.bgra.shape[1])
    row = round((T[2, 3] + probe.laser.baseline_mm - plain.distance_from_mm) / plain.mm_per_px)
    s = np.full(len(psi), plain.distance_from_mm + row * plain.mm_per_px)
    wall_c = (np.stack([RADIUS * np.cos(psi), RADIUS * np.sin(psi), s], -1) - T[:3, 3]) @ T[:3, :3]
    u, v = np.rint(probe.camera.project(wall_c).uv).astype(int).T
    ratio = plain.bgra[row, :, :3] / np.maximum(images[3][v, u], 1.0)
    assert np.median(ratio) == pytest.approx(1.0, abs=0.03)


def test_colours_share_one_gain(plain):
    height, width = plain.bgra.shape[:2]
    s = plain.distance_from_mm + plain.mm_per_px * np.arange(height)
    psi = plain.azimuth_from_rad + plain.rad_per_px * np.arange(width)
    true = reflectance(*np.meshgrid(s, psi, indexing="ij"))
    gains = [np.median(plain.bgra[..., c] / true[..., c]) for c in range(3)]
    assert np.ptp(gains) / np.mean(gains) < 0.01


def test_all_of_the_measured_wall_gets_texture(plain):
    assert plain.bgra[..., 3].min() == 255
    assert plain.bgra.shape[1] * plain.rad_per_px == pytest.approx(2 * np.pi)


def test_exposure_steps_leave_no_seam():
    T = poses(FRAMES)
    exposure = np.where(np.arange(FRAMES) % 3 == 0, 1.3, 0.8)
    images = [draw(small_probe(), t, exposure=e) for t, e in zip(T, exposure, strict=True)]
    rows = ratio_to_truth(texture_of(images, T)).mean(1)
    # A trend of the exposures along the pipe cannot be distinguished from one of the wall: only a ramp may
    # remain.
    ramp = np.polyval(np.polyfit(np.arange(len(rows)), rows, 1), np.arange(len(rows)))
    assert np.ptp(rows - ramp) < 0.02
    assert np.ptp(ramp) < 0.1


def test_vignetting_that_the_probe_file_does_not_state_is_corrected():
    # cos^6(θ/2) falls by a third over the wall used.
    T = poses(FRAMES)
    ratio = ratio_to_truth(texture_of([draw(small_probe(), t, vignetting=6.0) for t in T], T))
    assert np.std(ratio.mean(1)) < 0.01
    assert np.std(ratio) < 0.015


def test_the_laser_line_does_not_appear_in_the_photo(plain):
    T = poses(FRAMES)
    lined = texture_of([draw(small_probe(), t, laser=True) for t in T], T, kind="both", laser_band_mm=3.0)
    height = min(lined.bgra.shape[0], plain.bgra.shape[0])
    green = lined.bgra[:height, :, 1] / np.maximum(lined.bgra[:height, :, 0], 1.0)
    assert np.percentile(green, 99.9) < 1.1


def test_the_laser_line_would_appear_if_it_were_not_masked():
    """Negative control of the test above.

    The same frames labelled as LED frames, with no outlier rejection.
    """
    T = poses(3, step_mm=8.0)
    images = [draw(small_probe(), t, laser=True) for t in T]
    green = (lambda b: b[..., 1] / np.maximum(b[..., 0], 1.0))(texture_of(images, T, kind="led").bgra)
    assert np.percentile(green, 99.9) > 1.3


def test_a_frame_with_a_reflection_is_rejected_as_an_outlier(plain):
    T = poses(FRAMES)
    images = [draw(small_probe(), t) for t in T]
    images[10] = np.minimum(images[10].astype(int) + 60, 255).astype(np.uint8)
    ratio = ratio_to_truth(texture_of(images, T))
    assert np.std(ratio) < 0.02


def test_dark_and_undecodable_frames_are_counted_and_left_out():
    T = poses(FRAMES)
    images = [draw(small_probe(), t) for t in T]
    images[7], images[12] = np.zeros_like(images[7]), None
    told = {}
    context = replace(quiet_context(), report=lambda name, value, unit="": told.__setitem__(name, value))
    ratio = ratio_to_truth(texture_of(images, T, context=context))
    assert told["rejected: lit frames too dark, clipped or unreadable"] == 2
    assert np.std(ratio) < 0.015


def test_without_lit_frames_there_is_no_texture():
    T = poses(4)
    texture = texture_of([draw(small_probe(), t) for t in T], T, kind="laser")
    assert texture.bgra.max() == 0


def test_a_probe_at_rest_gives_no_error():
    T = np.repeat(poses(1), 4, axis=0)
    T_wall = poses(3)
    texture = photograph_wall(
        recording_of([draw(small_probe(), t) for t in T]), small_probe(), trajectory_of(T), seen_wall(T_wall),
        TextureParameters(), quiet_context(),
    )  # fmt: skip
    assert texture.bgra[..., 3].min() == 255


def test_a_wall_that_no_ring_measured_is_refused():
    T = poses(4)
    wall = seen_wall(T)
    unseen = replace(wall.radius_map, radius_mm=np.full_like(wall.radius_map.radius_mm, np.nan))
    with pytest.raises(UnusableError, match="0 rows of the radius map"):
        photograph_wall(
            recording_of([draw(small_probe(), t) for t in T]), small_probe(), trajectory_of(T),
            replace(wall, radius_map=unseen), TextureParameters(), quiet_context(),
        )  # fmt: skip


@pytest.mark.parametrize("sigma", [0.0, 3.0, 8.0])
def test_the_noise_of_the_pictures_is_reported(sigma):
    T, random = poses(FRAMES), np.random.default_rng(0)
    images = [draw(small_probe(), t) for t in T]
    noise = random.normal(0, sigma, (len(images), *images[0].shape[:2], 1))
    noisy = [np.clip(i + n, 0, 255).astype(np.uint8) for i, n in zip(images, noise, strict=True)]
    told = {}
    context = replace(quiet_context(), report=lambda name, value, unit="": told.setdefault(name, value))
    texture_of(noisy, T, context=context)
    # Interpolation removes up to a third of white noise; for waves of 4 px it errs by 1.6 grey levels.
    found = told["noise of lit pictures, from their differences"]
    assert 0.65 * sigma < found < np.hypot(1.1 * sigma, 1.7)


def test_the_same_input_gives_the_same_bytes(plain):
    T = poses(FRAMES)
    again = texture_of([draw(small_probe(), t) for t in T], T, context=quiet_context(workers=1))
    assert np.array_equal(again.bgra, plain.bgra)


def test_the_stage_is_connected_by_type():
    assert TEXTURE.output() is WallTexture
    assert set(TEXTURE.inputs()) == {"recording", "frames", "probe", "trajectory", "wall"}


def test_the_unrolled_picture_has_the_recorded_brightness_and_place(tmp_path):
    bgra = np.zeros((2, 3, 4), np.uint8)
    bgra[0, 1] = 64, 128, 255, 255
    write_unrolled(WallTexture(bgra, 12.5, 0.1, -np.pi, 2 * np.pi / 3), tmp_path)
    png = cv2.imread(str(tmp_path / "unrolled.png"), cv2.IMREAD_UNCHANGED)
    place = json.loads((tmp_path / "unrolled.json").read_text())
    assert list(png[0, 1, :3]) == [64, 128, 255]
    assert png[0, 1, 3] == 255
    assert png[1].max() == 0
    assert (place["distance_from_mm"], place["mm_per_px"]) == (12.5, 0.1)
