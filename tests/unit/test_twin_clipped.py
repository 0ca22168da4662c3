"""Pixels in which only one colour is clipped: recognised in colour pictures, and excluded."""

from types import SimpleNamespace

import numpy as np

from stages.twin.lamp_light import Figure
from stages.twin.noise import CameraNoise
from stages.twin.state import clipped_pixels
from stages.twin.sums import Sums


def test_a_green_line_clips_though_its_grey_does_not():
    """Its grey level stays below 160, so that its leaking light was not recognised."""
    colour = np.full((6, 8, 3), 20, np.uint8)
    colour[2:4, :, 1] = 255
    clipped = clipped_pixels([(3, colour), (4, None)])
    assert list(clipped) == [3]
    one = Figure(1.0, 0.1)
    noise = CameraNoise(Figure(0.0, 0.1), 255.0, one, one, one, one)
    sums = SimpleNamespace(_state=SimpleNamespace(noise=noise), _clipped=clipped)
    grey = np.full((6, 8), 20, np.float32)
    grey[2:4], grey[0, 0] = 158, 255
    assert Sums._free(sums, 3, grey).sum() == 48 - 16 - 1
    assert Sums._free(sums, 5, grey).sum() == 48 - 1
