"""Frames rendered again: the compared part of frames in which both lights are on."""

from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
from scipy.ndimage import map_coordinates

from pipeline.recording.base import Illumination
from stages.twin.lamp_light import Course, Figure, LampLight
from stages.twin.noise import CameraNoise
from stages.twin.reflectance import Reflectance
from stages.twin.render import Region, Renderer, TwinFrame
from stages.twin.scene import LitSight
from stages.twin.state import PhotometricState

SHAPE = (40, 60)
ONES = np.ones(SHAPE, np.float32)
NOISE = CameraNoise(
    Figure(16.0, 0.1), np.inf, Figure(2.0, 0.1), Figure(0.02, 0.01), Figure(0, 0), Figure(1, 1)
)
NOWHERE = np.zeros(SHAPE, bool)
LAMP = LampLight(
    1.0, np.array([0.0, 2.0]), np.zeros(2), np.zeros(2), np.zeros(4), np.zeros(4),
    Course(np.array([0]), np.zeros(1), np.zeros(1)),
)  # fmt: skip
STATE = PhotometricState(NOISE, LAMP, None, np.array([0.5, 1.5]), np.zeros(2), np.zeros(2), NOWHERE, NOWHERE)
LINE = SimpleNamespace(row=np.full(60, 20), column=np.arange(60))
SCENE = SimpleNamespace(
    polar=(ONES, ONES, ~NOWHERE), pose=lambda frame: np.eye(4), line=lambda T_pc: LINE,
    lit=lambda T_pc: LitSight(100 * ONES, ONES, ONES, ONES),
)  # fmt: skip


def test_in_frames_with_both_lights_a_line_of_unknown_place_is_excluded():
    for light, left_out in ((Illumination.BOTH, 60), (Illumination.LED, 0)):
        twin = Renderer(SCENE, STATE).frame(0, light)
        assert (twin.region == Region.UNSEEN).sum() == left_out
        assert (twin.level[:20] == 100).all()
    assert STATE.shows_wall == (Illumination.LED, Illumination.BOTH)
    assert replace(STATE, line=SimpleNamespace()).shows_wall == (Illumination.LED,)


def test_a_response_acts_on_the_contrast_of_the_wall():
    grey = np.where(np.arange(60) < 30, np.float32(50), np.float32(100)) * ONES
    sight = LitSight(grey, ONES, ONES, ONES)
    scene = SimpleNamespace(**vars(SCENE) | {"lit": lambda T_pc: sight})
    twin = Renderer(scene, replace(STATE, power=0.5)).frame(0, Illumination.LED)
    np.testing.assert_allclose(twin.level[:, 30:].mean() / twin.level[:, :30].mean(), np.sqrt(2), rtol=0.01)


def test_pixels_between_nodes_get_the_photo_at_their_place_and_level():
    random, step = np.random.default_rng(3), 4
    levels = random.uniform(20, 200, (2, 50, 90)).astype(np.float32)
    photo = Reflectance(levels, np.array([0.4, 0.9]), levels[:1], 100.0, 0.5, -np.pi, 2 * np.pi / 90)
    nodes = random.uniform([[[101]], [[-0.3]], [[0.5]]], [[[123]], [[0.3]], [[1]]], (3, 10, 15))
    nodes = nodes.astype(np.float32)
    nodes[:, 4, 7] = np.nan
    phi = random.uniform(-np.pi, np.pi, (40, 60)).astype(np.float32)
    theta = random.uniform(0.3, 1.0, phi.shape).astype(np.float32)
    distance, turn, light = (cv2.resize(n, None, fx=step, fy=step) for n in nodes)
    at = (distance - 100.0) / 0.5, (phi + turn + np.pi) / (2 * np.pi / 90)
    near, far = (map_coordinates(a, np.nan_to_num(at), order=1, mode="grid-wrap") for a in levels)
    share = np.clip((theta - 0.4) / 0.5, 0, 1)
    grey = np.where(np.isfinite(distance), near + share * (far - near), np.nan)
    seen = photo.seen(nodes, step, phi, photo.level_of(theta))
    assert np.isnan(seen[0]).any()
    for got, expected in zip(seen[1:], (light, distance, phi + turn), strict=True):
        np.testing.assert_allclose(got, expected, atol=1e-5)
    # Rows are known to 1e-5 in single precision, and neighbours differ by up to 180 grey levels.
    np.testing.assert_allclose(seen[0], grey, atol=0.01)


def test_displaced_wall_seen_through_a_drop_has_the_noise_of_that_wall():
    """Bright wall seen at the place of dark wall kept its noise: with more light, a negative variance."""
    noise = CameraNoise(
        Figure(16.0, 0.1), np.inf, Figure(0.2, 0.1), Figure(0.05, 0.01), Figure(0.0, 0.01), Figure(1.0, 0.1)
    )
    level = np.full((60, 80), 2.0, np.float32)
    level[:, 40:] = 200.0
    unknown, wall = np.full(level.shape, np.nan, np.float32), np.full(level.shape, Region.WALL, np.uint8)
    twin = TwinFrame(level, noise.variance(level), wall, unknown, unknown)
    aside = np.zeros((2, *level.shape), np.float32)
    aside[0] = -6.0
    bent = twin.drawn_aside(aside).brighter(1.4, noise)
    assert bent.level[30, 36] > 250
    np.testing.assert_allclose(bent.variance, noise.variance(bent.level), rtol=1e-3)
