"""The roughness of a region's surface beyond the noise at its place."""

from __future__ import annotations

import numpy as np
import pytest

from stages.defects.depth import Depth
from stages.defects.describe import features_of
from stages.defects.relief import Relief, Typical
from stages.defects.segment import Region
from tests.synthetic_wall import smooth_noise

CELL_MM, ROWS, COLUMNS, RADIUS_MM = 0.5, 80, 720, 57.3
REGION = Region(20, 100, np.ones((40, 40), bool), 1.0)
DEPTH = Depth(1.0, 0.05, 0.0, (20, 20))


def relief(surface_mm: np.ndarray, noise_mm: np.ndarray) -> Relief:
    azimuth = np.linspace(-np.pi, np.pi, COLUMNS, endpoint=False)
    distance, harmonics, typical = CELL_MM * np.arange(ROWS), np.zeros((ROWS, 5)), Typical(0.04, 0.04)
    return Relief(
        distance, azimuth, RADIUS_MM, surface_mm, surface_mm, noise_mm, noise_mm, (), harmonics, typical
    )


@pytest.mark.parametrize("rough_mm", [0.0, 0.3])
def test_the_noise_at_a_place_is_not_counted_as_its_roughness(rough_mm: float) -> None:
    """The noise is four times as large in the region as elsewhere, and must be estimated in the region."""
    random = np.random.default_rng(4)
    noise_mm = np.full((ROWS, COLUMNS), 0.04)
    noise_mm[20:60, 100:140] = 0.16
    surface = noise_mm * random.standard_normal(noise_mm.shape)
    surface += smooth_noise(random, noise_mm.shape, rough_mm, 4.0)
    found = features_of(relief(surface, noise_mm), REGION, DEPTH)
    if not rough_mm:
        assert found.roughness < 2 * found.roughness_sigma
    else:
        assert found.roughness > 4 * found.roughness_sigma
    believed = features_of(relief(surface, noise_mm / 4), REGION, DEPTH)
    assert found.roughness_sigma == pytest.approx(4 * believed.roughness_sigma)
