"""Pictures shown once more are told by how little they change, whatever their exposures."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from pipeline.arrays import Bool, Float
from stages.premises.light import Light
from stages.premises.pictures import Pictures, change_between
from stages.premises.repeats import copies


def test_pictures_exposed_alike_by_chance_are_no_copies() -> None:
    """The wall goes on in both, in one at 1.4 times the light; a copy hardly changes, whatever its light."""
    random = np.random.default_rng(2)
    wall = cv2.GaussianBlur(random.uniform(40, 160, (80, 240)).astype(np.float32), (0, 0), 2)
    moved = np.roll(wall, 3, 0)
    assert change_between(wall, 1.4 * moved) == pytest.approx(change_between(wall, moved), rel=0.2)
    assert change_between(1.4 * moved, wall) == pytest.approx(change_between(wall, 1.4 * moved), rel=1e-5)
    copy = 1.4 * wall + random.normal(0, 1, wall.shape).astype(np.float32)
    assert change_between(wall, copy) < 0.25 * change_between(wall, moved)
    assert change_between(np.zeros_like(wall), wall) == pytest.approx(wall.mean(), rel=1e-5)


def line_copies(change: Float) -> Bool:
    """Return which pictures of the line, which take turns with lit ones, are copies by their change."""
    count = 2 * len(change)
    both = np.full(count, 5.8)
    both[::2] = change
    light = np.where(np.arange(count) % 2 == 0, int(Light.LINE), int(Light.WALL))
    partner, none = np.maximum(np.arange(count) - 2, -1), np.full(count, np.nan)
    line_px = np.zeros((count, 4), np.float32)
    pictures = Pictures(np.full(count, 8.0), none, line_px, np.zeros(4), none, partner, both, none)
    told = copies(pictures, light, light, np.arange(count), np.arange(count) / 30, None)
    assert not told[1::2].any()
    return np.asarray(told[::2])


def test_trembling_pictures_moved_alike_by_chance_are_no_copies() -> None:
    """Shifted by a pixel, one in nine lies as the one before: a pit under two of these was missed."""
    random = np.random.default_rng(4)
    alike = random.random(900) < 1 / 9
    assert line_copies(np.where(alike, 0.115, random.uniform(0.25, 0.75, 900))).sum() < 10
    steady = random.uniform(0.11, 0.25, 200)
    steady[[40, 90, 94]] = 0.02
    assert np.flatnonzero(line_copies(steady)).tolist() == [40, 90, 94]


@pytest.mark.parametrize("often", [3, 4, 5, 8])
def test_copies_that_come_often_are_all_told(often: int) -> None:
    """Every third one, as a converter from 20 to 30 pictures a second makes them, hid the others."""
    change = np.random.default_rng(6).uniform(0.2, 0.25, 240)
    change[often::often] = 0.02
    assert np.flatnonzero(line_copies(change)).tolist() == list(range(often, 240, often))
