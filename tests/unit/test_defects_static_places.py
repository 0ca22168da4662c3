"""A finding where something stays in the picture while the wall moves is not counted."""

from types import SimpleNamespace

import numpy as np
import pytest

from pipeline.artefacts.cloud_along import cloud_along
from pipeline.artefacts.measured import RingSamples, RingValidity
from pipeline.recording.base import Illumination
from stages.defects.parameters import DefectParameters
from stages.defects.relief import smooth_shape_removed
from stages.defects.segment import Region
from stages.defects.static_places import StaticPlaces
from stages.defects.surface import MeasuredWall
from tests.synthetic_wall import wall_of

DISTANCE, AZIMUTH = np.arange(0, 60, 1.0), -np.pi + np.arange(360) * np.pi / 180
SHAPE = (len(DISTANCE), len(AZIMUTH))
ROWS, COLUMNS = slice(30, 36), slice(100, 112)
SIZE, CENTRE, LINE_PX = (400, 400), 200.0, 100.0
# The middle of the finding's columns, in the picture: columns are degrees from −180 on.
MIDDLE = np.deg2rad(106.0 - 180.0)
LIT, LASER, BOTH = (i.value for i in (Illumination.LED, Illumination.LASER, Illumination.BOTH))


def pit():
    """Return a pit on six rings (region, surface), and the rings of its line."""
    radius = np.full(SHAPE, 38.0)
    radius[ROWS, COLUMNS] += 1.0
    wall = wall_of(DISTANCE, AZIMUTH, radius, 0.02)
    relief = smooth_shape_removed(wall.radius_map, DefectParameters())
    region = Region(ROWS.start, COLUMNS.start, np.ones((6, 12), bool), 1.0)
    surface, here = MeasuredWall(relief, cloud_along(wall.cloud), 1.0).surface_about(region, every_point=True)
    line = np.full(SHAPE, LINE_PX, np.float32)
    validity = np.full(SHAPE, RingValidity.VALID, np.uint8)
    rings = RingSamples(np.arange(60), AZIMUTH, np.full(2, CENTRE), line, line, line, line, validity)
    return here, surface, rings


def recording(away_px, lights=(LIT, LASER)):
    """Return a recording in which a spot of 16 px stays, so far outward from the line at the finding."""
    stays = np.zeros(SIZE[::-1], bool)
    at = CENTRE + (LINE_PX + away_px) * np.array([np.cos(MIDDLE), np.sin(MIDDLE)])
    v, u = np.mgrid[: SIZE[1], : SIZE[0]]
    stays[np.hypot(u - at[0], v - at[1]) < 16] = True
    frames, source = SimpleNamespace(illumination=np.array(lights)), SimpleNamespace(image_size=SIZE)
    return SimpleNamespace(stays=stays, frames=frames, source=source)


@pytest.mark.parametrize(("away_px", "explained"), [(0, True), (18, True), (60, False)])
def test_a_finding_is_explained_by_what_stays_on_the_line_or_at_its_rim(away_px, explained):
    """The edge of a burnt-in bar was a pit of 3.7 ± 0.7 mm with a probability of .98."""
    here, surface, rings = pit()
    assert StaticPlaces.of(recording(away_px), rings).explain(here, 1.0, surface) is explained


def test_no_sample_that_shows_the_finding_explains_nothing():
    here, surface, rings = pit()
    assert not StaticPlaces.of(recording(0), rings).explain(here, -1.0, surface)


def test_the_line_itself_stays_where_the_laser_is_on_in_lit_pictures():
    _, _, rings = pit()
    assert StaticPlaces.of(recording(0, (BOTH, BOTH)), rings) is None
