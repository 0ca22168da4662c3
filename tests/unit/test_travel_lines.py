"""Spectral lines in the probe's motion across the pipe.

They are found, measured, and distinguished from a rocking sheet.
"""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.arrays import Float
from stages.diagnose.travel.lines import Line, find_lines

RATE = 30.0
TIME_S = np.arange(240) / RATE
LIT = np.arange(240) % 4 == 3


def wander(seed: int) -> Float:
    """Return places (N, 2) of a probe that wanders slowly by millimetres, measured to a few µm."""
    random = np.random.default_rng(seed)
    out = 0.003 * random.standard_normal((len(TIME_S), 2)) + 1e-3 * np.cumsum(
        random.standard_normal((len(TIME_S), 2)), axis=0
    )
    for f in random.uniform(0.1, 0.9, 4):
        out += np.sin(2 * np.pi * f * TIME_S[:, None] + random.uniform(0, 6, 2)) * random.uniform(0.3, 3, 2)
    return out


def swing(frequency: float, amplitude: float) -> Float:
    return amplitude * np.sin(2 * np.pi * frequency * TIME_S + 0.4)[:, None] * np.array([0.8, 0.6])


def test_a_probe_that_only_wanders_has_no_lines() -> None:
    assert sum(len(find_lines(TIME_S, wander(seed), LIT)) for seed in range(150)) == 0


@pytest.mark.parametrize(("frequency", "alias"), [(5.3, 5.3), (11.0, 11.0), (24.7, 5.3), (33.0, 3.0)])
@pytest.mark.parametrize("amplitude", [0.03, 0.2])
def test_a_vibration_is_found_with_its_aliases_size_and_direction(
    frequency: float, alias: float, amplitude: float
) -> None:
    (line,) = find_lines(TIME_S, wander(1) + swing(frequency, amplitude), LIT)
    assert line.frequency_hz == pytest.approx(alias, abs=0.03)
    assert line.amplitude_mm == pytest.approx(amplitude, abs=5 * line.sigma_mm + 0.002)
    assert line.direction_deg == pytest.approx(np.degrees(np.arctan2(0.6, 0.8)), abs=6)
    assert line.p_value < 1e-4
    assert line.explained_by == ("probe_vibration",)


@pytest.mark.parametrize("seed", [0, 3, 9])
def test_frequency_and_size_of_a_swing_just_above_the_drift_are_within_their_sigma(seed: int) -> None:
    """One of .15 mm at 1.785 Hz beside a drift at .61 Hz was told as .095 ± .0015 mm at 1.896 ± .010 Hz."""
    time_s, random = np.arange(80) / RATE, np.random.default_rng(seed)
    noise, phase = random.standard_normal((80, 2)), random.uniform(0, 6)
    drift = 0.5 * np.sin(2 * np.pi * 0.61 * time_s[:, None] + np.array([0.3, 2.0]))
    swung = 0.15 * np.sin(2 * np.pi * 1.785 * time_s + phase)[:, None] * np.array([1.0, 0.0])
    (line,) = find_lines(time_s, drift + swung + 0.003 * noise, np.arange(80) % 2 == 1)
    assert line.frequency_hz == pytest.approx(1.785, abs=2.5 * line.frequency_sigma_hz)
    assert line.amplitude_mm == pytest.approx(0.15, abs=2.5 * line.sigma_mm)
    assert max(line.frequency_sigma_hz / 1.785, line.sigma_mm / 0.15) < 0.15


def test_a_line_in_laser_pictures_only_is_the_sheets() -> None:
    lines = find_lines(TIME_S, wander(2) + swing(5.3, 0.2) * ~LIT[:, None], LIT)
    assert lines
    assert lines[0].frequency_hz == pytest.approx(5.3, abs=0.03)
    assert lines[0].explained_by == ("laser_rocking",)
    assert lines[0].laser_mm == pytest.approx(0.2, abs=0.02)
    assert lines[0].lit_mm < 0.01


@pytest.mark.parametrize(
    ("lit_mm", "laser_mm", "causes"),
    [
        # The lights' image of a sheet that rocks at 1.7 Hz was named a vibration of the camera at 6.67 Hz.
        (0.0004, 0.0084, ("probe_vibration", "laser_rocking")),
        (0.009, 0.008, ("probe_vibration", "laser_rocking")),
        (0.03, 0.032, ("probe_vibration",)),
        (0.001, 0.03, ("laser_rocking",)),
        (0.1, 0.2, ("probe_vibration", "laser_rocking")),
    ],
)
def test_a_line_too_small_to_be_seen_in_lit_pictures_may_be_the_sheets(
    lit_mm: float, laser_mm: float, causes: tuple[str, ...]
) -> None:
    line = Line(6.67, laser_mm, 0.0007, 3.0, 5e-12, lit_mm, laser_mm, 0.0057, 0.016)
    assert line.explained_by == causes


def test_with_the_laser_always_on_the_two_cannot_be_distinguished() -> None:
    lines = find_lines(TIME_S, wander(3) + swing(5.3, 0.1), np.ones(len(TIME_S), bool))
    assert [line.explained_by for line in lines] == [("probe_vibration", "laser_rocking")]


def test_too_few_pictures_give_no_result() -> None:
    assert find_lines(TIME_S[:20], wander(4)[:20] + swing(5.3, 1.0)[:20], LIT[:20]) == ()


@pytest.mark.parametrize("every", [3, 4, 10, 30, None])
def test_an_offset_between_lit_and_laser_pictures_neither_makes_nor_hides_a_vibration(
    every: int | None,
) -> None:
    """A sound probe was a class of vibration and rocking sheet, .019 mm at the rhythm of its lights.

    When all frequencies of the rhythm of the lights were excluded, a swing of .05 mm was lost. These are a
    quarter of the frequencies if every tenth picture is lit, and all of them with an irregular rhythm.
    """
    random = np.random.default_rng(5)
    lit = random.random(len(TIME_S)) < 0.5 if every is None else np.arange(len(TIME_S)) % every == every - 1
    rolled = 0.3 * np.sin(0.6 * TIME_S)
    aside = 0.1 * lit[:, None] * np.stack([np.cos(rolled), np.sin(rolled)], 1)
    assert find_lines(TIME_S, wander(5) + aside, lit) == ()
    (line,) = find_lines(TIME_S, wander(5) + aside + swing(6.3, 0.05), lit)
    assert line.frequency_hz == pytest.approx(6.3, abs=0.03)
    assert line.amplitude_mm == pytest.approx(0.05, abs=5 * line.sigma_mm)


@pytest.mark.parametrize("frequency", [9.3, 10.0])
def test_the_size_of_a_swing_in_the_rhythm_of_the_lights_is_about_right(frequency: float) -> None:
    """With every third picture lit, a swing at a third of the frame rate was not found."""
    (line,) = find_lines(TIME_S, wander(6) + swing(frequency, 0.2), np.arange(len(TIME_S)) % 3 == 0)
    assert line.frequency_hz == pytest.approx(frequency, abs=0.05)
    assert line.amplitude_mm == pytest.approx(0.2, abs=0.02)


def test_too_few_pictures_that_show_the_position_make_no_line_and_no_error():
    """Two waves of the sheet left few pictures that did: the diagnosis ended with "SVD did not converge"."""
    shown = np.arange(len(TIME_S)) % 10 == 0
    assert find_lines(TIME_S, wander(1) + swing(5.3, 0.1), LIT, shown) == ()
