"""Two runs joined in one recording are reported.

Lost pictures, failing lamps and a standing probe are not.
"""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.arrays import Float
from stages.premises.cuts import cuts
from stages.premises.light import Light
from stages.premises.pictures import Pictures

COUNT, CUT = 60, 31
NUMBERS = np.arange(COUNT)
NOTHING = np.zeros(COUNT, bool)
SHOWN = np.where(NUMBERS % 2, Light.WALL, Light.LINE)


def pictures(change: Float, step: Float) -> Pictures:
    plain = np.ones(COUNT)
    return Pictures(
        plain, plain, np.ones((COUNT, 1), np.float32), np.zeros(1), plain, NUMBERS - 2, change, step
    )


def steady() -> tuple[Float, Float]:
    random = np.random.default_rng(1)
    return 6 + 0.1 * random.standard_normal(COUNT), 0.02 + 0.001 * random.standard_normal(COUNT)


def found(change: Float, step: Float, time_s: Float = NUMBERS / 30) -> list[int]:
    return [int(k) for k in cuts(pictures(change, step), SHOWN, NOTHING, time_s)]


@pytest.mark.parametrize("step", [np.nan, -0.3, 0.4], ids=["none", "back", "far"])
def test_a_change_of_the_wall_is_a_cut(step: float) -> None:
    change, steps = steady()
    change[CUT], steps[CUT] = 13.0, step
    assert found(change, steps) == [CUT]


def test_one_sign_of_a_cut_alone_is_not_reported() -> None:
    change, steps = steady()
    assert found(change, steps) == []
    assert found(np.where(NUMBERS == CUT, 40.0, change), steps) == [], "lamps fail, texture continues"
    assert found(change, np.where(NUMBERS == CUT, np.nan, steps)) == [], "pictures are blurred"


def test_known_missing_pictures_are_not_a_cut() -> None:
    change, steps = steady()
    change[CUT], steps[CUT] = 13.0, 0.4
    assert found(change, steps, np.where(NUMBERS >= CUT, NUMBERS + 28, NUMBERS) / 30) == []


def test_a_long_step_beside_others_with_gaps_in_their_times_is_not_a_cut() -> None:
    """Hand-pulled, with varying frame times, a run was cut, and σ of its 28 mm was 40 mm."""
    change, steps = steady()
    far = np.isin(NUMBERS, [CUT - 6, CUT, CUT + 4])
    time_s = NUMBERS / 30 + 0.04 * (np.searchsorted([CUT - 6, CUT + 4], NUMBERS, "right"))
    assert found(np.where(far, 13.0, change), np.where(far, 0.2, steps), time_s) == []
    assert found(np.where(far, 13.0, change), np.where(far, 0.2, steps), NUMBERS / 30) == []
    alone = NUMBERS == CUT
    assert found(np.where(alone, 13.0, change), np.where(alone, 0.2, steps), time_s) == [CUT]


def test_a_probe_that_stood_and_moves_on_is_not_a_cut() -> None:
    change, steps = steady()
    still = NUMBERS < CUT
    assert found(np.where(still, 0.3, change), np.where(still, 0.0, steps)) == []


def test_pictures_that_are_left_out_give_no_report() -> None:
    change, steps = steady()
    change[CUT], steps[CUT] = 13.0, np.nan
    assert cuts(pictures(change, steps), SHOWN, NUMBERS == CUT, NUMBERS / 30).size == 0
    assert cuts(pictures(change, steps), SHOWN, NOTHING, NUMBERS / 30).size == 1
