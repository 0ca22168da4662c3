"""The test whether the line is brighter at a finding than elsewhere in its ring."""

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
SHAPE = (len(DISTANCE), len(AZIMUTH))
ROWS, COLUMNS = slice(30, 33), slice(100, 112)


def bright(radius, amplitude, rows, depth_mm):
    """Return whether the line (S, A) counts as bright at a finding on such rows of a wall (S, A)."""
    wall = wall_of(DISTANCE, AZIMUTH, radius, 0.02)
    relief, cloud = smooth_shape_removed(wall.radius_map, DefectParameters()), cloud_along(wall.cloud)
    mask = np.ones((rows.stop - rows.start, 12), bool)
    region = Region(rows.start, COLUMNS.start, mask, np.sign(depth_mm), False)
    surface, here = MeasuredWall(relief, cloud, 1.0).surface_about(region, every_point=True)
    plain = np.full(radius.shape, 100.0, np.float32)
    valid = np.full(radius.shape, RingValidity.VALID, np.uint8)
    rings = RingSamples(
        np.arange(len(DISTANCE)),
        AZIMUTH,
        (0.0, 0.0),
        plain,
        plain,
        plain,
        amplitude.astype(np.float32),
        valid,
    )
    return line_is_bright(here, depth_mm, surface, rings)


@pytest.mark.parametrize(("depth_mm", "expected"), [(-1.0, True), (1.0, False)])
def test_only_the_side_of_the_finding_is_compared(depth_mm, expected):
    """Where the whole ring lay on the other side, the median of nothing was taken."""
    radius = np.full((len(DISTANCE), len(AZIMUTH)), RADIUS)
    radius[ROWS, COLUMNS] -= 1.0
    assert bright(radius, np.where(radius < RADIUS, 200, 80), ROWS, depth_mm) == expected


@pytest.mark.parametrize(("glints", "expected"), [(1, False), (3, False), (5, True), (8, True)])
def test_a_glint_on_some_rings_of_a_defect_does_not_make_it_a_glint(glints, expected):
    """A dent of 1.3 mm on eight rings was doubted, since the line was bright on the one with a glint."""
    rows = slice(30, 38)
    radius, amplitude = np.full((len(DISTANCE), len(AZIMUTH)), RADIUS), np.full(SHAPE, 100.0)
    amplitude[rows, COLUMNS] = 90
    radius[rows, COLUMNS] -= 0.6
    radius[30 : 30 + glints, 104:108] -= 1.2
    amplitude[30 : 30 + glints, 104:108] = 200
    assert bright(radius, amplitude, rows, -1.8) == expected


def test_a_glint_that_a_codec_repeats_in_later_rings_is_judged_where_it_is_deepest():
    """Of five rings with the glint three showed it faintly: a false pit of 1.1 mm at .98."""
    rows = slice(30, 35)
    radius, amplitude = np.full(SHAPE, RADIUS), np.full(SHAPE, 100.0)
    radius[rows, COLUMNS] -= 0.6
    radius[30:32, COLUMNS] -= 0.6
    amplitude[30:32, COLUMNS] = 200
    amplitude[32:35, COLUMNS] = 90
    assert bright(radius, amplitude, rows, -1.2)
