"""The pictures of the flat view: tiles are where their cells are, at every level."""

import cv2
import numpy as np
import pytest

from pipeline.artefacts.measured import WallTexture
from pipeline.errors import InputError
from pipeline.review.flat_tiles import TILE_PX, FlatPicture, photo_picture


def picture(stored):
    return FlatPicture(stored, lambda part: np.dstack([part, part, part, 0 * part + 255]), 0.0, 100.0, -np.pi)


def decoded(tile):
    return cv2.imdecode(np.frombuffer(tile, np.uint8), cv2.IMREAD_UNCHANGED)


def test_distance_increases_to_the_right_in_a_tile():
    stored = np.random.default_rng(0).integers(0, 255, (700, 600), np.uint8)
    tile = decoded(picture(stored).tile(0, 1, 1))
    assert tile.shape[:2] == (600 - TILE_PX, 700 - TILE_PX)
    assert np.array_equal(tile[..., 0], stored[TILE_PX:, TILE_PX:].T)


@pytest.mark.parametrize("level", [1, 2, 3, 4])
def test_shrunk_tiles_keep_place_and_brightness(level):
    s, a = np.meshgrid(np.arange(9000), np.arange(700), indexing="ij")
    stored = ((s / 9000 + a / 700) * 120).astype(np.uint8)
    shrunk = decoded(picture(stored).tile(level, 0, 0))[..., 0].astype(float)
    size = 1 << level
    rows, columns = shrunk.shape
    exact = stored[: columns * size, : rows * size].reshape(columns, size, rows, size).mean((1, 3)).T
    assert np.abs(shrunk - exact).max() < 2.5


def test_the_last_level_is_one_tile_and_there_are_no_others():
    made = picture(np.zeros((5000, 300), np.uint8))
    last = made.levels - 1
    assert max(decoded(made.tile(last, 0, 0)).shape[:2]) <= TILE_PX
    for wrong in ((last + 1, 0, 0), (last, 1, 0), (0, -1, 0), (0, 0, 1), (-1, 0, 0)):
        with pytest.raises(InputError, match="no tile"):
            made.tile(*wrong)


def test_the_photo_extends_half_a_texel_beyond_its_centres():
    made = photo_picture(WallTexture(np.zeros((10, 20, 4), np.uint8), 5.0, 0.5, -np.pi, 2 * np.pi / 20))
    assert (made.distance_from_mm, made.distance_to_mm) == (4.75, 9.75)
    assert made.azimuth_from_rad == pytest.approx(-np.pi - np.pi / 20)
