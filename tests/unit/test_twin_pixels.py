"""Defective pixels: distinguished from moving wall, from noise, and from larger dirt."""

import cv2
import numpy as np
import pytest

from stages.twin.pixels import DefectivePixels, defective_pixels

SHAPE, FRAMES = (120, 160), 14
SEEN = np.ones(SHAPE, bool)


def _frames(hot=(), dead=(), dirt=None, pattern=0.0):
    random = np.random.default_rng(3)
    offset = pattern * np.random.default_rng(4).standard_normal(SHAPE)
    wall = cv2.GaussianBlur(random.normal(0, 60, (SHAPE[0] + 10 * FRAMES, SHAPE[1])), (0, 0), 2)
    images = []
    for k in range(FRAMES):
        lit = k % 2 == 0
        level = 70 + wall[10 * k : 10 * k + SHAPE[0]] if lit else np.full(SHAPE, 16.0)
        image = level + offset + random.normal(0, 3, SHAPE)
        for at in hot:
            image[at] += 50
        for at in dead:
            image[at] = 16
        if dirt is not None:
            image[dirt] = 16
        images.append(np.clip(image, 0, 255).astype(np.uint8))
    return images, [k % 2 == 0 for k in range(FRAMES)], SEEN


def test_hot_and_dead_pixels_are_counted():
    (found,) = defective_pixels(*_frames([(20, 30), (90, 100)], [(60, 70)])).mismatches()
    assert found.name == "defective_pixels"
    assert found.statement.startswith("2 single pixels are too bright in all frames, 1 too dark")
    assert found.parameters[0].value == 3 / SEEN.size


def test_moving_wall_noise_and_dirt_are_not_defective_pixels():
    assert defective_pixels(*_frames()).mismatches() == ()
    assert defective_pixels(*_frames(dirt=(slice(40, 43), slice(50, 60)))).mismatches() == ()


def test_the_tail_of_a_dark_pattern_is_not_a_defect_but_a_hot_pixel_in_it_is():
    """With offsets that spread by five grey levels, one pixel in a thousand was called defective."""
    assert defective_pixels(*_frames(pattern=5.0)).mismatches() == ()
    (found,) = defective_pixels(*_frames([(20, 30)], pattern=5.0)).mismatches()
    assert found.statement.startswith("1 single pixels are too bright in all frames, 0 too dark")


@pytest.mark.parametrize(("spread", "black"), [(4.0, 0.0), (8.0, -16.0)])
def test_a_dark_pattern_that_black_cuts_off_has_no_defects_in_its_tail(spread, black):
    """Half of the pixels or more were at 0 in dark frames, which lowered the spread: some were defects."""
    offset = spread * np.random.default_rng(1).standard_normal(SHAPE)
    lit = [k % 4 == 0 for k in range(24)]
    images = [np.clip((70.0 if wall else black) + offset, 0, 255).astype(np.uint8) for wall in lit]
    assert defective_pixels(images, lit, SEEN).mismatches() == ()
    for image in images:
        image[20, 30] += 90
    (found,) = defective_pixels(images, lit, SEEN).mismatches()
    assert found.statement.startswith("1 single pixels are too bright in all frames, 0 too dark")


def test_one_hot_pixel_in_three_hundred_does_not_hide_them_all():
    """They were the tail of the offsets: with more than one in 740, none was found."""
    at = {(int(v), int(u)) for v, u in np.random.default_rng(9).integers(5, 115, (64, 2))}
    assert len(at) > 0.003 * SEEN.size
    (found,) = defective_pixels(*_frames(sorted(at))).mismatches()
    assert found.parameters[0].value > 0.9 * len(at) / SEEN.size


@pytest.mark.parametrize("azimuth_deg", [4, 20, 88, 120])
def test_a_thin_scratch_on_the_window_is_not_a_row_of_dead_pixels(azimuth_deg):
    """A scratch as narrow as a defect differs from the five pixels around it only at single places."""
    v, u = np.mgrid[0 : SHAPE[0], 0 : SHAPE[1]]
    along = np.radians(azimuth_deg)
    across = (u - 80) * np.sin(along) - (v - 60) * np.cos(along)
    images, lit, seen = _frames(dead=[(30, 20)])
    clear = 1 - 0.5 * np.exp(-0.5 * (across / 0.8) ** 2)
    images = [np.clip(16 + (i - 16.0) * clear, 0, 255).astype(np.uint8) for i in images]
    (found,) = defective_pixels(images, lit, seen).mismatches()
    assert found.statement.startswith("0 single pixels are too bright in all frames, 1 too dark")


def test_a_picture_is_mended_at_defective_pixels_and_nowhere_else():
    """Two bright pixels in a dark place were reported as a place of the image that is 50 % brighter."""
    images, lit, seen = _frames([(20, 30), (22, 33)], [(60, 70)])
    clean = _frames()[0][0].astype(np.float32)
    mended = defective_pixels(images, lit, seen).mended(images[0].astype(np.float32))
    changed = mended != images[0]
    assert set(zip(*np.nonzero(np.abs(images[0] - clean) > 20), strict=True)) <= set(
        zip(*np.nonzero(changed), strict=True)
    )
    assert changed.sum() <= 27
    corner = DefectivePixels(np.array([[0, 0], [119, 159]]), np.zeros((0, 2), int), seen).mended(clean)
    median = cv2.medianBlur(clean, 5)
    for part in (np.s_[:2, :2], np.s_[-2:, -2:]):
        np.testing.assert_array_equal(corner[part], median[part])
    assert (corner != clean).sum() <= 8
    assert np.abs(mended - clean)[[20, 22, 60], [30, 33, 70]].max() < 30


def test_a_picture_without_defects_is_not_copied():
    """Copies of 24 pictures of 12 megapixels took 1.2 GB."""
    image = np.full(SHAPE, 50, np.float32)
    assert DefectivePixels(np.zeros((0, 2), int), np.zeros((0, 2), int), SEEN).mended(image) is image
