"""Patch matching against plain NumPy, and strips of a drawn pipe against the true pipe."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from pipeline.arrays import Float32
from pipeline.geometry.rigid import from_parts, rotation_from_vector
from stages.motion import MotionParameters
from stages.motion.tracking.normalisation import SOFTENING_PX, correlated_samples, without_illumination
from stages.motion.tracking.patches import cut
from stages.motion.tracking.strips import Hidden, Strip, StripGrid, sample, softened, unroll
from stages.motion.tracking.tracker import TextureTracker
from tests.unit.drawn_pipe import RADIUS, draw, led_light, reflectance, small_probe, wall_hits

HALF = 8


def texture(shape: tuple[int, int] = (90, 240), seed: int = 0, finest: float = 2.0) -> Float32:
    """Return texture that is periodic in the columns."""
    white = np.random.default_rng(seed).standard_normal(shape).astype(np.float32)
    wide = np.concatenate([white[:, -40:], white, white[:, :40]], 1)
    return cv2.GaussianBlur(wide, (0, 0), finest)[:, 40:-40] * 3


def shifted(image: Float32, rows: float, columns: float) -> Float32:
    """Move an image by a fractional number of pixels, exactly, through its spectrum."""
    k, m = np.fft.fftfreq(image.shape[0])[:, None], np.fft.fftfreq(image.shape[1])
    turn = np.exp(-2j * np.pi * (k * rows + m * columns))
    return np.real(np.fft.ifft2(np.fft.fft2(image) * turn)).astype(np.float32)


def look(image, row, column, side):
    i, j = int(np.floor(row)), int(np.floor(column))
    a, b = row - i, column - j
    rows = i - side // 2 + np.arange(side + 1)
    columns = np.mod(j - side // 2 + np.arange(side + 1), image.shape[1])
    big = image[np.ix_(rows, columns)].astype(float)
    patch = (1 - a) * ((1 - b) * big[:-1, :-1] + b * big[:-1, 1:]) + a * (
        (1 - b) * big[1:, :-1] + b * big[1:, 1:]
    )
    return patch - patch.mean()


def plain_match(image, value, by_row, by_column, inverse, row, column, steps=30):
    """Return offset and correlation of one patch, by the formula of the paper."""
    at, step = np.zeros(2), np.ones(2)
    for _ in range(steps + 1):
        seen = look(image, row + at[0], column + at[1], len(value))
        if np.abs(step).sum() < 0.003:
            break
        error = value - np.sum(value * seen) / np.sum(seen**2) * seen
        step = inverse @ [np.sum(by_row * error), np.sum(by_column * error)]
        at = at + step
    return at, np.sum(value * seen) / np.sqrt(np.sum(value**2) * np.sum(seen**2))


def test_the_match_agrees_with_the_plain_formula() -> None:
    image = texture()
    random = np.random.default_rng(1)
    row, column = random.integers(25, 65, 20), random.integers(0, 240, 20)
    patches = cut(image, row, column, HALF)
    inverse = np.linalg.inv(patches.information)
    near = row + random.uniform(-1.5, 1.5, 20), column + random.uniform(-1.5, 1.5, 20)
    found = patches.match(image, np.ones(image.shape, bool), *near)
    for k in range(20):
        parts = patches.value[k], patches.by_row[k], patches.by_column[k], inverse[k]
        wanted = plain_match(image, *parts, near[0][k], near[1][k])
        np.testing.assert_allclose(found.offset[k], wanted[0], atol=1e-3)
        assert found.correlation[k] == pytest.approx(wanted[1], abs=1e-4)


@pytest.mark.parametrize(("gain", "offset"), [(1.0, 0.0), (0.6, 0.3)])
def test_a_shift_is_found_within_sigma(gain: float, offset: float) -> None:
    random = np.random.default_rng(2)
    image, noise = texture(finest=2.5), 0.05
    there = gain * shifted(image, 0.37, -0.81) + offset
    there = (there + noise * random.standard_normal(image.shape)).astype(np.float32)
    row, column = (
        g.ravel() for g in np.meshgrid(np.arange(20, 70, 12), np.arange(0, 240, 18), indexing="ij")
    )
    patches = cut(image, row, column, HALF)
    found = patches.match(there, np.ones(image.shape, bool), row.astype(float), column.astype(float))
    error = (found.offset - [0.37, -0.81]) / found.sigma[:, None]
    assert np.all(found.correlation > 0.9)
    # Interpolation between samples averages their noise, so that σ, taken from the residual, is low by this
    # factor;
    # the adjustment scales σ by what the residuals show.
    averaged = np.sqrt((0.37**2 + 0.63**2) * (0.19**2 + 0.81**2))
    assert 0.7 < np.sqrt(np.median(error**2)) / 0.6745 * averaged < 1.3
    assert np.all(np.abs(error.mean(0)) < 4 / np.sqrt(len(error)) + 0.3)


def test_patches_that_leave_the_strip_or_contain_unusable_pixels_are_lost() -> None:
    image = texture()
    usable = np.ones(image.shape, bool)
    usable[50:55, 100:105] = False
    row, column = np.array([40, 3, 50, 40]), np.array([30, 30, 100, 239])
    found = cut(image, row, column, HALF).match(image, usable, row.astype(float), column.astype(float))
    np.testing.assert_array_equal(np.isfinite(found.offset[:, 0]), [True, False, False, True])


def test_another_texture_does_not_match() -> None:
    row, column = np.full(12, 45), 20 * np.arange(12)
    patches = cut(texture(seed=0), row, column, HALF)
    found = patches.match(texture(seed=9), np.ones((90, 240), bool), row.astype(float), column.astype(float))
    assert not np.any(found.correlation > 0.8)


def test_sampling_is_bilinear() -> None:
    random = np.random.default_rng(3)
    image = cv2.GaussianBlur(random.integers(0, 255, (60, 80)).astype(np.uint8), (0, 0), 2)
    coarse = np.stack(np.meshgrid(np.linspace(3, 70, 11), np.linspace(4, 50, 8)), -1).astype(np.float32)
    coarse += random.uniform(-0.5, 0.5, coarse.shape).astype(np.float32)
    grey, seen = sample(image, coarse, (8, 4))
    i, j = np.meshgrid(np.arange(56) / 8, np.arange(40) / 4, indexing="ij")
    uv = [
        cv2.remap(coarse[..., c].copy(), j.astype(np.float32), i.astype(np.float32), cv2.INTER_LINEAR)
        for c in (0, 1)
    ]
    wanted = cv2.remap(image.astype(np.float32), uv[0], uv[1], cv2.INTER_LINEAR)
    assert seen.all()
    np.testing.assert_allclose(grey, wanted, atol=0.3)  # cv2 rounds positions to 1/32 px


def test_sampling_marks_what_lies_outside() -> None:
    coarse = np.stack(np.meshgrid(np.linspace(-20, 100, 11), np.linspace(-20, 80, 8)), -1).astype(np.float32)
    grey, seen = sample(np.full((60, 80), 9, np.uint8), coarse, (8, 4))
    assert 0 < seen.mean() < 1
    np.testing.assert_array_equal(grey[~seen], 0)
    np.testing.assert_allclose(grey[seen], 9, atol=1e-4)


def grid() -> StripGrid:
    return StripGrid(RADIUS, 480, RADIUS / np.tan(1.3), RADIUS / np.tan(0.7))


def pose(roll: float = 0.2, z: float = 7.0):
    return from_parts(rotation_from_vector(np.array([0.01, -0.02, roll])), np.array([1.0, -0.7, z]))


def true_contrast(strip: Strip, wall: StripGrid) -> Float32:
    """Return the wall's reflectance on the strip over the mean of each row."""
    row, column = np.meshgrid(*(np.arange(n) for n in strip.contrast.shape), indexing="ij")
    xyz = wall.wall(strip.first_row + row, column)
    own = reflectance(xyz[..., 2], np.arctan2(xyz[..., 1], xyz[..., 0]))[..., 1].astype(np.float32)
    return (own / own.mean(1, keepdims=True) - 1).astype(np.float32)


