"""Grey levels beside the line and of the darkest places, from which the line's profiles are measured."""

import numpy as np
import pytest

from stages.diagnose.profile.measure import mean_beside, tile_means
from stages.rings.sectors import cut_sectors


def test_the_light_beside_the_line_is_the_mean_over_the_pixels_at_that_distance() -> None:
    random = np.random.default_rng(2)
    image = random.integers(0, 255, (240, 320)).astype(np.uint8)
    sectors = cut_sectors((320, 240), np.array([158.3, 121.8]), 360)
    line = 60 + 5 * np.sin(2 * sectors.azimuth_rad)
    near = sectors.pixels_near(line, 10.0, 30.0)
    told = mean_beside(
        image.ravel(), sectors.start, sectors.pixel, sectors.radius_px, line.astype(np.float32), 10.0, 30.0
    )
    assert told == pytest.approx(image.ravel()[near].mean(), rel=1e-12)


def test_tiles_are_means_of_whole_squares_also_where_the_picture_is_no_multiple_of_them() -> None:
    image = np.random.default_rng(3).integers(0, 255, (70, 100)).astype(np.uint8)
    tiles = tile_means(image)
    assert tiles.shape == (2, 3)
    assert tiles[1, 2] == pytest.approx(image[32:64, 64:96].mean(), rel=1e-12)
