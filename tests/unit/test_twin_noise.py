"""The camera's noise, estimated from windows of drawn frames."""

from dataclasses import replace

import numpy as np
import pytest

from stages.twin.lamp_light import Figure
from stages.twin.noise import NoiseWindows, photon_transfer, windows_of

BLACK = Figure(16.0, 0.1)


def _noisy_frames(read, electrons, frames=4):
    random = np.random.default_rng(5)
    level = np.tile(np.linspace(10, 180, 480, dtype=np.float32), (360, 1))
    whole = np.ones(level.shape, bool)
    of_wall = 5 * np.sin(np.arange(480) / 5.0) * (np.arange(360) % 90 < 40)[:, None]
    for _ in range(frames):
        first, second = (
            (of_wall + random.standard_normal(level.shape) * np.sqrt(read**2 + level / electrons)).astype(
                np.float32
            )
            for _ in range(2)
        )
        yield windows_of(first, second, level, whole)


def test_photon_transfer_finds_the_true_noise():
    noise = photon_transfer(list(_noisy_frames(1.5, 40.0)), BLACK, 255.0)
    assert noise.electrons_per_level.value == pytest.approx(40.0, rel=0.12)
    assert noise.read_electrons.value == pytest.approx(60.0, rel=0.15)
    level = np.array([20.0, 90.0, 170.0], np.float32)
    np.testing.assert_allclose(noise.variance(level), 1.5**2 + level / 40, rtol=0.05)


def _dim_frames(random, read, electrons, rows=96):
    level = np.tile(np.linspace(20, 60, 240, dtype=np.float32), (rows, 1))
    for _ in range(6):
        first, second = (
            random.standard_normal((2, *level.shape)) * np.sqrt(read**2 + level / electrons)
        ).astype(np.float32)
        yield windows_of(first, second, level, level > 0)


def test_read_noise_in_electrons_is_no_surer_than_their_number():
    """Its σ neglected that of the conversion: one true value in four was within 2 σ."""
    made = [
        photon_transfer(list(_dim_frames(np.random.default_rng(k), 1.0, 40.0)), BLACK, 255.0)
        for k in range(20)
    ]
    read = [n.read_electrons for n in made if np.isfinite(n.electrons_per_level.value)]
    assert len(read) > 12
    assert np.mean([abs(f.value - np.sqrt(1 - 1 / 12) * 40) < 2 * f.sd for f in read]) >= 0.85
    unknown = replace(made[0], variance_per_level=Figure(0.0, 0.01)).read_electrons
    assert np.isinf(unknown.value), "without shot noise nothing is known in electrons"


def test_read_noise_in_grey_levels_does_not_need_the_number_of_electrons():
    """Only electrons were stated, 57 ± 14 for 81, though it was their number that was uncertain."""
    made = [
        photon_transfer(list(_dim_frames(np.random.default_rng(k), 1.5, 40.0)), BLACK, 255.0)
        for k in range(12)
    ]
    levels, true = [n.read_levels for n in made], np.sqrt(1.5**2 - 1 / 12)
    assert np.mean([abs(f.value - true) < 2 * f.sd for f in levels]) >= 0.8
    assert np.median([f.sd for f in levels]) < 0.15 * true
    assert np.median([n.read_electrons.sd for n in made]) > 0.15 * true * 40


def test_the_sigma_of_noise_includes_that_errors_of_the_photo_look_like_uneven_pixels():
    """In a rendered recording 1.33 ± .07 grey levels were told for 1.09: errors grew with brightness."""
    random = np.random.default_rng(3)
    each = [random.uniform(38, 140, 400) for _ in range(6)]
    made = [
        NoiseWindows(x, (1.267 + 0.0114 * x + 0.37 + 1.2e-4 * x**2) * random.chisquare(140, 400) / 140)
        for x in each
    ]
    read = photon_transfer(made, BLACK, 255.0).read_levels
    assert abs(read.value - np.sqrt(1.267 - 1 / 12)) < 2 * read.sd


