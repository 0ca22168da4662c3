"""The light of the laser's line, estimated from the pixels along it, on synthetic lines."""

import numpy as np
import pytest

from stages.twin.line_light import LineSamples
from stages.twin.scene import LineSight


def _sight(random, count=8000):
    phi = np.linspace(-np.pi, np.pi, count, endpoint=False).astype(np.float32)
    waves = [np.sin((3 + 4 * k) * phi + random.uniform(0, 6)) for k in range(3)]
    colours = np.stack([100 + 60 * w for w in waves]).astype(np.float32)
    offset = random.uniform(-4, 4, count).astype(np.float32)
    unit, nowhere = np.ones(count, np.float32), np.zeros(count, int)
    return LineSight(nowhere, np.arange(count), offset, 0.2 * unit, colours, unit, phi, unit, phi)


@pytest.mark.parametrize("colour", [(0.1, 0.7, 0.2), (0.6, 0.1, 0.3)])
def test_the_shares_of_the_walls_colours_in_the_line_are_estimated(colour):
    random, samples = np.random.default_rng(7), LineSamples(None, 0.0, np.inf, 0.15, 1.1)
    for frame in range(6):
        sight = _sight(random)
        grey = np.array(colour) @ sight.reflectance * np.exp(-0.5 * (sight.offset_px / 1.1) ** 2)
        noisy = grey + random.standard_normal(len(grey))
        samples.add(frame, noisy.astype(np.float32)[None], sight)
    light = samples.solve()
    np.testing.assert_allclose(light.colour, colour, atol=0.03)
    assert (np.abs(light.colour - colour) < 4 * light.colour_sd).all()
    assert (light.colour_sd < 0.02).all()
