"""Burnt-in text is left out of the comparison; wall, line and hot pixels are not taken for it."""

from types import SimpleNamespace

import numpy as np
import pytest

from pipeline.recording.base import Illumination
from stages.twin.burnt_in import burnt_in

SHAPE, LINE = (120, 160), (np.repeat(np.arange(58, 63), 160), np.tile(np.arange(160), 5))
SCENE = SimpleNamespace(
    pose=lambda frame: None, line=lambda T_pc: SimpleNamespace(row=LINE[0], column=LINE[1])
)


def _frames(drawn, lights=(Illumination.LED, Illumination.LASER)):
    """Eight frames of textured wall or of a line across it, with the same letters ``drawn`` into each."""
    random, made = np.random.default_rng(3), []
    for frame in range(8):
        light = lights[frame % len(lights)]
        image = 16 + random.normal(0, 1, SHAPE)
        image += random.uniform(60, 160, SHAPE) * (light != Illumination.LASER)
        image[LINE] += 120 * (light != Illumination.LED)
        drawn(image, light, frame)
        made.append(SimpleNamespace(frame=frame, light=light, image=image.astype(np.float32)))
    return made


def _text(image, light, frame):
    image[20:26, 30:60] = 240


def test_text_is_found():
    """Letters were thirteen glints or drops, and a logo a second line brighter than the first."""
    found = burnt_in(SCENE, _frames(_text), 16.0)
    assert found[20:26, 30:60].all()
    assert not found[:10].any()
    assert not found[40:].any()


def _hot(image, light, frame):
    image[40, 50] = 250


def _glint(image, light, frame):
    image[20:30, 30:40] = 250 if light == Illumination.LED else 16


def _drop(image, light, frame):
    bright = 120 if light == Illumination.LASER else 80 + 6 * frame
    image[20:35, 30:45] = 16 + bright


@pytest.mark.parametrize("drawn", [_hot, _glint, _drop])
def test_hot_pixels_glints_of_lamps_and_drops_are_not_text(drawn):
    """Where a drop showed line and wall alike in their brightest frames, it was taken for text."""
    assert not burnt_in(SCENE, _frames(drawn), 16.0).any()


@pytest.mark.parametrize("light", [Illumination.LED, Illumination.BOTH])
def test_without_frames_of_each_light_nothing_can_be_told(light):
    assert not burnt_in(SCENE, _frames(_text, (light,)), 16.0).any()
