"""Effects on pictures only: place, size and law of each, and that the diagnosis does not name them."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.physics.catalogue import EFFECTS
from pipeline.physics.picture import PICTURE_EFFECTS
from pipeline.simulator.effects import switch_on
from pipeline.simulator.effects.switch import Switch
from pipeline.simulator.instrument import TrueSensor
from pipeline.simulator.motion import Signal
from pipeline.simulator.render import renderer_of
from pipeline.simulator.sensor import exposed, through_lens, with_dark_signal
from pipeline.simulator.sheet import room_mm
from pipeline.simulator.truth import SceneTruth
from pipeline.simulator.wall_light import glow_of_lamps, lamps_of, ring_to_ring
from tests.unit.simulated_pipe import small_truth

LASER, LED = 0, 1
BLANK = TrueSensor(psf_sigma_px=0.0)


def truth_with(name: str, *sizes: float) -> SceneTruth:
    return switch_on(small_truth(), [Switch(name, sizes)])


def ratio(truth: SceneTruth, frame: int) -> np.ndarray:
    """Return the light (H, W) of a frame over that without the effect; NaN where it is dark."""
    one, other = (renderer_of(t).seen(frame)[..., 1].astype(float) for t in (truth, small_truth()))
    return np.where(other > 0.02, one / np.maximum(other, 0.02), np.nan)


def azimuth_deg() -> np.ndarray:
    v, u = np.mgrid[:300, :400]
    return np.degrees(np.arctan2(v - 149.5, u - 199.5))


def test_the_diagnosis_does_not_name_effects_on_pictures():
    assert not {e.name for e in PICTURE_EFFECTS} & set(EFFECTS)


def test_flicker_changes_rows_by_the_mean_power_of_their_exposure():
    frequency, readout, exposure = 120.0, 0.02, 0.003
    truth = truth_with("light_flicker", 0.3, frequency)
    shutter = replace(truth.instrument.shutter, kind="rolling", readout_s=readout, exposure_s=exposure)
    banded, steady = (
        replace(
            t, instrument=replace(t.instrument, shutter=shutter), stated=replace(t.stated, shutter=shutter)
        )
        for t in (truth, small_truth())
    )
    seen = [np.nansum(renderer_of(t).light(LED)[..., 1], axis=1) for t in (banded, steady)]
    # the mean over many moments of the exposure, computed here
    row = np.arange(300)
    opened = 1 / 30 + ((row + 0.5) / 300 - 0.5) * readout
    within = np.linspace(-exposure / 2, exposure / 2, 2001)
    power = 1 + 0.3 * np.sin(2 * np.pi * frequency * (opened[:, None] + within)).mean(1)
    lit = seen[1] > 1
    assert lit.sum() > 200
    np.testing.assert_allclose(seen[0][lit] / seen[1][lit], power[lit], atol=2e-4)
    assert np.ptp(power) > 0.3


def test_with_a_global_shutter_flicker_is_one_factor_a_frame():
    change = ratio(truth_with("light_flicker", 0.2, 7.0), LED)
    assert np.nanmax(change) - np.nanmin(change) < 1e-4
    assert np.nanmean(change) == pytest.approx(1 + 0.2 * np.sin(2 * np.pi * 7 / 30), abs=1e-4)


def test_a_dead_led_removes_its_own_light_and_darkens_its_side():
    truth = truth_with("led_dead", 1.0, 60.0)
    assert sum(truth.instrument.light.pattern) == 7
    change = ratio(truth, LED)
    near, far = np.abs(azimuth_deg() - 60) < 15, np.abs(azimuth_deg() + 120) < 15
    assert np.nanmean(change[near]) < np.nanmean(change[far]) - 0.02 < 1
    # each LED removes what it gave: dead one by one, they remove all the light once
    whole = renderer_of(small_truth()).light(LED).astype(float)
    lost = sum(whole - renderer_of(truth_with("led_dead", 1.0, 22.5 + 45.0 * k)).light(LED) for k in range(8))
    np.testing.assert_allclose(lost, whole, atol=1e-4)
    assert np.array_equal(renderer_of(truth).light(LASER), renderer_of(small_truth()).light(LASER))


def test_a_ghost_ring_adds_light_beside_the_line():
    """Its kernel did not compile, so that the effect could not be used."""
    with_it, plain = (renderer_of(t).light(LASER) for t in (truth_with("ghost_ring", 0.1), small_truth()))
    more = (with_it - plain).astype(float)
    assert more.min() > -1e-5
    assert 0.02 < more.sum() / plain.sum(dtype=float) < 0.3


def test_a_blocked_sector_of_the_laser_has_its_place_and_width():
    truth = truth_with("laser_sector", 0.8, 60.0, 20.0)
    change, away = ratio(truth, LASER), azimuth_deg() - 60
    assert np.nanmean(change[np.abs(away) < 5]) == pytest.approx(0.2, abs=0.01)
    assert np.nanmean(change[np.abs(away) > 18]) == pytest.approx(1.0, abs=1e-3)
    # the camera is off-centre: azimuths about the picture's middle and of the sheet differ by about a degree
    lost = np.nanmean([np.nanmean((1 - change)[np.abs(away - a) < 0.5]) for a in np.arange(-20, 20.5)]) * 41
    assert lost / 0.8 == pytest.approx(20.0, abs=1.5)
    assert np.array_equal(renderer_of(truth).light(LED), renderer_of(small_truth()).light(LED))


def test_bloom_keeps_the_total_light_and_leaks_along_columns_only():
    light = np.zeros((101, 61, 3), np.float32)
    light[50, 30] = 5.0
    sensor = replace(BLANK, bloom_relative=0.4, bloom_px=4.0)
    seen = through_lens(light, sensor, None)[..., 0].astype(float)
    assert seen.sum() == pytest.approx(5.0, rel=1e-5)
    assert np.flatnonzero(seen.sum(0)).tolist() == [30]
    assert seen[46, 30] / seen[42, 30] == pytest.approx(np.e, rel=1e-3)
    assert seen.sum() - seen[50, 30] == pytest.approx(0.4 * 4.0, rel=0.15)
    dim = np.full((20, 20, 3), 0.99, np.float32)
    assert np.array_equal(through_lens(dim, sensor, None), dim)


def test_blur_grows_with_the_square_of_the_distance_from_the_middle():
    sensor = replace(BLANK, psf_sigma_px=0.8, psf_edge_px=2.0)
    for u in (200, 260, 340):
        light = np.zeros((301, 401, 3), np.float32)
        light[150, u] = 1.0
        seen = through_lens(light, sensor, None)[..., 0].astype(float)
        share = np.abs(u - 200) / 150.5
        spread = (seen * (np.arange(301) - 150)[:, None] ** 2).sum() / seen.sum()
        assert spread == pytest.approx(0.64 + 4.0 * share**4, rel=0.12)
        assert seen.sum() == pytest.approx(1.0, rel=0.05)


def test_scattering_reduces_contrast_and_keeps_the_mean():
    v, u = np.mgrid[:300, :400]
    light = np.repeat((0.4 + 0.2 * np.sin(u / 3.0))[..., None], 3, -1).astype(np.float32)
    truth = truth_with("window_scatter", 0.6, 60.0, 6.0)
    (spot,) = truth.instrument.sensor.scatter
    seen = through_lens(light, replace(BLANK, scatter=(spot,)), None)[..., 0]
    away = np.hypot(u - spot.centre_px[0], v - spot.centre_px[1]) / spot.sigma_px[0]
    inside, middle = (away < 2) & (v > 60) & (v < 240), away < 0.3
    scattered = 0.6 * np.exp(-0.5 * away**2)
    by_hand = (1 - scattered) * light[..., 0] + scattered * 0.4
    np.testing.assert_allclose(seen[inside], by_hand[inside], atol=0.02)
    assert np.ptp(seen[middle]) < 0.5 * np.ptp(light[..., 0][middle])
    assert np.array_equal(seen[away > 8], light[..., 0][away > 8])


def test_a_drop_moves_the_picture_inside_it_and_nothing_outside():
    v, u = np.mgrid[:300, :400].astype(float)
    light = np.repeat((u / 400)[..., None], 3, -1).astype(np.float32)
    for power in (0.5, 2.0):
        truth = truth_with("droplet", power, 60.0, 8.0)
        (drop,) = truth.instrument.sensor.drops
        seen = 400 * through_lens(light, replace(BLANK, drops=(drop,)), None)[..., 0].astype(float)
        (cu, cv), radius = drop.centre_px, drop.sigma_px[0]
        away = np.hypot(u - cu, v - cv)
        np.testing.assert_allclose(seen[away >= radius], u[away >= radius], atol=1e-4)
        half = (np.abs(v - cv) < 0.6) & (np.abs(u - cu - radius / 2) < 0.6)
        moved = cu + (u[half] - cu) * (1 - power * (1 - (away[half] / radius) ** 2))
        np.testing.assert_allclose(seen[half], moved, atol=0.05)


def test_defective_pixels_stay_at_their_places_and_have_the_given_number():
    sensor = replace(BLANK, defective_share=0.01, hot_level=0.3)
    light = np.full((300, 400, 3), 0.5, np.float32)
    one, again, other = (with_dark_signal(light, sensor, seed)[..., 0] for seed in (4, 4, 5))
    assert np.array_equal(one, again)
    assert not np.array_equal(one, other)
    hot, dead = (one == np.float32(0.8)), (one == 0)
    assert hot.mean() == pytest.approx(0.01, rel=0.15)
    assert dead.mean() == pytest.approx(0.01, rel=0.15)
    assert (hot | dead | (one == 0.5)).all()


def test_noise_follows_emva_1288():
    """The variance is that of reading plus one electron for each electron of signal; a dark pattern stays."""
    sizes = (("full_well", 4000.0), ("read_noise", 30.0), ("dark_pattern", 0.02))
    truth = switch_on(small_truth(), [Switch(name, (size,)) for name, size in sizes])
    sensor = truth.instrument.sensor
    for level in (0.2, 0.6):
        light = with_dark_signal(np.full((150, 200, 3), level, np.float32), sensor, 7)
        frames = np.array([exposed(light, sensor, 7, k).astype(float) for k in range(24)])
        variance = (level * 4000 + 30**2) * (255 / 4000) ** 2 + 1 / 12
        assert frames.var(axis=0, ddof=1).mean() == pytest.approx(variance, rel=0.03)
        pattern = frames.mean(0)[..., 0].std()
        assert pattern == pytest.approx(np.hypot(0.02 * 255, np.sqrt(variance / 24)), rel=0.03)


def test_black_level_is_the_value_of_a_dark_pixel():
    sensor = truth_with("black_level", 12.0).instrument.sensor
    grey = exposed(np.zeros((50, 50, 3), np.float32), replace(sensor, read_noise_e=0.0), 1, 0)
    assert (grey == 12).all()


def test_light_from_ring_to_ring_is_the_sum_over_their_elements():
    """Lambert's law between two elements of a cylinder, summed around; all light meets some wall."""
    radius, around = 30.0, 2 * np.pi * (np.arange(20000) + 0.5) / 20000
    for apart in (1.0, 12.0, 55.0):
        across = radius * (1 - np.cos(around))
        squared = 2 * radius * across + apart**2
        by_hand = np.mean(across**2 / squared**2) * 2 * np.pi * radius / np.pi
        assert ring_to_ring(np.array(apart), radius) == pytest.approx(by_hand, rel=1e-5)
    step = 0.01
    assert step * ring_to_ring(np.arange(-5000, 5000, step), radius).sum() == pytest.approx(1.0, abs=1e-4)


