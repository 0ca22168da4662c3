"""Scale, delay and play of the encoder are estimated within their σ, where the motion allows it."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from stages.diagnose.travel.events import _strongest, with_events
from stages.diagnose.travel.evidence import TravelEstimate, _estimates, _other_courses
from stages.diagnose.travel.left_over import left_over, strongest_stretch
from stages.diagnose.travel.model import EventKind, fitted
from stages.diagnose.travel.noise import DriftNoise, whitened_fit
from stages.diagnose.travel.sight import quantum_mm, readings_at
from stages.diagnose.travel.solve import DELAY, PLAY, SCALE
from stages.diagnose.travel.steps import steps_found
from tests.travel_cases import read, seen

STATED = 0.002


def estimates(seed: int, reverses: bool = True, **faults: float) -> dict[str, TravelEstimate]:
    encoder = read(reverses, **faults)  # type: ignore[arg-type]
    fit = with_events(seen(np.random.default_rng(seed), reverses), encoder)
    return {e.effect: e for e in _estimates("gauge", fit, STATED, quantum_mm(encoder))}


@pytest.mark.parametrize(
    ("name", "fault", "size"),
    [
        ("encoder_scale", "scale", 0.02),
        ("encoder_scale", "scale", -0.015),
        ("time_offset", "delay_s", 0.02),
        ("time_offset", "delay_s", -0.06),
        ("encoder_backlash", "play_mm", 0.5),
        ("encoder_backlash", "play_mm", 2.0),
    ],
)
def test_a_fault_is_found_and_nothing_else(name: str, fault: str, size: float) -> None:
    found = estimates(1, **{fault: size})
    assert found[name].value == pytest.approx(size, abs=4 * found[name].sigma)
    assert found[name].p_value < 1e-5
    assert all(e.p_value > 1e-3 for e in found.values() if e.effect != name)


def test_errors_have_the_stated_size() -> None:
    true = np.array([0.003, 0.01, 0.4])
    random, scores = np.random.default_rng(2), []
    # Frames are stamped to about a millisecond, readings to half their quantum.
    allowed = np.array([0.0, 1e-3, 0.01])
    encoder = read(scale=true[0], delay_s=true[1], play_mm=true[2])
    for _ in range(16):
        fit = with_events(seen(random), encoder)
        scores.append(
            (fit.values[[SCALE, DELAY, PLAY]] - true) / np.hypot(fit.sigma[[SCALE, DELAY, PLAY]], allowed)
        )
    assert np.all(np.sqrt(np.mean(np.square(scores), axis=0)) < 1.5)
    assert np.all(np.abs(np.mean(scores, axis=0)) < 0.8)


@pytest.mark.parametrize("reverses", [True, False])
def test_a_sound_encoder_shows_no_fault(reverses: bool) -> None:
    smallest = [min(e.p_value for e in estimates(seed, reverses).values()) for seed in range(16)]
    assert min(smallest) > 1e-4


def test_without_a_reversal_play_cannot_be_determined() -> None:
    found = estimates(3, reverses=False, play_mm=1.0)
    assert not np.isfinite(found["encoder_backlash"].sigma)
    assert not np.isfinite(found["encoder_backlash"].detectable)
    assert all(e.p_value > 1e-3 for e in found.values())


def test_at_one_speed_forth_and_back_delay_and_play_cannot_be_separated() -> None:
    sight = seen(np.random.default_rng(4), False)
    back = np.where(sight.time_s < 4, 20 * sight.time_s, 160 - 20 * sight.time_s)
    encoder = read(False)
    steady = np.where(encoder.time_s < 4, 20 * encoder.time_s, 160 - 20 * encoder.time_s)
    turning = replace(encoder, distance_mm=steady)
    fit = with_events(replace(sight, distance_mm=back), turning)
    found = {e.effect: e for e in _estimates("gauge", fit, STATED, quantum_mm(encoder))}
    alike = {other for other, _ in found["time_offset"].alike}
    assert "encoder_backlash" in alike or not np.isfinite(found["time_offset"].sigma)


def test_the_readings_have_their_quantum_and_ends() -> None:
    encoder = read(False)
    assert quantum_mm(encoder) == pytest.approx(0.05)
    beyond = readings_at(encoder, np.array([encoder.time_s[-1] + 0.1]))
    assert beyond[0] - encoder.distance_mm[-1] == pytest.approx(1.7, abs=0.4)


def test_an_impossible_delay_is_not_a_finding() -> None:
    encoder = read(False)
    fit = with_events(seen(np.random.default_rng(5), False), encoder)
    values = fit.values.copy()

    def p_value(delay_s: float) -> float:
        values[DELAY] = delay_s
        made = _estimates("gauge", replace(fit, values=values), STATED, quantum_mm(encoder))
        return next(e.p_value for e in made if e.effect == "time_offset")

    assert p_value(-0.9) < 1e-3
    assert p_value(-1.7) == 1.0


@pytest.mark.parametrize(
    ("name", "fault", "size", "column"),
    [("encoder_scale", "scale", 0.02, SCALE), ("encoder_backlash", "play_mm", 2.0, PLAY)],
)
def test_an_effect_missing_from_the_library_is_neither_fitted_nor_taken_for_noise(name, fault, size, column):
    placed = replace(seen(np.random.default_rng(6), drift_mm=0.0), placed=True)
    faulty, left = read(**{fault: size}), {}
    for without in ((), (name, "time_offset", "encoder_slip")):
        fit = with_events(placed, faulty, without)
        left[without] = left_over(fit, steps_found(fit, faulty), quantum_mm(faulty))
    assert [one is not None for one in left.values()] == [False, True]
    assert fit.values[column] == 0.0
    assert not np.isfinite(fit.sigma[column])
    assert all(e.kind is not EventKind.STEP for e in fit.events)


def test_each_picture_is_predicted_by_all_others_within_its_noise():
    fit = with_events(seen(np.random.default_rng(7)), read(scale=0.01))
    missed, sigma = fit.left_out_mm
    assert len(missed) == len(fit.sight.time_s)
    assert 0.7 < np.sqrt(np.mean((missed / sigma) ** 2)) < 1.3
    assert np.sqrt(np.mean(fit.stated_mm**2)) > 10 * np.sqrt(np.mean(missed**2))


@pytest.mark.parametrize("faults", [{}, {"delay_s": 0.02}, {"play_mm": 0.5}])
def test_the_residual_with_right_effects_is_noise_and_no_other_course_fits_as_well(faults):
    fit = with_events(seen(np.random.default_rng(3)), read(**faults))
    assert fit.fits_p > 0.05
    assert all(e.other_courses < 1e-6 for e in _estimates("gauge", fit, STATED, 0.0) if e.p_value < 1e-5)


def test_the_residual_with_wrong_effects_is_not_noise_though_their_size_is_sure():
    without = ("time_offset", "encoder_slip")
    fit = with_events(seen(np.random.default_rng(8)), read(delay_s=0.06), without)
    play = next(e for e in _estimates("gauge", fit, STATED, 0.0) if e.effect == "encoder_backlash")
    assert play.p_value < 1e-5
    assert fit.fits_p < 1e-3


def test_another_course_fits_better_if_the_column_of_the_play_is_wrong():
    fit = with_events(seen(np.random.default_rng(3)), read(play_mm=0.5))
    columns = fit.columns.copy()
    columns[:, PLAY] = np.random.default_rng(9).standard_normal(len(columns))
    assert _other_courses(fit, PLAY) < 1e-6
    left = fit.whitened.residual + (fit.columns - columns) @ fit.whitened.estimate
    wrong = replace(fit, columns=columns, whitened=replace(fit.whitened, residual=left))
    assert _other_courses(wrong, PLAY) > 1


def test_stored_evidence_grows_linearly_with_the_length_of_the_run() -> None:
    """For 3000 pictures a matrix of 72 MB was stored."""
    fit = fitted(seen(np.random.default_rng(4)), read(scale=0.01), (), None)
    count = len(fit.sight.time_s)
    arrays = [a for a in (*vars(fit.whitened).values(), fit.whitened.precision.factor) if hasattr(a, "size")]
    assert sum(a.size for a in arrays) < 20 * count


def test_a_random_walk_with_white_noise_is_weighted_by_its_whole_covariance() -> None:
    random = np.random.default_rng(5)
    # The probe stands still in between.
    path_mm = np.cumsum(np.maximum(random.normal(0.3, 0.5, 40), 0.0))
    walk = np.minimum(path_mm[:, None], path_mm) - path_mm[0]
    covariance = 0.02**2 * np.eye(40) + 0.01**2 * walk
    precision = DriftNoise(0.02, 0.01).precision(path_mm)
    assert precision.times(covariance) == pytest.approx(np.eye(40), abs=1e-9)
    fit = whitened_fit(random.normal(0, 0.02, 40), random.normal(size=(40, 2)), precision)
    inverse, columns = np.linalg.inv(covariance), fit.weighted_columns
    beyond = inverse - columns @ fit.inverse @ columns.T
    information = fit.information(np.eye(40))
    assert information == pytest.approx(np.diag(beyond), rel=1e-6)


def test_the_strongest_stretch_is_the_best_of_all_stretches() -> None:
    random, count = np.random.default_rng(6), 300
    off = np.zeros(count)
    off[120:190] = 0.03
    precision = DriftNoise(0.02, 0.001).precision(np.arange(count) * 0.5)
    rest = whitened_fit(off + random.normal(0, 0.02, count), np.ones((count, 1)), precision)
    found = strongest_stretch(rest)
    each = [(np.arange(count) >= a) & (np.arange(count) < b) for a in range(1, count) for b in (found.end,)]
    each += [
        (np.arange(count) >= a) & (np.arange(count) < b)
        for a in (found.first,)
        for b in range(a + 1, count + 1)
    ]
    value, gain = rest.gain(np.stack(each, 1).astype(float))
    assert found.gain == pytest.approx(gain.max())
    assert found.size_mm == pytest.approx(value[np.argmax(gain)])
    assert abs(found.first - 120) < 5
    assert abs(found.end - 190) < 5


def test_memory_of_the_search_for_events_grows_linearly_with_the_length_of_the_run() -> None:
    """For 3000 pictures the matrices of all steps and of all misplaced pictures took 72 MB and more."""
    count = 2400
    fit = fitted(seen(np.random.default_rng(4)), read(scale=0.01), (), None)
    way = np.linspace(0, 2000.0, count)
    sight = replace(fit.sight, frame=np.arange(count), time_s=way / 20, distance_mm=way, path_mm=way)
    noise, columns = np.random.default_rng(5).standard_normal(count), np.stack([np.ones(count), way], 1)
    long = replace(
        fit, sight=sight, difference_mm=noise,
        whitened=whitened_fit(noise, columns, fit.noise.precision(way)),
    )  # fmt: skip
    tracemalloc.start()
    event, score, tried = _strongest(long)
    missed, _ = long.left_out_mm
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert (tried, len(missed)) == (2 * count, count)
    assert score > 0
    assert event.place > 0
    assert most < 8 * count**2