@pytest.mark.parametrize(("power", "known"), [(1.0, False), (0.4, True)])
def test_a_response_is_known_only_if_read_noise_does_not_look_alike(power, known):
    """Read noise of 1.3 grey levels under a linear response was told as an exponent of 1.45 ± .02."""
    random = np.random.default_rng(3)
    each = [random.uniform(8, 60, 600) for _ in range(6)]
    made = [NoiseWindows(x, (1.6 + 0.017 * x) * random.chisquare(140, 600) / 140) for x in each]
    if power != 1:
        made = [NoiseWindows(x, 0.1 * x**power * random.chisquare(140, 600) / 140 + 1 / 12) for x in each]
    gamma = photon_transfer(made, BLACK, 255.0).gamma
    assert np.isfinite(gamma.sd) == known
    assert not known or gamma.value == pytest.approx(2 - power, abs=0.1)


@pytest.mark.parametrize("rows", [12, 60])
def test_few_windows_show_little_of_the_noise_and_say_so(rows):
    """With some hundred windows each part alone had too few; all gave the same empty result with a σ of 0."""
    windows = list(_dim_frames(np.random.default_rng(1), 1.0, 10.0, rows=rows))
    noise = photon_transfer(windows, BLACK, 255.0)
    assert noise.variance_per_level.sd > 0.01
    assert noise.variance_per_level.sd == np.inf or abs(noise.variance_per_level.value - 0.1) < 0.05


def test_other_noise_gives_another_estimate():
    quiet, loud = (photon_transfer(list(_noisy_frames(1.0, e)), BLACK, 255.0) for e in (200.0, 20.0))
    assert loud.variance_per_level.value > 5 * quiet.variance_per_level.value


def test_pictures_without_noise_in_the_dark_have_that_of_rounding():
    black = np.zeros((120, 240), np.float32)
    noise = photon_transfer([windows_of(black, black, black, black == 0)] * 2, BLACK, 255.0)
    assert noise.read_variance.value == pytest.approx(1 / 12)


@pytest.mark.parametrize("frames", [1, 2])
def test_read_noise_of_few_frames_has_a_sigma(frames):
    """From one frame it was 0 ± NaN, and from two 0 ± 0 where rounding exceeds the read noise."""
    noise = photon_transfer(list(_noisy_frames(0.2, 40.0, frames=frames)), BLACK, 255.0)
    read = noise.read_electrons
    assert abs(read.value - 0.2 * 40) < 2 * read.sd
    assert frames == 2 or read.sd == np.inf


def test_the_sigma_of_parts_of_the_noise_is_their_scatter():
    """For parts that were 0 in every fit, or nearly so, σ was 0 or far too small."""
    made = [
        photon_transfer(list(_dim_frames(np.random.default_rng(k), 1.0, 40.0, rows=48)), BLACK, 255.0)
        for k in range(40)
    ]
    assert all(min(n.read_variance.sd, n.variance_per_level.sd, n.uneven.sd) > 0 for n in made)
    for part, true in (("read_variance", 1.0), ("variance_per_level", 1 / 40), ("uneven", 0.0)):
        figures = [getattr(n, part) for n in made]
        assert np.mean([abs(f.value - true) <= 2.001 * f.sd for f in figures]) >= 0.9, part


def test_windows_of_one_grey_level_show_only_the_sum_of_the_noise():
    """Read noise was that of rounding, and shot noise 0, both with a σ of 0."""
    random, level = np.random.default_rng(0), np.full((96, 240), 100, np.float32)
    windows = [
        windows_of(*(2 * random.standard_normal((2, *level.shape))).astype(np.float32), level, level > 0)
        for _ in range(6)
    ]
    noise = photon_transfer(windows, BLACK, 255.0)
    assert noise.variance(np.array([100.0], np.float32))[0] == pytest.approx(4.0, rel=0.05)
    assert {noise.read_variance.sd, noise.variance_per_level.sd, noise.uneven.sd} == {np.inf}


@pytest.mark.parametrize("levels", [(20, 100), (0, 60)])
def test_windows_of_two_grey_levels_do_not_separate_the_noise(levels):
    """Equal levels left two cells, to which three parts were fitted: wrong values with a σ of nearly 0."""
    random = np.random.default_rng(0)
    each = [random.choice(levels, 400).astype(float) for _ in range(6)]
    windows = [NoiseWindows(x, (1 + 0.02 * x + 0.0004 * x**2) * random.chisquare(24, 400) / 24) for x in each]
    noise = photon_transfer(windows, BLACK, 255.0)
    assert {noise.read_variance.sd, noise.variance_per_level.sd, noise.uneven.sd} == {np.inf}
    at = np.array(levels, np.float32)
    np.testing.assert_allclose(noise.variance(at), 1 + 0.02 * at + 0.0004 * at**2, rtol=0.1)
