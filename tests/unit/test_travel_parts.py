"""One part of a run predicts the other.

For the true cause they agree, for others of the same total they do not.
"""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.arrays import Float
from pipeline.recording.base import Encoder
from stages.diagnose.travel.events import with_events
from stages.diagnose.travel.lines import find_lines, swing_agreements
from stages.diagnose.travel.model import fitted, second_predictions
from stages.diagnose.travel.sight import turns_between
from stages.diagnose.travel.solve import DELAY, PLAY, SCALE
from stages.diagnose.travel.steps import jump_of_reading, reading_jump, steps_found
from tests.travel_cases import read, seen, way

TIME_S = np.arange(240) / 30
EARLY = TIME_S < 4
LIT = np.arange(240) % 4 == 3
# Where `way` turns back for the first time.
TURN_S = 3.6


def agreed(encoder: Encoder, column: int, seed: int = 1) -> list[bool]:
    """Return for each second prediction whether it agrees, without any events."""
    fit = fitted(seen(np.random.default_rng(seed)), encoder, (), None)
    return [a.confirmation.agrees for a in second_predictions(fit, column)]


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(
    ("column", "fault", "size"),
    [(SCALE, "scale", 0.02), (DELAY, "delay_s", -0.04), (PLAY, "play_mm", 1.0), (PLAY, "play_mm", 0.4)],
)
def test_a_true_cause_has_the_same_size_in_every_part(
    column: int, fault: str, size: float, seed: int
) -> None:
    found = agreed(read(**{fault: size}), column, seed)  # type: ignore[arg-type]
    assert found
    assert all(found)


@pytest.mark.parametrize(("column", "fault", "size"), [(DELAY, "delay_s", 0.0005), (PLAY, "play_mm", 0.02)])
def test_parts_with_too_little_information_confirm_nothing(column: int, fault: str, size: float) -> None:
    assert agreed(read(**{fault: size}), column) == []  # type: ignore[arg-type]


def test_a_slip_where_the_probe_turns_back_is_not_confirmed_as_play() -> None:
    assert True not in agreed(read(slips=((TURN_S, 1.0),)), PLAY)


def test_a_scale_that_changes_halfway_is_not_confirmed_as_a_scale() -> None:
    worn = read(scale=0.03)
    sound = read()
    reading = np.where(worn.time_s < 4, worn.distance_mm, 0.0)
    later = sound.distance_mm - np.interp(4.0, sound.time_s, sound.distance_mm)
    reading += np.where(worn.time_s < 4, 0.0, later + np.interp(4.0, worn.time_s, worn.distance_mm))
    found = agreed(Encoder(worn.time_s, reading), SCALE)
    assert False in found


def test_a_clock_that_jumps_is_not_confirmed_as_a_delay() -> None:
    late, later = read(delay_s=0.02), read(delay_s=0.08)
    jumped = np.where(late.time_s < 4.0, late.distance_mm, later.distance_mm)
    assert True not in agreed(Encoder(late.time_s, jumped), DELAY)


def test_the_turning_point_between_pictures_is_taken_from_the_reading() -> None:
    # One picture in 0.2 s shows the turning point only to a few mm.
    sight = seen(np.random.default_rng(3), every=6)
    encoder = read(play_mm=1.0)
    fine = way(encoder.time_s)
    turns = turns_between(sight, encoder, 0.0)
    assert turns.distance_mm == pytest.approx([fine[:450].max(), fine[300:600].min()], abs=0.06)
    fit = with_events(sight, encoder)
    assert fit.values[PLAY] == pytest.approx(1.0, abs=0.08)
    assert fit.events == ()


@pytest.mark.parametrize("gain_mm", [-3.0, 0.8])
def test_a_slip_is_a_jump_of_the_reading_only(gain_mm: float) -> None:
    encoder = read(slips=((2.303, gain_mm),))
    fit = with_events(seen(np.random.default_rng(5)), encoder)
    (step,) = steps_found(fit, encoder)
    assert [a.confirmation.agrees for a in step.agreements] == [True]


def test_a_step_without_a_jump_of_its_size_is_not_confirmed_as_a_slip() -> None:
    encoder = read(slips=((2.303, 1.0),))
    at = int(np.searchsorted(encoder.time_s, 2.303)) - 1
    jump, sigma = reading_jump(encoder, at)
    assert jump == pytest.approx(1.0, abs=4 * sigma)
    other = jump_of_reading(encoder, at, 2.0, 0.02)
    smooth = jump_of_reading(read(), at, 2.0, 0.02)
    assert other is not None
    assert smooth is not None
    assert not other.confirmation.agrees
    assert not smooth.confirmation.agrees
    assert max(other.ratio, smooth.ratio) < 1e-6
    assert jump_of_reading(encoder, 3, 1.0, 0.02) is None


def swing(frequency: float) -> Float:
    return 0.2 * np.sin(2 * np.pi * frequency * TIME_S + 0.4)[:, None] * np.array([0.8, 0.6])


def halves(places: Float) -> list[bool]:
    noise = 0.003 * np.random.default_rng(6).standard_normal((len(TIME_S), 2))
    return [a.confirmation.agrees for a in swing_agreements(TIME_S, places + noise, LIT, 5.3)]


def test_a_vibration_has_the_same_phase_in_both_halves_and_both_kinds_of_pictures() -> None:
    assert halves(swing(5.3)) == [True, True]


def test_a_vibration_that_begins_late_is_not_confirmed() -> None:
    assert True not in halves(np.where(EARLY[:, None], 0.0, swing(5.3)))


def test_a_vibration_that_changes_its_phase_is_not_confirmed() -> None:
    assert halves(np.where(EARLY[:, None], swing(5.3), -swing(5.3))) == [False]


def test_pictures_with_an_unknown_camera_position_do_not_reduce_a_swing() -> None:
    shown = np.ones(len(TIME_S), bool)
    shown[40:50] = False
    carried = np.where(shown[:, None], swing(5.3), 0.0)
    carried += 0.003 * np.random.default_rng(7).standard_normal(carried.shape)
    with_all, alone = (find_lines(TIME_S, carried, LIT, use)[0] for use in (None, shown))
    assert with_all.amplitude_mm < 0.197
    assert alone.amplitude_mm == pytest.approx(0.2, abs=4 * alone.sigma_mm)