def test_light_of_the_line_falls_on_the_wall_ahead():
    truth = truth_with("interreflection", 1.0)
    lit, plain = (renderer_of(t).light(LASER)[..., 1].astype(float) for t in (truth, small_truth()))
    glow, laser, pose = lit - plain, truth.instrument.laser, truth.poses()[LASER]
    for ahead in (10.0, 30.0, 60.0):
        place = np.array([50.0, 0.0, pose[2, 3] + ahead])
        u, v = truth.stated.camera.project(pose[:3, :3].T @ (place - pose[:3, 3])).uv.round().astype(int)
        by_hand = 0.4 * 0.4 * laser.power_mm * ring_to_ring(np.array(ahead - 22.0), 50.0)
        assert glow[v, u] == pytest.approx(by_hand, rel=0.05)


def test_reflected_light_of_the_lamps_is_their_light_times_the_reflectance():
    lamps = lamps_of(small_truth().instrument.light)
    once = glow_of_lamps(lamps, 50.0, np.array([0.2, 0.4, 0.8]), 7.0)
    twice = glow_of_lamps(lamps._replace(share=2 * lamps.share), 50.0, np.array([0.2, 0.4, 0.8]), 7.0)
    np.testing.assert_allclose(once.glow[:, 2], 4 * once.glow[:, 0])
    np.testing.assert_allclose(twice.glow, 2 * once.glow)
    lit, plain = (
        renderer_of(t).light(LED)[150, 290:, 1].astype(float)
        for t in (truth_with("interreflection", 1.0), small_truth())
    )
    assert ((lit - plain) > 0).all()
    assert 0.05 < (lit - plain).sum() / plain.sum() < 0.4


