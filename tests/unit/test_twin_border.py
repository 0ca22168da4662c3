"""A step of brightness that differs from the middle to the border of the picture is none of a light."""

import numpy as np
import pytest

from pipeline.instrument.probe import Lighting
from stages.twin.causes import causes
from stages.twin.cells import SECTORS, Cells
from stages.twin.reference import BlockSamples
from stages.twin.scene import Ring

RING, FRAMES, ROWS, COLUMNS, FIRST = Ring((128.0, 96.0), 60.0, 50.0, 23.0), 14, 24, 32, 7
NUMBER = 8 * np.arange(FRAMES)


def _samples(at_border, steadily=0.0, rows=ROWS):
    """Return blocks whose brightness steps by ``at_border`` more at the border than in the middle."""
    frame, row, column = np.indices((FRAMES, rows, COLUMNS)).reshape(3, -1)
    away = np.hypot(row - 11.5, column - 15.5) / 15.0
    more = at_border * (frame >= FIRST) + steadily * frame
    log = more * away**2 + 0.02 * np.random.default_rng(2).standard_normal(frame.size)
    even = np.ones(frame.size)
    return BlockSamples(
        np.expm1(log), 4 * even, even, frame, row, column, row + 2 * frame, column, 0.0, 2.0, NUMBER,
        away, even,
    )  # fmt: skip


def _cells(step, seed, of_photo):
    change = step * (np.arange(FRAMES) >= FIRST)[:, None]
    ratio = np.exp(change + of_photo * np.random.default_rng(seed).standard_normal((FRAMES, SECTORS)))
    own, pixels = np.full(ratio.shape, 200_000.0), np.full(ratio.shape, 500.0)
    return Cells(NUMBER, pixels + ratio**2 * own, ratio * own, own, pixels, 20 * pixels)


def _told(samples, lit=-0.11, line=-0.11):
    return causes(_cells(lit, 0, 0.01), _cells(line, 1, 0.03), Lighting(), RING, samples)[0]


@pytest.mark.parametrize("way", [-1, 1])
@pytest.mark.parametrize("line", [-0.11, -0.05])
def test_a_step_that_is_larger_at_the_border_of_the_picture_has_no_name(way, line):
    """A hood that shades the lens from a frame on was told as an exposure 11 % shorter."""
    found = _told(_samples(way * 0.1), way * 0.11, -way * line)
    assert found
    assert {(m.name, m.fixed_to) for m in found} == {("", "time")}
    assert all(f"% {'brighter' if way > 0 else 'darker'}: no change" in m.statement for m in found)


@pytest.mark.parametrize(
    ("lit", "line", "name"),
    [(-0.11, -0.11, "exposure_step"), (-0.11, 0.0, "lamp_step"), (0.0, -0.3, "laser_step")],
)
def test_a_step_that_is_alike_at_border_and_middle_keeps_its_name(lit, line, name):
    for samples in (_samples(0.0), _samples(0.01), _samples(0.0, steadily=0.02), _samples(0.1, rows=1), None):
        (step,) = _told(samples, lit, line)
        assert step.name == name
