"""What remains of the travel beside an incomplete library, a slip or misplaced pictures."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from pipeline.recording.base import Encoder
from stages.diagnose.travel.events import with_events
from stages.diagnose.travel.left_over import left_over
from stages.diagnose.travel.model import EventKind, fitted
from stages.diagnose.travel.sight import Sight
from stages.diagnose.travel.solve import PLAY
from stages.diagnose.travel.steps import steps_found
from tests.travel_cases import read, seen

# Effects missing from the library beside the slip: a delay or play that is fitted absorbs a part of it.
LAGS = ("time_offset", "encoder_backlash")


@pytest.mark.parametrize("placed", [True, False])
@pytest.mark.parametrize("at_s", [1.0, 3.0, 4.2, 7.7])
def test_a_slip_missing_from_the_library_is_unexplained_from_its_time_on(placed, at_s, monkeypatch):
    """Near the ends the fit takes it for misplaced pictures, beside which nothing remains."""
    # More misplaced pictures are searched in vain, which takes time.
    monkeypatch.setattr("stages.diagnose.travel.events._MOST", 4)
    sight = replace(seen(np.random.default_rng(10), drift_mm=0.001, every=4), placed=placed)
    slipped = read(slips=((at_s, 1.36),))
    fit = with_events(sight, slipped, ("encoder_slip", *LAGS))
    left = left_over(fit, steps_found(fit, slipped), 0.05)
    assert left is not None
    assert left.off_mm == pytest.approx(1.36, abs=0.05)
    assert at_s < left.time_s[0] < at_s + 0.14
    assert left.time_s[1] == sight.time_s[-1]
    assert left.p_value < 1e-12
    assert "no effect of an encoder explains" in left.statement


@pytest.mark.parametrize("placed", [True, False])
def test_a_delay_and_play_fitted_instead_do_not_reduce_the_reported_remainder(placed):
    sight = replace(seen(np.random.default_rng(10), drift_mm=0.001, every=4), placed=placed)
    slipped = read(slips=((3.0, 1.36),))
    fit = fitted(sight, slipped, (), None, ("encoder_slip",))
    assert fit.values[PLAY] != 0
    left = left_over(fit, (), 0.05)
    assert left is not None
    assert left.off_mm == pytest.approx(1.36, abs=0.05)
    assert left.time_s == (pytest.approx(3.07, abs=0.07), sight.time_s[-1])


@pytest.mark.parametrize("seed", [4, 56, 98])
def test_two_slightly_misplaced_pictures_after_a_turn_leave_no_remainder(seed):
    """Beside a delay and a play of zero, .2 mm became .7 mm: a slip was reported for a sound encoder."""
    knots_s = [0.0, 0.2, 3.667, 4.2, 4.6, 5.0, 5.267, 5.533, 6.0]
    way = PchipInterpolator(knots_s, [-22.0, -17.26, 64.16, 71.0, 70.0, 66.53, 63.45, 62.41, 62.3])
    time_s = np.r_[0.2 + np.arange(14) * 4 / 15, 5.0 + np.arange(3) * 4 / 15]
    found = way(time_s) + 0.02 * np.random.default_rng(seed).standard_normal(17)
    found[-2:] += 0.29, -0.23
    path = np.r_[0, np.cumsum(np.abs(np.diff(way(time_s))))]
    sight = Sight(4 * np.arange(17), time_s, found, path, 3e-4, 1 / 15, placed=True)
    read_s = np.arange(0, 6, 0.01)
    encoder = Encoder(read_s, 0.05 * np.round(way(read_s) / 0.05))
    fit = with_events(sight, encoder)
    assert left_over(fit, steps_found(fit, encoder), 0.05) is None


@pytest.mark.parametrize("placed", [True, False])
def test_a_slip_that_the_library_has_leaves_no_remainder(placed):
    sight = replace(seen(np.random.default_rng(10), drift_mm=0.001), placed=placed)
    slipped = read(slips=((4.2, 1.36),))
    fit = with_events(sight, slipped)
    assert left_over(fit, steps_found(fit, slipped), 0.05) is None


@pytest.mark.parametrize("placed", [True, False])
def test_play_shown_by_only_a_few_pictures_is_not_a_row_of_misplaced_ones(placed):
    sight = replace(seen(np.random.default_rng(10), drift_mm=0.001), placed=placed)
    fit = with_events(sight.select((sight.time_s > 2.6) & (sight.time_s < 3.85)), read(play_mm=0.5))
    assert fit.values[PLAY] == pytest.approx(0.5, abs=0.1)
    assert left_over(fit, (), 0.05) is None


def strayed(places: dict[int, float], **of_sight: Any) -> Sight:
    """Return the visual distances with some pictures misplaced."""
    sight = replace(seen(np.random.default_rng(11), drift_mm=0.001), **of_sight)
    distance_mm = sight.distance_mm.copy()
    distance_mm[list(places)] += list(places.values())
    return replace(sight, distance_mm=distance_mm)


@pytest.mark.parametrize("placed", [True, False])
@pytest.mark.parametrize(("first", "count"), [(50, 2), (50, 4), (0, 2)])
def test_misplaced_pictures_in_a_row_are_reported_and_at_an_end_as_a_possible_slip_too(placed, first, count):
    row = range(first, first + count)
    sight = strayed(dict.fromkeys(row, 1.0), placed=placed)
    fit = with_events(sight, read(), LAGS)
    left = left_over(fit, steps_found(fit, read()), 0.05)
    doubts = [s.doubt for s in steps_found(fit, read())] + [left.statement for left in [left] if left]
    (told,) = doubts
    if first == 0:
        assert "slip" in told
        assert "they look the same here: record the passage again, slowly" in told
    else:
        assert left is not None
        assert left.where == (50, 49 + count)
        assert left.off_mm == pytest.approx(-1.0, abs=0.05)
        assert "no effect of an encoder explains" in told


def test_slips_that_cancel_at_once_are_reported_as_unexplained_by_any_one_effect():
    sight = strayed({})
    slipped = read(slips=((4.2, 1.36), (4.5, -1.36)))
    fit = with_events(sight, slipped)
    left = left_over(fit, steps_found(fit, slipped), 0.05)
    assert left is not None
    assert not left.by_slip
    assert left.off_mm == pytest.approx(1.36, abs=0.05)
    assert left.time_s == (pytest.approx(4.2, abs=0.08), pytest.approx(4.5, abs=0.08))


@pytest.mark.parametrize("placed", [True, False])
def test_single_misplaced_pictures_leave_no_remainder(placed):
    sight = strayed({20: 1.0, 50: -0.8, 90: 1.2}, placed=placed)
    fit = with_events(sight, read())
    assert [e.kind for e in fit.events] == [EventKind.OUTLIER] * 3
    assert left_over(fit, steps_found(fit, read()), 0.05) is None


@pytest.mark.parametrize("placed", [True, False])
def test_a_misplaced_picture_beside_a_slightly_misplaced_one_leaves_no_remainder(placed):
    """Two of the same sign were taken for a row: "unless 1 pictures in a row were misplaced"."""
    sight = strayed({20: 2.0, 21: 0.2}, placed=placed)
    fit = with_events(sight, read())
    assert left_over(fit, steps_found(fit, read()), 0.05) is None


def test_noise_leaves_remainders_as_often_as_their_p_value_says(monkeypatch):
    """For drawn distances of noise alone, the stated p of the strongest stretch is not too small."""
    monkeypatch.setattr("stages.diagnose.travel.left_over._NOISE", 2.0)
    told = []
    for seed in range(20):
        sight = seen(np.random.default_rng(seed), False, drift_mm=0.01, every=3)
        fit = fitted(sight, read(False), (), None, ("encoder_slip", *LAGS))
        left = left_over(fit, (), 0.05)
        assert left is not None
        told.append(left.p_value)
    assert np.mean(np.array(told) < 0.2) <= 0.2
    assert min(told) > 0.01


@pytest.mark.parametrize("placed", [True, False])
def test_one_misplaced_picture_and_a_sound_encoder_leave_no_remainder(placed):
    sight = replace(seen(np.random.default_rng(11), drift_mm=0.001), placed=placed)
    stray = sight.distance_mm.copy()
    stray[40] += 1.0
    for one in (sight, replace(sight, distance_mm=stray)):
        fit = with_events(one, read())
        assert left_over(fit, steps_found(fit, read()), 0.05) is None
