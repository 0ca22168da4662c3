"""Whether the line is brighter at a finding than elsewhere in its ring."""

import numpy as np
import pytest

from pipeline.artefacts.cloud_along import cloud_along
from pipeline.artefacts.measured import RingSamples, RingValidity
from stages.defects.corroborate import line_is_bright
from stages.defects.parameters import DefectParameters
from stages.defects.relief import smooth_shape_removed
from stages.defects.segment import Region
from stages.defects.surface import MeasuredWall
from tests.synthetic_wall import wall_of

DISTANCE, RADIUS = np.arange(0, 60, 1.0), 38.0
AZIMUTH = -np.pi + np.arange(360) * np.pi / 180
ROWS, COLUMNS = slice(30, 33), slice(100, 112)


@pytest.mark.parametrize(("depth_mm", "expected"), [(-1.0, True), (1.0, False)])
def test_only_what_lies_to_the_finding_s_side_is_asked(depth_mm, expected):
    """Where the ring lay on the other side all along, the median of nothing was taken."""
    radius = np.full((len(DISTANCE), len(AZIMUTH)), RADIUS)
    radius[ROWS, COLUMNS] -= 1.0
    wall = wall_of(DISTANCE, AZIMUTH, radius, 0.02)
    relief, cloud = smooth_shape_removed(wall.radius_map, DefectParameters()), cloud_along(wall.cloud)
    mask = np.ones((3, 12), bool)
    region = Region(ROWS.start, COLUMNS.start, mask, np.sign(depth_mm), False)
    surface, here = MeasuredWall(relief, cloud, 1.0).surface_about(region, every_point=True)
    plain = np.full(radius.shape, 100.0, np.float32)
    valid = np.full(radius.shape, RingValidity.VALID, np.uint8)
    amplitude = np.where(radius < RADIUS, 200, 80).astype(np.float32)
    rings = RingSamples(
        np.arange(len(DISTANCE)), AZIMUTH, (0.0, 0.0), plain, plain, plain, amplitude, valid
    )  # fmt: skip
    assert line_is_bright(here, depth_mm, surface, rings) == expected
