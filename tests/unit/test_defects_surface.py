"""The surface that depths are read from follows the rings, and is not made up between them."""

from dataclasses import replace

import numpy as np

from pipeline.artefacts.cloud_along import cloud_along
from stages.defects import DefectParameters
from stages.defects.relief import smooth_shape_removed
from stages.defects.surface import MeasuredWall
from tests.synthetic_wall import smooth_noise, wall_of

RADIUS, SIGMA, AZIMUTH = 38.0, 0.04, -np.pi + np.arange(720) * np.pi / 360


def test_between_two_oblique_rings_the_surface_is_no_farther_from_the_wall_than_the_rings() -> None:
    """In an elbow it was 1.4 mm off, where all samples were within .15, and so was the noise of depths."""
    at = np.arange(0.0, 60.0, 2.4)
    noise = smooth_noise(np.random.default_rng(2), (len(at), len(AZIMUTH)), SIGMA, 2.0)
    rings = wall_of(at, AZIMUTH, RADIUS + noise, SIGMA).cloud
    oblique = rings.distance_mm + 4 * np.cos(6 * rings.azimuth_rad).astype(np.float32)
    s = np.arange(0.0, 60.0, 0.5)
    wall = wall_of(s, AZIMUTH, RADIUS + smooth_noise(np.random.default_rng(3), (120, 720), SIGMA, 2.0), SIGMA)
    relief = smooth_shape_removed(wall.radius_map, DefectParameters.model_validate({}))
    measured = MeasuredWall(relief, cloud_along(replace(rings, distance_mm=oblique)), 1.4)
    rows = slice(30, 90)
    shown = measured.surface(rows, np.ones((60, len(AZIMUTH)), bool)).local_mm
    assert np.abs(shown).max() < 1.2 * np.abs(noise).max()
