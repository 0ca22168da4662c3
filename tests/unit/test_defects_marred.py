"""Rings that show a finding only at the rim of a rejected glint are no evidence for it."""

import numpy as np
import pytest

from pipeline.artefacts.cloud_along import cloud_along
from pipeline.artefacts.measured import RingSamples, RingValidity
from stages.defects.corroborate import Witnesses, evidence_for
from stages.defects.depth import Depth
from stages.defects.marred import without_glints
from stages.defects.parameters import DefectParameters
from stages.defects.relief import smooth_shape_removed
from stages.defects.segment import Region
from stages.defects.surface import MeasuredWall, chosen
from tests.synthetic_wall import grey_texture, wall_of

DISTANCE, RADIUS, TURN = np.arange(0, 60, 1.0), 38.0, 7
AZIMUTH = -np.pi + np.arange(360) * np.pi / 180
SHAPE = (len(DISTANCE), len(AZIMUTH))
ROWS, COLUMNS = slice(30, 33), slice(100, 112)
FRAMES = np.array([30, 31, 32])


def scene(glints, lost=0, reason=RingValidity.GLINT):
    """Return a pit on three rings (region, surface, rings, wall), of which some have rejected samples.

    ``glints`` maps frames to columns of the map, from which those of the image differ by a roll of TURN; they
    are rejected for a ``reason``.
    So many further samples of every ring have no point, ``lost``.
    """
    radius = np.full(SHAPE, RADIUS)
    radius[ROWS, COLUMNS] += 1.0
    wall = wall_of(DISTANCE, AZIMUTH, radius, 0.02)
    validity = np.full(SHAPE, RingValidity.VALID, np.uint8)
    for frame, columns in glints.items():
        validity[frame, columns] = reason
    has_point = validity == RingValidity.VALID
    has_point[:, 200 : 200 + lost] = False
    relief = smooth_shape_removed(wall.radius_map, DefectParameters())
    cloud = _by_ring(chosen(wall.cloud, has_point.ravel()))
    region = Region(ROWS.start, COLUMNS.start, np.ones((3, 12), bool), 1.0)
    surface, here = MeasuredWall(relief, cloud_along(cloud), 1.0).surface_about(region, every_point=True)
    plain = np.full(SHAPE, 100.0, np.float32)
    image = np.roll(validity, TURN, axis=1)
    rings = RingSamples(np.arange(60), AZIMUTH, np.zeros(2), plain, plain, plain, plain, image)
    return here, surface, rings, wall


def _by_ring(cloud):
    """Return points in the order of their ring's samples, which start TURN columns earlier in the map."""
    column = np.rint(np.degrees(cloud.azimuth_rad + np.pi)).astype(int)
    order = np.lexsort(((column + TURN) % 360, cloud.frame))
    return chosen(cloud, order)


@pytest.mark.parametrize(
    ("columns", "clear"),
    [(slice(102, 110), False), (slice(100, 103), False), (slice(100, 102), True), (slice(113, 140), True)],
)
def test_a_ring_with_a_fifth_of_its_samples_rejected_as_a_glint_shows_no_defect(columns, clear):
    here, surface, rings, _ = scene({31: columns})
    assert list(without_glints(FRAMES, here, surface, rings)) == ([30, 31, 32] if clear else [30, 32])


@pytest.mark.parametrize("reason", list(RingValidity)[1:])
def test_all_light_beside_the_line_counts_as_a_glint_but_a_missing_or_clipped_line_does_not(reason):
    """Two glints of which parts were rejected as ghost and by width were a deposit of 1.18 mm at p .91."""
    here, surface, rings, _ = scene({31: slice(102, 110)}, reason=reason)
    beside = reason.name in {"GLINT", "GHOST", "OUTLIER", "WIDTH"}
    assert list(without_glints(FRAMES, here, surface, rings)) == ([30, 32] if beside else [30, 31, 32])


@pytest.mark.parametrize(("rings_with_it", "clear"), [(20, False), (40, True)])
def test_a_second_line_that_stays_in_the_picture_hides_no_defect(rings_with_it, clear):
    """Of the three rings that show a pit, none counted where the second line lay over a quarter of it."""
    ghost = {frame: slice(108, 112) for frame in range(20, 20 + rings_with_it)}
    here, surface, rings, _ = scene(ghost, reason=RingValidity.GHOST)
    assert list(without_glints(FRAMES, here, surface, rings)) == (list(FRAMES) if clear else [])


def test_samples_without_a_point_do_not_hide_a_glint():
    here, surface, rings, _ = scene({31: slice(102, 110)}, lost=1)
    assert list(without_glints(FRAMES, here, surface, rings)) == [30, 32]


def test_without_rings_all_frames_count():
    here, surface, _, _ = scene({31: slice(102, 110)})
    assert list(without_glints(FRAMES, here, surface, None)) == [30, 31, 32]


@pytest.mark.parametrize(("glints", "rings"), [({}, 3), ({30: slice(101, 109), 31: slice(102, 110)}, 1)])
def test_glints_of_chance_on_two_rings_do_not_confirm_a_finding(glints, rings):
    """Two large glints in two neighbouring rings were a gouge of 3.57 ± 0.30 mm with a probability of .98."""
    here, surface, samples, wall = scene(glints)
    depth = Depth(1.0, 0.1, 0.0, (1, 6))
    witnesses = Witnesses(grey_texture(wall), samples)
    told = evidence_for(here, depth, surface, witnesses, np.zeros((3, 12)), 20.0)
    assert told.rings == rings


def test_that_rings_with_other_light_do_not_count_is_told():
    """A second line over a quarter of a pit left none of its three rings, which "no second ring" showed."""
    here, surface, samples, wall = scene(
        {k: slice(100, 103) for k in (30, 31, 32)}, reason=RingValidity.GHOST
    )
    witnesses = Witnesses(grey_texture(wall), samples)
    told = evidence_for(here, Depth(1.0, 0.1, 0.0, (1, 6)), surface, witnesses, np.zeros((3, 12)), 20.0)
    assert told.rings == 0
    assert "a second line or a splash was rejected beside it" in told.doubt
