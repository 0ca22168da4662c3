"""Offsets and gains of single pixels, from frames of a wall that moves."""

import numpy as np
import pytest

from stages.twin.fixed_pattern import fixed_pattern

SHAPE = (240, 320)


def _frames(dark, gain, wrong_photo=0.0, frames=6):
    random = np.random.default_rng(7)
    offsets, gains = dark * random.standard_normal(SHAPE), gain * random.standard_normal(SHAPE)
    broad = 0.05 * np.sin(np.arange(SHAPE[1]) / 40)
    for _ in range(frames):
        level = np.tile(np.linspace(20, 180, SHAPE[1]), (SHAPE[0], 1)) * random.uniform(0.6, 1.2)
        rest = offsets + (gains + broad) * level + wrong_photo * random.standard_normal(SHAPE)
        rest += 1.5 * random.standard_normal(SHAPE)
        yield rest.astype(np.float32), level.astype(np.float32), np.ones(SHAPE, bool)


@pytest.mark.parametrize(("dark", "gain"), [(0.0, 0.0), (3.0, 0.0), (0.0, 0.02), (2.0, 0.01)])
def test_offsets_and_gains_are_distinguished_by_brightness(dark, gain):
    found = fixed_pattern(list(_frames(dark, gain, wrong_photo=2.0)))
    assert found.dark.value == pytest.approx(dark, abs=max(0.25, 0.05 * dark))
    assert found.gain.value == pytest.approx(gain, abs=max(0.003, 0.05 * gain))


def test_a_hot_pixel_is_not_a_pattern():
    frames = list(_frames(0.0, 0.0))
    for rest, _, _ in frames:
        rest[100, 100] = 200.0
    assert fixed_pattern(frames).dark.value < 0.3


def test_few_frames_show_no_pattern():
    assert fixed_pattern(list(_frames(1.0, 0.01, frames=2))) is None
