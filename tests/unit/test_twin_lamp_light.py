"""The light of the LEDs, estimated from samples of frames whose errors are alike within each frame."""

from types import SimpleNamespace

import numpy as np
import pytest

from stages.twin.lamp_light import LampSamples
from stages.twin.scene import LitSight

V, U = np.mgrid[0:60, 0:80].astype(np.float32)
THETA, PHI = 0.4 + np.hypot(V - 30, U - 40) / 60, np.arctan2(V - 30, U - 40)
SCENE = SimpleNamespace(
    polar=(THETA, PHI, THETA > 0),
    surface=SimpleNamespace(mean_radius_mm=50.0),
    probe=SimpleNamespace(laser=SimpleNamespace(baseline_mm=50.0)),
)


def _light(seed, frames=12):
    """Return the light measured where each frame's photo errs on one side by 3 %."""
    random, samples = np.random.default_rng(seed), LampSamples(SCENE, 16.0, 250.0)
    nowhere = np.full(THETA.shape, np.nan, np.float32)
    for frame in range(frames):
        wave = sum(0.03 * random.standard_normal() * f(m * PHI) for m in (1, 2) for f in (np.cos, np.sin))
        noise = 0.02 * random.standard_normal(THETA.shape)
        even = LitSight(np.full(THETA.shape, 80.0, np.float32), np.ones_like(THETA), nowhere, nowhere)
        samples.add(frame, (16 + 80 * np.exp(wave + noise)).astype(np.float32), even, random)
    return samples.solve()


@pytest.mark.parametrize("frames", [2, 3])
def test_few_frames_hold_the_lamps_pattern_in_nine_of_ten_intervals_at_least(frames, monkeypatch):
    """The σ from two frames was 8 times too small, from three 2.6 times."""
    monkeypatch.setattr("stages.twin.lamp_light._SAMPLES", 60)
    lights = [_light(seed, frames) for seed in range(20)]
    assert np.mean([np.abs(light.pattern) < 1.96 * light.pattern_sd for light in lights]) > 0.9


def test_the_uncertainty_of_the_lamps_pattern_allows_for_errors_that_pixels_share(monkeypatch):
    """A blurred run's pattern of .016 had a σ of .0004, and was an LED dim by a fifth."""
    monkeypatch.setattr("stages.twin.lamp_light._SAMPLES", 100)
    lights = [_light(seed) for seed in range(12)]
    off = np.array([light.pattern / light.pattern_sd for light in lights])
    assert 0.6 < np.sqrt(np.mean(off**2)) < 1.5


def test_a_single_frame_does_not_show_how_uncertain_the_lamps_pattern_is():
    """By its pixels, even lamps were uneven by 110 σ: what the frame's photo errs by."""
    assert np.isinf(_light(3, frames=1).pattern_sd).all()
