"""Repeated pictures are recognised by how little they change, whatever their exposures."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from pipeline.arrays import Bool, Float, Int
from pipeline.recording.base import Encoder, FrameTable
from stages.premises.light import Light
from stages.premises.losses import Steps
from stages.premises.pictures import Pictures, change_between
from stages.premises.repeats import best_followed, copies, rows_that_follow_encoder


def test_pictures_with_equal_exposure_by_chance_are_not_copies() -> None:
    """The wall moves on in both, in one at 1.4 times the light; a copy hardly changes, whatever its light."""
    random = np.random.default_rng(2)
    wall = cv2.GaussianBlur(random.uniform(40, 160, (80, 240)).astype(np.float32), (0, 0), 2)
    moved = np.roll(wall, 3, 0)
    assert change_between(wall, 1.4 * moved) == pytest.approx(change_between(wall, moved), rel=0.2)
    assert change_between(1.4 * moved, wall) == pytest.approx(change_between(wall, 1.4 * moved), rel=1e-5)
    copy = 1.4 * wall + random.normal(0, 1, wall.shape).astype(np.float32)
    assert change_between(wall, copy) < 0.25 * change_between(wall, moved)
    assert change_between(np.zeros_like(wall), wall) == pytest.approx(wall.mean(), rel=1e-5)


def line_copies(change: Float) -> Bool:
    """Return which pictures of the line, alternating with lit ones, are copies by their change."""
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


def test_pictures_of_a_vibrating_camera_with_equal_shift_are_not_copies() -> None:
    """Shifted by a pixel, one in nine lies as the one before: a pit under two of these was missed."""
    random = np.random.default_rng(4)
    alike = random.random(900) < 1 / 9
    assert line_copies(np.where(alike, 0.115, random.uniform(0.25, 0.75, 900))).sum() < 10
    steady = random.uniform(0.11, 0.25, 200)
    steady[[40, 90, 94]] = 0.02
    assert np.flatnonzero(line_copies(steady)).tolist() == [40, 90, 94]


@pytest.mark.parametrize("often", [3, 4, 5, 8])
def test_frequent_copies_are_all_reported(often: int) -> None:
    """Every third one, as by conversion from 20 to 30 pictures a second, hid the others."""
    change = np.random.default_rng(6).uniform(0.2, 0.25, 240)
    change[often::often] = 0.02
    assert np.flatnonzero(line_copies(change)).tolist() == list(range(often, 240, often))


def rows_told(seed: int, copied: slice, covered: slice, put_in: bool) -> tuple[Int, Int]:
    """Return the rows found and the true ones; the encoder's table has only the rows in ``covered``."""
    random, count = np.random.default_rng(seed), 300
    again = np.zeros(count, bool)
    again[copied] = True
    true = np.arange(count) - put_in * np.cumsum(again)
    time_s = np.arange(count) / 30
    mm = np.cumsum(1 + 0.5 * np.sin(2 * np.pi * np.arange(count) / 120))
    lit = np.flatnonzero((np.arange(count) % 2 == 1) & ~again)
    size = np.diff(mm[true[lit]]) / 50 * (1 + 0.05 * random.standard_normal(len(lit) - 1))
    table = FrameTable(np.arange(count), time_s, np.where(np.arange(count) % 2, "led", "laser"))
    encoder = Encoder(time_s[covered], mm[covered])
    return rows_that_follow_encoder(
        np.arange(count), again, table, Steps(lit[:-1], lit[1:], size), encoder
    ), true


@pytest.mark.parametrize(
    ("copied", "covered"),
    [(slice(20, 80), slice(200, 300)), (slice(100, 180), slice(250, 300)), (slice(20, 40), slice(0, 60))],
)
def test_rows_without_an_encoder_reading_do_not_follow_the_wall(copied: slice, covered: slice) -> None:
    """Beyond its table the encoder showed no motion, which contradicts no wall.

    Rows were up to 80 too early.
    """
    for seed in range(4):
        told, true = rows_told(seed, copied, covered, put_in=False)
        np.testing.assert_array_equal(told, true)


@pytest.mark.parametrize("covered", [slice(0, 300), slice(60, 240)])
def test_rows_move_up_behind_inserted_pictures_if_an_encoder_of_most_rows_shows_it(covered: slice) -> None:
    told, true = rows_told(1, slice(100, 110), covered, put_in=True)
    np.testing.assert_array_equal(told, true)


@pytest.mark.parametrize("crawls", [True, False])
def test_a_crawler_that_moves_in_steps_loses_no_pictures(crawls: bool) -> None:
    """Every second step was twice as long, in the encoder too, and 34 pictures "were lost"."""
    at, random = np.arange(80), np.random.default_rng(8)
    way = np.cumsum(np.where(at % 2, 1.0, 0.5))
    mended = at + np.cumsum(at % 2)
    size = np.diff(way) / 25 * (1 + 0.05 * random.standard_normal(79))
    table = FrameTable(at, at / 30, np.full(80, "both"))
    encoder = Encoder((at if crawls else mended) / 30, np.round(way / 0.05) * 0.05)
    found = best_followed((mended, at), table, Steps(at[:-1], at[1:], size), encoder)
    np.testing.assert_array_equal(found, at if crawls else mended)
