"""Time stamps that are equal after rounding are separated again; a clock that stood still is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.arrays import Float
from pipeline.errors import InputError
from pipeline.recording.base import FrameTable
from pipeline.recording.rounded_stamps import without_rounding

COUNT, RATE = 90, 30.0
TIMES_S = 0.4 + np.arange(COUNT) / RATE


def table_of(time_s: Float) -> FrameTable:
    return FrameTable(np.arange(len(time_s)), time_s, np.full(len(time_s), "led"))


def parted(time_s: Float) -> tuple[Float, tuple[str, ...]]:
    table, noticed = without_rounding(Path("frames.csv"), table_of(time_s), RATE)
    return table.time_s, noticed


def test_increasing_times_are_not_changed() -> None:
    found, noticed = parted(TIMES_S)
    np.testing.assert_array_equal(found, TIMES_S)
    assert noticed == ()


@pytest.mark.parametrize("unit_s", [0.05, 0.1, 1.0])
def test_rounded_times_of_a_regular_rhythm_get_those_of_the_rhythm(unit_s: float) -> None:
    found, (noticed,) = parted(np.round(TIMES_S / unit_s) * unit_s)
    assert f"rounded to {unit_s:g} s" in noticed
    assert "an even rhythm" in noticed
    np.testing.assert_allclose(np.diff(found), 1 / RATE, rtol=1e-9)
    assert np.abs(found - TIMES_S).max() < unit_s / 4


def test_a_rhythm_that_differs_from_the_stated_one_is_taken_from_the_stamps() -> None:
    found, _ = parted(np.round(TIMES_S * RATE / 25, 1))
    np.testing.assert_allclose(np.diff(found), 1 / 25, rtol=0.003)


def test_rounded_times_of_an_irregular_rhythm_stay_within_their_rounding() -> None:
    kept = np.sort(np.random.default_rng(1).choice(TIMES_S, COUNT * 3 // 4, replace=False))
    found, (noticed,) = parted(np.round(kept, 1))
    assert "spread evenly over its rounding" in noticed
    assert np.all(np.diff(found) > 0)
    assert np.abs(found - kept).max() < 0.1


@pytest.mark.parametrize("count", [2, 12])
def test_a_clock_that_stood_still_is_refused(count: int) -> None:
    stood = TIMES_S.copy()
    stood[30 : 30 + count] = stood[30]
    with pytest.raises(InputError, match=rf"up to {count} frames have one time"):
        parted(stood)


def test_a_clock_that_stood_still_among_rounded_times_is_refused() -> None:
    with pytest.raises(InputError, match="frames have one time"):
        parted(np.round(np.where(np.arange(COUNT) < 12, TIMES_S[0], TIMES_S), 1))
