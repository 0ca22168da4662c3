"""A small defect enlarges σ of its own cells, since its rings lie on no smooth wall: it is still found."""

import numpy as np
import pytest

from stages.defects import DefectParameters, find_defects
from tests.quiet import quiet_context
from tests.synthetic_wall import (
    DrawnDefect,
    bare_recording,
    grey_texture,
    relief,
    smooth_noise,
    wall_of,
)

DISTANCE, AZIMUTH, RADIUS = np.arange(0, 120, 0.5), -np.pi + np.arange(720) * np.pi / 360, 38.0
SHAPE = (len(DISTANCE), len(AZIMUTH))
SIGMA = 0.05


def found(relief_mm, noise_mm, sigma_mm):
    wall = wall_of(DISTANCE, AZIMUTH, RADIUS + noise_mm + relief_mm, sigma_mm)
    recording = bare_recording(2 * RADIUS, None)
    return find_defects(recording, wall, grey_texture(wall), DefectParameters(), quiet_context())


def within(about_mm, about_rad, radius_mm):
    around = (np.mod(AZIMUTH - about_rad + np.pi, 2 * np.pi) - np.pi) * RADIUS
    return np.hypot(DISTANCE[:, None] - about_mm, around[None]) < radius_mm


@pytest.mark.parametrize("seed", range(3))
def test_a_pit_does_not_hide_in_the_scatter_that_it_causes(seed):
    pit = DrawnDefect("pit", 60.0, 1.0, 4.0, 4.0, 0.5)
    dip = relief(pit, DISTANCE, AZIMUTH, RADIUS, np.random.default_rng(seed))
    noise = smooth_noise(np.random.default_rng(seed), SHAPE, SIGMA, 2.0)
    own = np.where(within(60.0, 1.0, 2.5), 3 * SIGMA, SIGMA)
    assert [d.kind for d in found(dip, noise, own).items] == ["pit"]


@pytest.mark.parametrize("seed", range(3))
def test_noise_behind_a_part_of_the_window_is_no_defect(seed):
    sigma = np.where(within(60.0, 1.0, 25.0), 3 * SIGMA, SIGMA)
    noise = smooth_noise(np.random.default_rng(seed), SHAPE, 1.0, 2.0) * sigma
    assert not found(0.0, noise, sigma).items


@pytest.mark.parametrize("seed", range(2))
def test_noise_behind_a_narrow_spot_of_the_window_is_no_defect(seed):
    """Bounded by σ of the wall beside it, a stripe 8 mm wide held several defects at 98 %."""
    sigma = np.where(np.abs(AZIMUTH - 1.0) * RADIUS < 4, 3 * SIGMA, SIGMA) * np.ones(SHAPE)
    noise = smooth_noise(np.random.default_rng(seed), SHAPE, 1.0, 2.0) * sigma
    assert not found(0.0, noise, sigma).items