def test_unrolled_texture_is_at_its_place_on_the_wall() -> None:
    probe, wall = small_probe(), grid()
    image = draw(probe, pose())[..., 1]
    strip = unroll(image, probe, pose(), wall, Hidden())
    wanted = true_contrast(strip, wall)
    inner = (slice(22, -22), slice(22, -22))
    assert strip.usable.mean() > 0.9
    both = strip.contrast[inner] - strip.contrast[inner].mean(), wanted[inner] - wanted[inner].mean()
    assert np.sum(both[0] * both[1]) / np.sqrt(np.sum(both[0] ** 2) * np.sum(both[1] ** 2)) > 0.9
    (dx, dy), _ = cv2.phaseCorrelate(*(np.ascontiguousarray(b) for b in both))
    assert max(abs(dx), abs(dy)) < 0.5


def test_a_plain_wall_seen_off_the_axis_is_uniform_except_for_errors_of_the_lamps() -> None:
    probe, wall = small_probe(), grid()
    T = from_parts(np.eye(3), np.array([3.0, -2.0, 7.0]))
    light = led_light(probe, T, wall_hits(probe, T))
    image = np.clip(160 * light / np.percentile(light, 99), 0, 255).astype(np.uint8)
    other = replace(probe, lighting=replace(probe.lighting, z_mm=-15.0))
    even, uneven = (unroll(image, lit_by, T, wall, Hidden()) for lit_by in (probe, other))
    assert even.usable.mean() > 0.8
    assert np.abs(even.contrast[even.usable]).max() < 0.04
    assert np.abs(uneven.contrast[uneven.usable]).max() > 2 * np.abs(even.contrast[even.usable]).max()


