"""Steps of the encoder reading are found; drift, misplaced pictures and lost time are not taken for slips."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.recording.base import Encoder
from stages.diagnose.travel.events import with_events
from stages.diagnose.travel.model import EventKind
from stages.diagnose.travel.sight import Sight
from stages.diagnose.travel.solve import PLAY
from stages.diagnose.travel.steps import StepFound, steps_found
from tests.travel_cases import QUANTUM_MM, read, seen, way

BELIEVED = 1e-5


def slips(sight: Sight, encoder: Encoder) -> list[StepFound]:
    fit = with_events(sight, encoder)
    return [s for s in steps_found(fit, encoder) if s.p_value < BELIEVED and not s.rivals]


@pytest.mark.parametrize("drift_mm", [0.0, 0.004, 0.02])
@pytest.mark.parametrize("reverses", [True, False])
def test_nothing_is_found_where_nothing_slips(drift_mm: float, reverses: bool) -> None:
    random = np.random.default_rng(1)
    found = [slips(seen(random, reverses, drift_mm), read(reverses)) for _ in range(12)]
    assert sum(map(len, found)) == 0


def test_a_smooth_drift_of_visual_distances_is_not_a_slip() -> None:
    random = np.random.default_rng(2)
    sight = seen(random, False)
    wavy = replace(sight, distance_mm=sight.distance_mm + 0.1 * np.tanh((sight.time_s - 4) / 0.4))
    assert slips(wavy, read(False)) == []


@pytest.mark.parametrize("reverses", [True, False])
@pytest.mark.parametrize("gain_mm", [-20.0, -0.5, 0.4, 3.0])
def test_a_slip_is_found_with_size_and_time(reverses: bool, gain_mm: float) -> None:
    for seed in range(3):
        sight = seen(np.random.default_rng(seed), reverses)
        (found,) = slips(sight, read(reverses, slips=((2.303, gain_mm),)))
        assert found.gain_mm == pytest.approx(gain_mm, abs=4 * found.sigma_mm + QUANTUM_MM / 2)
        assert found.sigma_mm < 0.1
        assert found.time_s == pytest.approx(2.303, abs=0.07 if abs(gain_mm) < 1 else 0.011)
        assert found.time_s == pytest.approx(2.303, abs=4 * found.time_sigma_s)
        assert found.time_sigma_s < 0.02


@pytest.mark.parametrize(("lasts_s", "gain_mm"), [(0.12, 2.0), (0.25, -3.4)])
def test_a_wheel_that_slips_for_a_while_gives_one_slip(lasts_s: float, gain_mm: float) -> None:
    sight, encoder = seen(np.random.default_rng(0), False), read(False)
    part = np.clip((encoder.time_s - 3.0) / lasts_s, 0.0, 1.0)
    (found,) = slips(sight, replace(encoder, distance_mm=encoder.distance_mm + gain_mm * part))
    assert found.gain_mm == pytest.approx(gain_mm, abs=4 * found.sigma_mm)
    assert found.sigma_mm < 0.1
    assert found.time_s == pytest.approx(3.0 + lasts_s / 2, abs=3 * found.time_sigma_s)
    assert found.lasting_s == pytest.approx(lasts_s, abs=0.07)
    assert all(a.confirmation.agrees for a in found.agreements)
    assert found.agreements


def test_two_slips_of_opposite_sign_are_two_slips() -> None:
    sight = seen(np.random.default_rng(3))
    found = slips(sight, read(slips=((2.0, 8.0), (4.5, -5.0))))
    assert sorted(round(s.gain_mm) for s in found) == [-5, 8]


def test_a_misplaced_picture_is_not_a_slip() -> None:
    sight = seen(np.random.default_rng(4))
    stray = sight.distance_mm.copy()
    stray[40] += 2.0
    fit = with_events(replace(sight, distance_mm=stray), read())
    assert [e.kind for e in fit.events] == [EventKind.OUTLIER]


@pytest.mark.parametrize(("stray_at", "slips_at"), [(-1, -5), (0, 4)])
def test_a_slip_beside_a_misplaced_picture_at_the_end_ends_there(stray_at: int, slips_at: int) -> None:
    sight = seen(np.random.default_rng(7), False)
    few = replace(
        sight, **{k: v[:40] for k, v in vars(sight).items() if np.shape(v)[:1] == sight.time_s.shape}
    )
    distance_mm = few.distance_mm.copy()
    distance_mm[stray_at] += 2.0
    encoder = read(False, slips=((float(few.time_s[slips_at]) + 0.001, 3.0),))
    events = with_events(replace(few, distance_mm=distance_mm), encoder).events
    assert events
    assert all(e.place - e.during > 0 and e.place < 40 for e in events if e.kind is EventKind.STEP)


@pytest.mark.parametrize("placed", [True, False])
@pytest.mark.parametrize(("strays", "count"), [(slice(-3, None), 3), (slice(0, 3), 3)])
def test_misplaced_pictures_at_an_end_are_not_a_sure_slip(placed: bool, strays: slice, count: int) -> None:
    sight = seen(np.random.default_rng(10), drift_mm=0.001)
    distance_mm = sight.distance_mm.copy()
    distance_mm[strays] += 1.0
    wrong = replace(sight, distance_mm=distance_mm, placed=placed)
    (found,) = steps_found(with_events(wrong, read()), read())
    assert EventKind.OUTLIER in found.rivals
    assert f"{count} misplaced pictures" in found.doubt
    assert f"{found.gain_mm:+.2f} mm" in found.doubt
    assert f"At {found.time_s:.2f} s" in found.doubt
    assert "they look the same here: record the passage again, slowly" in found.doubt


def test_a_slip_in_the_last_pictures_is_sure_where_the_reading_itself_jumps() -> None:
    sight = seen(np.random.default_rng(10), drift_mm=0.001)
    (found,) = slips(sight, read(slips=((7.78, 1.36),)))
    assert found.doubt == ""
    assert found.gain_mm == pytest.approx(1.36, abs=0.1)
    assert found.time_s == pytest.approx(7.78, abs=0.05)


def test_missing_pictures_at_constant_speed_are_not_called_a_slip() -> None:
    sight, encoder = seen(np.random.default_rng(5), False), read(False)
    noise = sight.distance_mm - way(sight.time_s, False)
    late = sight.time_s + np.where(sight.time_s > 4, 2 / 30, 0.0)
    missing = replace(sight, distance_mm=18.0 * late + noise)
    steady = replace(encoder, distance_mm=QUANTUM_MM * np.round(18.0 * encoder.time_s / QUANTUM_MM))
    found = steps_found(with_events(missing, steady), steady)
    assert [EventKind.LOST_TIME in s.rivals for s in found] == [True]


def test_a_slip_of_the_size_of_missing_pictures_is_recognised_by_the_jump_of_the_reading() -> None:
    sight, encoder = seen(np.random.default_rng(7), False), read(False)
    noise = sight.distance_mm - way(sight.time_s, False)
    even = replace(sight, distance_mm=18.0 * sight.time_s + noise)
    reading = 18.0 * encoder.time_s + np.where(encoder.time_s > 4.002, -18.0 * 2 / 30, 0.0)
    slipped = replace(encoder, distance_mm=QUANTUM_MM * np.round(reading / QUANTUM_MM))
    (found,) = slips(even, slipped)
    assert found.gain_mm == pytest.approx(-1.2, abs=0.1)


def test_a_slip_does_not_change_delay_and_scale() -> None:
    sight = seen(np.random.default_rng(6))
    plain, slipped = (with_events(sight, read(slips=s)) for s in ((), ((3.0, 5.0),)))
    np.testing.assert_allclose(
        plain.values[1:4], slipped.values[1:4], atol=3 * plain.sigma[1:4].max(), rtol=0
    )
    assert np.all(np.abs(plain.values[1:4] - slipped.values[1:4]) < 3 * slipped.sigma[1:4])


def test_if_all_readings_are_rounded_the_same_way_the_sigma_of_a_size_includes_it():
    sizes = (0.33, 0.36, 0.39, 0.42, 0.45, 0.48)
    errors = []
    for seed, size in enumerate(sizes):
        sight = seen(np.random.default_rng(seed), False, drift_mm=0.002, every=3)
        # At 15 mm/s every picture comes 30 counts after the previous one.
        even = replace(sight, distance_mm=sight.distance_mm - way(sight.time_s, False) + 15.0 * sight.time_s)
        reading = 15.0 * read(False).time_s + np.where(read(False).time_s > 1.05, -size, 0.0)
        stepped = QUANTUM_MM * np.round(reading / QUANTUM_MM)
        (found,) = steps_found(with_events(even, replace(read(False), distance_mm=stepped)), read(False))
        errors.append((found.gain_mm + size, found.sigma_mm))
    off, sigma = np.array(errors).T
    assert np.max(np.abs(off)) > 0.01
    assert np.sqrt(np.mean((off / sigma) ** 2)) < 1.3
    assert np.all(np.abs(off) < 2.5 * sigma)


@pytest.mark.parametrize(("lasts_s", "at_s", "gain_mm"), [(0.13, 5.13, -1.7), (0.03, 3.64, 0.64)])
def test_a_slip_where_the_probe_turns_back_is_not_play(lasts_s: float, at_s: float, gain_mm: float) -> None:
    encoder = read()
    part = np.clip((encoder.time_s - at_s) / lasts_s + 0.5, 0.0, 1.0)
    slipped = replace(encoder, distance_mm=encoder.distance_mm + gain_mm * part)
    for seed in range(3):
        fit = with_events(seen(np.random.default_rng(seed), drift_mm=0.002, every=3), slipped)
        assert fit.values[PLAY] == 0.0
        (found,) = steps_found(fit, slipped)
        assert found.gain_mm == pytest.approx(gain_mm, abs=4 * found.sigma_mm)


def test_what_a_slow_slip_gains_at_its_ends_counts_too() -> None:
    errors = []
    for case in (3, 5, 7):
        random = np.random.default_rng([5, case])
        reverses, gain_mm = bool(random.integers(2)), float(np.exp(random.uniform(*np.log([0.3, 0.8]))))
        gain_mm *= random.choice([-1, 1])
        _, at_s, encoder = random.integers(6), random.uniform(1.5, 5.5), read(reverses)
        part = np.clip((encoder.time_s - at_s) / 0.4, 0.0, 1.0)
        slipped = replace(encoder, distance_mm=encoder.distance_mm + gain_mm * part)
        sight = seen(np.random.default_rng(1000 + case), reverses)
        (found,) = steps_found(with_events(sight, slipped), slipped)
        errors.append((found.gain_mm - gain_mm) / found.sigma_mm)
    assert np.sqrt(np.mean(np.square(errors))) < 1.2
