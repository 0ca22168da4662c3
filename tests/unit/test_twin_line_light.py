"""The light of the laser's line, estimated from the pixels along it, on synthetic lines."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from stages.twin.line_colour import line_colour
from stages.twin.line_light import LineSamples
from stages.twin.reflectance import LUMA_BGR
from stages.twin.scene import LineSight


def _sight(random, grey_wall, count=8000):
    phi = np.linspace(-np.pi, np.pi, count, endpoint=False).astype(np.float32)
    waves = [np.sin((3 + 4 * k) * phi + random.uniform(0, 6)) for k in range(3)]
    colours = np.stack([100 + 60 * w for w in (waves[:1] * 3 if grey_wall else waves)]).astype(np.float32)
    colours += random.standard_normal(colours.shape).astype(np.float32)
    offset = random.uniform(-4, 4, count).astype(np.float32)
    unit, nowhere = np.ones(count, np.float32), np.zeros(count, int)
    return LineSight(nowhere, np.arange(count), offset, 0.2 * unit, colours, unit, phi, unit, phi)


def _recorded(light, sight, random):
    """Return the line (1, N, 3) of a laser with ``light`` (3,) in blue, green and red, and dark beside it."""
    bell = np.exp(-0.5 * (sight.offset_px / 1.1) ** 2)
    own = np.pad(np.array(light)[:, None] * sight.reflectance * bell, ((0, 0), (0, 3 * len(bell))))
    noisy = own + 16 + random.standard_normal(own.shape)
    return np.clip(noisy.T[None] + 0.5, 0, 255).astype(np.uint8)


@pytest.mark.parametrize("light", [(0.1, 1.2, 0.3), (0.5, 0.05, 2.0), (0.5, 0.5, 0.5)])
@pytest.mark.parametrize("grey_wall", [False, True])
def test_the_weights_of_the_walls_colours_in_the_line_are_those_of_the_laser(light, grey_wall):
    """On grey wall a green laser was "red, 1.00 ± .12": grey frames do not show which channel it is in."""
    random, sights = np.random.default_rng(7), {}

    def pictures():
        for frame in range(6):
            sights[frame] = _sight(random, grey_wall)
            yield frame, _recorded(light, sights[frame], random)

    scene = SimpleNamespace(pose=lambda frame: frame, line=lambda frame: sights[frame])
    kept = list(pictures())
    colour, sd = line_colour(scene, kept, 1.1)
    true = LUMA_BGR * light / (LUMA_BGR @ light)
    np.testing.assert_allclose(colour, true, atol=0.03)
    assert (np.abs(colour - true) < np.maximum(4 * sd, 0.006)).all()  # black is known to half a grey level
    assert (sd < 0.02).all()
    grey = [image[0] @ LUMA_BGR - 16 for _, image in kept]
    samples = LineSamples(None, 0.0, np.inf, 0.15, 1.1, (colour, sd))
    for frame, one in enumerate(grey):
        samples.add(frame, one.astype(np.float32)[None], sights[frame])
    np.testing.assert_array_equal(samples.solve().colour, colour)


@pytest.mark.parametrize("absent", [(0, 1), (1,), (0,)])
@pytest.mark.parametrize("part", [0.1, 1.0])
def test_wall_that_is_black_in_a_channel_does_not_change_the_weights_of_the_others(absent, part):
    """Red paint on a tenth of the wall made weights of .01, .87, .11 ones of .02, .98, 0 ± .0001."""
    random, light = np.random.default_rng(7), np.array([0.1, 1.2, 0.3])
    black = np.isin(np.arange(3), absent)[:, None]
    sight = _sight(random, False)
    painted = black & (np.abs(sight.phi_rad) <= part * np.pi)
    sight = replace(sight, reflectance=np.where(painted, np.float32(0), sight.reflectance))
    scene = SimpleNamespace(pose=lambda frame: frame, line=lambda _: sight)
    colour, _ = line_colour(scene, [(k, _recorded(light, sight, random)) for k in range(6)], 1.1)
    true = LUMA_BGR * light * (1 - black[:, 0] * (part == 1))
    np.testing.assert_allclose(colour, true / true.sum(), atol=0.03)


def test_without_colour_frames_the_weights_are_not_known():
    colour, sd = line_colour(None, [(3, None)], 1.1)
    assert (colour == 1 / 3).all()
    assert np.isinf(sd).all()
