"""A finding needs two rings, or one and the photo; what one ring alone shows is set apart."""

from dataclasses import fields, replace

import numpy as np
import pytest

from pipeline.artefacts.measured import RingSamples, RingValidity
from stages.defects import DefectParameters, find_defects
from stages.defects.corroborate import Evidence
from stages.defects.credibility import Clutter, clutter_of, credibility_of
from tests.quiet import quiet_context
from tests.synthetic_wall import bare_recording, grey_texture, smooth_noise, wall_of

DISTANCE, RADIUS, SIGMA = np.arange(0, 60, 1.0), 38.0, 0.02
AZIMUTH = -np.pi + np.arange(360) * np.pi / 180
PLACE = slice(100, 112)


def found(rings, depth_mm=-1.0, photo=False, unsure=False):
    """Return what is found where so many rings (rows of the map) stand off the wall by ``depth_mm``."""
    random = np.random.default_rng(5)
    radius = RADIUS + smooth_noise(random, (len(DISTANCE), len(AZIMUTH)), SIGMA, 1.0)
    radius[30 : 30 + rings, PLACE] += depth_mm
    wall = wall_of(DISTANCE, AZIMUTH, radius, SIGMA)
    if unsure:
        sigma = wall.cloud.sigma_mm.reshape(radius.shape).copy()
        sigma[30 : 30 + rings, PLACE] *= 10
        wall = replace(wall, cloud=replace(wall.cloud, sigma_mm=sigma.ravel()))
    texture = grey_texture(wall)
    texture.bgra[..., :3] += random.integers(0, 8, (*radius.shape, 1), np.uint8)
    if photo:
        texture.bgra[30 : 30 + rings, PLACE, :3] = 60
    return find_defects(bare_recording(2 * RADIUS, None), wall, texture, DefectParameters(), quiet_context())


@pytest.mark.parametrize("depth_mm", [-1.0, 1.0])
def test_one_ring_is_unconfirmed_and_two_are_a_finding(depth_mm):
    alone, twice = found(1, depth_mm), found(2, depth_mm)
    assert (len(alone.items), len(alone.unconfirmed)) == (0, 1)
    assert (len(twice.items), len(twice.unconfirmed)) == (1, 0)
    assert twice.items[0].id == alone.unconfirmed[0].id == 1


def test_one_ring_and_the_photo_are_a_finding():
    assert len(found(1, photo=True).items) == 1


def test_rings_that_are_not_sure_of_themselves_do_not_speak_for_a_finding():
    told = found(2, unsure=True)
    assert (len(told.items), len(told.unconfirmed)) == (0, 1)


def found_beside_hidden_wall(top, hidden, depth_mm=-1.0, width=8):
    """Return what is found where 20 rings show a ridge, highest at column ``top``, and others are hidden."""
    random = np.random.default_rng(6)
    radius = RADIUS + smooth_noise(random, (len(DISTANCE), len(AZIMUTH)), SIGMA, 1.0)
    column = np.arange(len(AZIMUTH))
    radius[20:40] += depth_mm * np.maximum(1 - np.abs(column - top) / width, 0.0)
    radius[:, hidden] = np.nan
    wall = wall_of(DISTANCE, AZIMUTH, radius, SIGMA)
    seen = np.isfinite(wall.cloud.radius_mm)
    cloud = replace(wall.cloud, **{f.name: getattr(wall.cloud, f.name)[seen] for f in fields(wall.cloud)})
    recording, wall = bare_recording(2 * RADIUS, None), replace(wall, cloud=cloud)
    return find_defects(recording, wall, grey_texture(wall), DefectParameters(), quiet_context())


def test_what_is_deepest_where_the_line_ends_is_unconfirmed():
    ends = found_beside_hidden_wall(100, slice(101, 140))
    assert (len(ends.items), len(ends.unconfirmed)) == (0, 1)
    assert "ceases to be seen" in ends.unconfirmed[0].statement
    assert ends.unconfirmed[0].probability <= 0.5


@pytest.mark.parametrize(
    "hidden", [slice(105, 140), slice(100, 102)], ids=["past its top", "of a part of it, by its own flank"]
)
def test_a_ridge_whose_top_is_seen_stays_a_finding_beside_hidden_wall(hidden):
    told = found_beside_hidden_wall(100, hidden)
    assert (len(told.items), len(told.unconfirmed)) == (1, 0)


def rings_with(validity):
    """Return rings of which only the validity (F, A) matters."""
    radius = np.full(validity.shape, 100.0, np.float32)
    azimuth = np.linspace(-np.pi, np.pi, validity.shape[1], endpoint=False)
    frame = np.arange(len(validity))
    return RingSamples(frame, azimuth, (0.0, 0.0), radius, radius, radius, radius, validity)


def test_clutter_meets_in_neighbouring_rings_as_often_as_what_is_drawn_at_random():
    random, width = np.random.default_rng(1), 9
    drawn = random.random((400, 720)) < 0.01
    odd = np.zeros_like(drawn)
    for k in range(width):
        odd |= np.roll(drawn, k, 1)
    validity = np.where(odd, RingValidity.GLINT, RingValidity.VALID).astype(np.uint8)
    clutter = clutter_of(rings_with(validity), 720.0)
    two = odd[1:] & odd[:-1]
    assert clutter.meetings(2) == pytest.approx((two & ~np.roll(two, 1, 1)).sum(), rel=0.25)
    narrow = np.where(drawn, RingValidity.GLINT, RingValidity.VALID).astype(np.uint8)
    assert clutter_of(rings_with(narrow), 720.0).meetings(2) == 0.0


def evidence(rings, above_noise=8.0):
    return Evidence(rings, False, above_noise)


def test_two_rings_in_much_clutter_are_rather_false_and_many_rings_stay_sure():
    told = found(2).items[0]
    several = [evidence(2)] * 4 + [evidence(8)] * 4
    frames = np.arange(50)
    quiet = credibility_of(several, Clutter(), frames)
    hard = credibility_of(several, Clutter(300.0, 0.1), frames)
    assert quiet.probability(evidence(2), told, 0.2) > 0.6 > 0.2 > hard.probability(evidence(2), told, 0.2)
    assert hard.probability(evidence(8), told, 0.2) > 0.95


def test_one_ring_is_not_deeper_than_its_neighbours_allow():
    alone = found(1, 9.0).unconfirmed[0]
    assert abs(alone.depth_mm) < 2.0
    assert found(3, 0.9).items[0].depth_mm == pytest.approx(0.9, abs=0.1)