@pytest.mark.parametrize(("exposure", "seen"), [(0.0, False), (0.15, True)])
@pytest.mark.parametrize("also", [0, 235])
def test_a_picture_with_the_lamps_dead_shows_no_wall(exposure: float, seen: bool, also: int) -> None:
    """Black is 16 in limited range; divided by the light it was followed as texture that stands still.

    A time of day burnt into the picture, and noise, are no light on the wall.
    """
    probe, wall = small_probe(), grid()
    noise = np.random.default_rng(0).normal(0, 3 if also else 0, (300, 400))
    image = 17 + draw(probe, pose(), exposure=exposure)[..., 1] + (np.indices((300, 400)).sum(0) % 7 == 0)
    image = np.clip(image + noise, 0, 255)
    image[5:15, 5:100] = np.maximum(image[5:15, 5:100], also)
    strip = unroll(softened(image.astype(np.uint8)), probe, pose(), wall, Hidden())
    assert bool(strip.usable.any()) == seen


def test_the_search_range_of_patches_is_that_of_possible_errors_within_the_view() -> None:
    probe, wall = small_probe(), grid()
    strip = unroll(softened(draw(probe, pose())[..., 1]), probe, pose(), wall, Hidden((20.0, 24.0)))
    tracker = TextureTracker(
        probe, wall, MotionParameters.model_validate({"patch_half_px": HALF}), Hidden((20.0, 24.0))
    )
    row = np.arange(strip.contrast.shape[0])
    looked_for = tracker._in_view(strip, np.stack([row, np.full(len(row), 100.3)], -1))
    for i in np.flatnonzero(looked_for):
        assert strip.usable[i - HALF - 3 : i + HALF + 4, 80:120].all()
    assert looked_for.any()
    assert not tracker._in_view(strip, np.array([[-4.0, 100.0], [len(row) + 2.0, 100.0]])).any()


def test_the_strip_knows_which_pixels_it_was_sampled_from() -> None:
    probe, wall = small_probe(), grid()
    strip = unroll(softened(draw(probe, pose())[..., 1]), probe, pose(), wall, Hidden())
    row, column = strip.first_row + np.array([5.0, 30.3, 50.9]), np.array([2.0, 100.7, 479.5])
    T = pose()
    xyz_c = (wall.wall(row, column) - T[:3, 3]) @ T[:3, :3]
    np.testing.assert_allclose(strip.pixel(row, column), probe.camera.project(xyz_c).uv, atol=0.05)


def test_the_wall_under_the_laser_line_is_not_usable() -> None:
    probe, wall = small_probe(), grid()
    strip = unroll(softened(draw(probe, pose())[..., 1]), probe, pose(), wall, Hidden((20.0, 24.0)))
    ahead = (strip.first_row + np.arange(strip.usable.shape[0])) * wall.step_mm - 7.0
    hidden = (ahead > 20.0) & (ahead < 24.0)
    assert hidden.any()
    assert not strip.usable[hidden].any()
    assert strip.usable[~hidden].mean() > 0.9


def mean_shift(slope_per_px: float) -> float:
    """Return by how many rows matches move when light falls by ``slope_per_px`` along one strip."""
    image = 100 * (1 + 0.15 * texture(seed=4, finest=2.5))
    light = np.exp(-slope_per_px * np.arange(90))[:, None]
    usable = np.ones(image.shape, bool)
    first = without_illumination(image.astype(np.float32), usable)
    second = without_illumination((image * light).astype(np.float32), usable)
    row, column = (
        g.ravel() for g in np.meshgrid(np.arange(25, 65, 10), np.arange(0, 240, 15), indexing="ij")
    )
    found = cut(first, row, column, HALF).match(second, usable, row.astype(float), column.astype(float))
    return float(np.mean(found.offset[:, 0]))


def naive_shift(slope_per_px: float) -> float:
    image = 100 * (1 + 0.15 * texture(seed=4, finest=2.5))
    light = np.exp(-slope_per_px * np.arange(90))[:, None]
    usable = np.ones(image.shape, bool)
    row, column = (
        g.ravel() for g in np.meshgrid(np.arange(25, 65, 10), np.arange(0, 240, 15), indexing="ij")
    )
    patches = cut(image.astype(np.float32), row, column, HALF)
    found = patches.match((image * light).astype(np.float32), usable, row.astype(float), column.astype(float))
    return float(np.nanmean(found.offset[:, 0]))


def test_a_gradient_of_the_light_does_not_shift_matches() -> None:
    assert abs(mean_shift(0.03)) < 0.02
    assert abs(naive_shift(0.03)) > 0.1, "the control must be shifted, otherwise this test shows nothing"


@pytest.mark.parametrize("px_per_sample", [0.7, 1.5])
def test_correlated_noise_of_blurred_samples_counts_as_fewer_samples(px_per_sample: float) -> None:
    """The mean of many blurred noise samples is as unsure as that of so many fewer independent ones."""
    blur, side = np.hypot(SOFTENING_PX / px_per_sample, 0.7), 64
    noise = np.random.default_rng(0).standard_normal((64 * side, 64 * side)).astype(np.float32)
    seen = cv2.GaussianBlur(noise, (0, 0), blur)
    means = seen.reshape(64, side, 64, side).mean((1, 3))
    wanted = side**2 * means.var() / seen.var()
    assert correlated_samples(np.array([px_per_sample]))[0] == pytest.approx(wanted, rel=0.15)
