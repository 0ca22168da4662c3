"""A drawn wall on which so many rings in a row show a defect, and what is found there."""

from dataclasses import replace

import numpy as np

from pipeline.adjustment.shared_light import NOTHING_HELD
from stages.defects import DefectParameters, find_defects
from tests.quiet import quiet_context
from tests.synthetic_wall import bare_recording, grey_texture, smooth_noise, wall_of

DISTANCE, RADIUS, SIGMA = np.arange(0, 60, 1.0), 38.0, 0.02
AZIMUTH = -np.pi + np.arange(360) * np.pi / 180


PLACE = slice(100, 112)


def found(
    rings,
    depth_mm=-1.0,
    photo=False,
    unsure=False,
    held=NOTHING_HELD,
    noise_mm=SIGMA,
    warned=None,
    displaced_mm=0.0,
):
    """Return the findings where so many rings (rows of the map) depart from the wall by ``depth_mm``."""
    random = np.random.default_rng(5)
    radius = RADIUS + smooth_noise(random, (len(DISTANCE), len(AZIMUTH)), noise_mm, 1.0)
    radius[30 : 30 + rings, PLACE] += depth_mm
    wall = wall_of(DISTANCE, AZIMUTH, radius, noise_mm)
    radius_map = replace(wall.radius_map, displaced_mm=np.full(len(DISTANCE), displaced_mm))
    wall = replace(wall, held=held, radius_map=radius_map)
    if unsure:
        sigma = wall.cloud.sigma_mm.reshape(radius.shape).copy()
        sigma[30 : 30 + rings, PLACE] *= 10
        wall = replace(wall, cloud=replace(wall.cloud, sigma_mm=sigma.ravel()))
    texture = grey_texture(wall)
    texture.bgra[..., :3] += random.integers(0, 8, (*radius.shape, 1), np.uint8)
    if photo:
        texture.bgra[30 : 30 + rings, PLACE, :3] = 60
    context = quiet_context() if warned is None else replace(quiet_context(), warn=warned.append)
    return find_defects(bare_recording(2 * RADIUS, None), wall, texture, DefectParameters(), context)
