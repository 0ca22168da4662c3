"""A finding needs two rings, or one and the photo; what one ring alone shows is set apart."""

from dataclasses import replace

import numpy as np
import pytest

from stages.defects import DefectParameters, find_defects
from stages.defects.corroborate import chance_meetings
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


def test_chance_meetings_are_those_of_places_drawn_at_random():
    random = np.random.default_rng(1)
    single = found(1).unconfirmed[0]
    count, width, rings, around, runs = 40, 4.0, 100, 300.0, 400
    drawn = [replace(single, width_mm=width)] * count
    met = 0
    for _ in range(runs):
        ring, place = random.integers(0, rings, count), random.uniform(0, around, count)
        sign = random.integers(0, 2, count)
        near = np.abs(ring[:, None] - ring) == 1
        apart = np.abs(place[:, None] - place)
        near &= (np.minimum(apart, around - apart) < width) & (sign[:, None] == sign)
        met += int(np.triu(near).sum())
    assert chance_meetings(drawn, (float(rings), around), 1.0) == pytest.approx(met / runs, rel=0.15)
    assert chance_meetings(drawn[:1], (100.0, 300.0), 1.0) == 0.0
