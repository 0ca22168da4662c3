"""Exchanged pictures are found by the wall's motion; losses and a standing probe are no exchange."""

from __future__ import annotations

import numpy as np
import pytest

from stages.premises.light import Light
from stages.premises.order import (
    _exchanged_blocks,
    _in_usual_steps,
    _lights_exchanged,
    _off_their_place,
    out_of_order,
)
from stages.premises.pictures import Pictures
from tests.hand_pulled import pulled


def told_by_motion(order, way, noise_mm):
    """Return which lit pictures, stored in this ``order``, are reported; the first has no partner."""
    count = len(order)
    step = np.diff(way[order], prepend=np.nan) + noise_mm
    pictures = Pictures(
        np.ones(count), np.zeros(count), np.ones((count, 8), np.float32), np.arange(8.0), np.ones(count),
        np.arange(count) - 1, np.ones(count), step,
    )  # fmt: skip
    return np.flatnonzero(out_of_order(pictures, np.full(count, Light.WALL))).tolist()


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("noise", [0.0, 0.05])
@pytest.mark.parametrize(
    "pair", [[50, 53], [1, 4], [75, 78]], ids=["in the run", "near its begin", "its end"]
)
def test_a_standing_probe_neither_hides_an_exchange_nor_causes_one(pair, noise, seed):
    """The ratio of a step to the usual one is there noise over noise, or 0

    0, which hid later exchanges.

    Near the start the first step was the usual one; repeated before the run, it outweighed all others.
    """
    random = np.random.default_rng(seed)
    way = np.cumsum(np.where((np.arange(80) > 9) & (np.arange(80) < 30), 0.0, 2.0))
    order = np.arange(80)
    order[pair] = order[pair[::-1]]
    assert told_by_motion(order, way, noise * random.standard_normal(80)) == pair


@pytest.mark.parametrize("pair", [[0, 1], [0, 3], [76, 79], [78, 79]])
def test_exchanges_of_the_first_and_the_last_lit_picture_cannot_be_detected(pair):
    """They were said to be detectable, by a step before the first picture, which no recording has."""
    order = np.arange(80)
    order[pair] = order[pair[::-1]]
    assert told_by_motion(order, 2.0 * np.arange(80), 0.0) == []


def exchanged(taken, way):
    """Return which pictures count as exchanged, of those ``taken`` in this order at ``way``, lit in turn."""
    light = np.where(taken % 2 == 0, Light.WALL, Light.LINE)
    place = np.flatnonzero(light == Light.WALL)[1:]
    size = np.diff(way[taken[np.flatnonzero(light == Light.WALL)]])
    return np.flatnonzero(_lights_exchanged(light, place, size)).tolist()


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize("still", [0, 6, 36])
def test_exchanged_neighbours_are_reported_even_just_after_a_standstill(still, sense):
    """Three pictures of a standing wall made the usual speed 0, by which the distance was divided."""
    speed = np.ones(100)
    speed[36 - still : 36] = 0
    taken = np.arange(100)
    taken[[40, 41]] = taken[[41, 40]]
    assert exchanged(taken, sense * np.cumsum(speed)) == [40, 41]
    assert exchanged(taken, 0 * speed) == []


@pytest.mark.parametrize("sense", [1, -1])
def test_two_losses_are_not_an_exchange_in_either_direction_of_motion(sense):
    """For backward motion the longest steps around were taken for the usual ones, not the shortest."""
    pairs = np.concatenate([k + np.arange(2) for k in (28, 34, 48, 54, 60)])
    taken = np.setdiff1d(np.arange(100), np.r_[pairs, 42, 45])
    assert exchanged(taken, sense * np.arange(100.0)) == []


@pytest.mark.parametrize("others", [0, 5])
def test_two_losses_on_slow_wall_are_not_an_exchange_in_a_run_with_many_losses(others):
    """With one picture in ten lost, two were "exchanged" and left out, and three losses were not found."""
    speed = np.ones(120)
    speed[50:60] = 0.7
    taken = np.setdiff1d(np.arange(120), np.r_[52, 55, 5 + 5 * np.arange(others), 80 + 5 * np.arange(others)])
    first = int(np.flatnonzero(taken == 53)[0])
    assert exchanged(taken, np.cumsum(speed)) == ([] if others else [first, first + 1])


def test_an_exchange_is_reported_in_a_long_run_with_losses_elsewhere():
    """Three lost pictures of 10 000 hid every exchange."""
    taken = np.arange(10_000)
    taken[[40, 41]] = taken[[41, 40]]
    taken = np.delete(taken, 1000 + 700 * np.arange(9))
    assert exchanged(taken, np.arange(10_000.0)) == [40, 41]


@pytest.mark.parametrize("seed", range(5))
def test_a_probe_that_stands_for_most_of_a_run_causes_no_exchange(seed):
    """For more than half of the run noise was compared with noise."""
    random = np.random.default_rng(seed)
    size = np.where((np.arange(100) > 20) & (np.arange(100) < 90), 0.0, 2.0) + 0.05 * random.standard_normal(
        100
    )
    assert not _off_their_place(_in_usual_steps(size)).any()


@pytest.mark.parametrize("seed", range(40))
def test_a_probe_pulled_by_hand_exchanges_no_blocks(seed):
    assert _exchanged_blocks(_in_usual_steps(pulled(seed).steps.size)) == []


@pytest.mark.parametrize(("first", "back", "last"), [(40, 190, 360), (40, 43, 47), (40, 41, 360)])
def test_three_jerks_of_the_probe_exchange_no_blocks(first, back, last):
    """Jerks of less than a step, 150 and 170 pictures apart, left out 321 of 400 pictures."""
    step = np.ones(400)
    step[[first, back, last]] = 1.8, -0.8, 1.9
    assert _exchanged_blocks(step) == []


@pytest.mark.parametrize(("one", "other"), [(2, 1), (5, 5), (3, 12)])
def test_exchanged_blocks_of_any_lengths_are_found(one, other):
    order = np.r_[:100, 100 + one : 100 + one + other, 100 : 100 + one, 100 + one + other : 400]
    assert _exchanged_blocks(_in_usual_steps(np.diff(order))) == [(99, 99 + one + other)]