def test_a_longer_exposure_from_the_same_start_shows_the_camera_later():
    truth, longer = small_truth(), 0.024
    shot = renderer_of(truth_with("motion_blur", longer)).shot(LED)
    expected = truth.motion.pose(truth.frames.time_s[LED] + longer / 2, truth.wall.axis)
    np.testing.assert_allclose(shot.T_pc[..., :3, 3].mean(axis=(0, 1)), expected[:3, 3], atol=1e-3)
    assert np.linalg.norm(expected[:3, 3] - truth.poses()[LED, :3, 3]) > 0.1


def test_the_line_of_a_longer_exposure_is_that_of_the_camera_at_its_middle():
    across = Signal(np.array([-1.0, 1.0]), np.array([-20.0, 20.0]))
    truth, longer = replace(small_truth(), motion=replace(small_truth().motion, x_mm=across)), 0.024
    azimuth = np.linspace(-3.0, 3.0, 12)
    uv = np.array([199.5, 149.5]) + 100 * np.stack([np.cos(azimuth), np.sin(azimuth)], -1)
    late = replace(truth, frames=replace(truth.frames, time_s=truth.frames.time_s + longer / 2))
    room = room_mm(switch_on(truth, [Switch("motion_blur", (longer,))]), LED, uv)
    np.testing.assert_allclose(room, room_mm(late, LED, uv), atol=1e-6)
    assert np.nanmax(np.abs(room - room_mm(truth, LED, uv))) > 0.1
