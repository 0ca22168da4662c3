"""Rendered frames agree with the exact line, and are repeatable."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from pipeline.simulator.render import renderer_of
from pipeline.simulator.sensor import through_lens
from tests.exact_rings import exact_rings
from tests.unit.simulated_pipe import small_truth, with_sensor

AZIMUTHS = 180


def centroid_error(truth):
    """Return mean and rms over azimuth of the rendered line's centroid less the exact line, px."""
    light = through_lens(renderer_of(truth).light(0), truth.instrument.sensor, None)[..., 1]
    centre = truth.stated.camera.centre_px
    azimuth = -np.pi + 2 * np.pi * np.arange(AZIMUTHS) / AZIMUTHS
    exact = exact_rings(truth, [0], azimuth, centre)[0]
    along = np.arange(-9, 9, 0.1)
    rho = exact[:, None] + along
    u = (centre[0] + rho * np.cos(azimuth)[:, None]).astype(np.float32)
    v = (centre[1] + rho * np.sin(azimuth)[:, None]).astype(np.float32)
    seen = cv2.remap(light, u, v, cv2.INTER_LINEAR).astype(float)
    error = (seen * along).sum(1) / seen.sum(1)
    return float(error.mean()), float(np.sqrt(np.mean(error**2)))


def test_the_line_is_where_root_finding_puts_it():
    truth = with_sensor(small_truth(), psf_sigma_px=0.8)
    mean, _ = centroid_error(truth)
    # half the curvature of image radius over height times the line's variance: physics, not an error
    z, f = 22.0, 95.0
    curved = 0.5 * 2 * f * 50 * z / (50**2 + z**2) ** 2 * 0.5**2
    assert mean == pytest.approx(curved, abs=0.005)


def test_the_comparison_notices_a_shifted_sheet():
    """Negative control: the comparison above would notice a sheet 0.1 mm further on."""
    truth = small_truth()
    laser = truth.instrument.laser
    moved = replace(laser, sheet=replace(laser.sheet, baseline_mm=laser.sheet.baseline_mm + 0.1))
    other = replace(truth, instrument=replace(truth.instrument, laser=moved))
    azimuth, centre = np.zeros(1), truth.stated.camera.centre_px
    by_hand = exact_rings(other, [0], azimuth, centre) - exact_rings(truth, [0], azimuth, centre)
    assert by_hand[0, 0] < -0.1


def test_the_same_scene_and_seed_give_the_same_bytes():
    truth = with_sensor(small_truth(), full_well_e=8000.0, read_noise_e=10.0)
    first, again = (renderer_of(truth).frame(0) for _ in range(2))
    other = renderer_of(replace(truth, seed=6)).frame(0)
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_leds_light_the_wall_and_their_light_falls_off_ahead():
    light = renderer_of(small_truth()).light(1)[..., 1]
    assert light[150, 199] < light[150, 260] < light[150, 310]
