"""The noise-free picture of one exposure, as a frame of a recording and on its own."""

from dataclasses import replace

import numpy as np

from pipeline.simulator.render import mean_grey, picture, renderer_of, scenery_of, still
from tests.unit.simulated_pipe import small_truth, with_sensor


def test_a_still_picture_equals_the_frame_of_a_camera_at_rest():
    truth = small_truth()
    pose = truth.poses()[1]
    shot = still(truth.instrument, "led", pose, truth.rendering)
    expected = mean_grey(renderer_of(truth).seen(1), truth.instrument.sensor)
    np.testing.assert_array_equal(picture(scenery_of(truth.wall), shot), expected)
    aside = pose.copy()
    aside[0, 3] += 3.0
    moved = picture(scenery_of(truth.wall), still(truth.instrument, "led", aside, truth.rendering))
    assert np.abs(moved - expected).max() > 1.0


def test_the_picture_is_the_mean_of_noisy_frames():
    """20 frames of one scene with noise: their mean is the picture within 6 σ and half a grey level."""
    truth = with_sensor(small_truth(), full_well_e=4000.0, read_noise_e=12.0, black_level=9.0, gamma=0.8)
    frames = [renderer_of(replace(truth, seed=s)).frame(1).astype(float) for s in range(20)]
    noise = np.std(frames, axis=0) / np.sqrt(len(frames))
    made = picture(scenery_of(truth.wall), still(truth.instrument, "led", truth.poses()[1], truth.rendering))
    lit = (made > 30) & (made < 240)
    assert lit.mean() > 0.3
    assert np.abs(np.mean(frames, 0) - made)[lit].max() < (6 * noise[lit]).max() + 0.5
    assert abs((np.mean(frames, 0) - made)[lit].mean()) < 0.1
