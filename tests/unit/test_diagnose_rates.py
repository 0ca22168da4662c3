"""The speed at which the wall passes the camera, from poses of frames that are far apart in time."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.signal import savgol_filter

from pipeline.geometry.rigid import rotation_from_vector
from pipeline.instrument.probe import Probe
from pipeline.physics.effect import CourseKind
from stages.diagnose.effects.base import ImagePoints
from stages.diagnose.effects.courses import Coursed
from stages.diagnose.effects.library import LIBRARY, ring_shift_px
from stages.diagnose.gauge.confirm import lost_motion
from stages.diagnose.gauge.points import SHARP, Moving, moved, rates, smoothed
from stages.diagnose.gauge.run import Term


def swaying(time_s: np.ndarray) -> np.ndarray:
    """Return poses (N, 4, 4) that move on, sway sideways and roll."""
    T = np.tile(np.eye(4), (len(time_s), 1, 1))
    T[:, :3, 3] = np.stack(
        [1.5 * np.sin(3.5 * time_s), np.cos(2.0 * time_s), 20 * time_s + 2 * np.sin(time_s)], 1
    )
    turn = np.stack([0.02 * np.sin(2 * time_s), 0.03 * np.cos(1.5 * time_s), 0.6 * np.sin(1.2 * time_s)], 1)
    T[:, :3, :3] = rotation_from_vector(turn)
    return T


def passing_exactly(time_s: np.ndarray, xyz_c: np.ndarray) -> np.ndarray:
    """Return d/dt of wall points' places in C by a step in time so short that its error is negligible."""
    step = 1e-4
    T, before, after = (swaying(time_s + s) for s in (0.0, -step, step))
    xyz_p = np.einsum("nij,nj->ni", T[:, :3, :3], xyz_c) + T[:, :3, 3]
    seen = [
        np.einsum("nji,nj->ni", at[:, :3, :3], xyz_p - at[:, :3, 3]) for at in (before, after)
    ]  # fmt: skip
    return (seen[1] - seen[0]) / (2 * step)


@pytest.mark.parametrize("rate_hz", [10.0, 30.0])
@pytest.mark.parametrize("lost", [(), (20, 21, 40)])
def test_the_wall_passes_as_fast_as_the_poses_move(rate_hz: float, lost: tuple[int, ...]) -> None:
    time_s = np.delete(np.arange(80) / rate_hz, lost)
    xyz_c = np.random.default_rng(1).normal(0, 30, (len(time_s), 3))
    found = Moving.of(swaying(time_s), time_s).passing_mm_s(np.arange(len(time_s)), xyz_c)
    wrong = (found - passing_exactly(time_s, xyz_c))[4:-4]
    assert np.sqrt(np.mean(wrong**2, axis=0)) == pytest.approx(np.zeros(3), abs=0.02)


def smoothed_differences(value: np.ndarray, time_s: np.ndarray) -> np.ndarray:
    return np.asarray(savgol_filter(differences(value, time_s), 9, 2, axis=0))


def differences(value: np.ndarray, time_s: np.ndarray) -> np.ndarray:
    return np.asarray(np.gradient(value, time_s, axis=0))


def as_adjusted(value: np.ndarray, time_s: np.ndarray) -> np.ndarray:
    return rates(value, time_s, SHARP)


def of_gauge(value: np.ndarray, time_s: np.ndarray) -> np.ndarray:
    return rates(value, time_s, smoothed(time_s))


# Rates of a gauge run and of an inspection, and the errors that they must not exceed.
EACH = pytest.mark.parametrize(
    ("found", "usual"), [(of_gauge, smoothed_differences), (as_adjusted, differences)]
)


def kept(found: np.ndarray, true: np.ndarray) -> float:
    inside = slice(12, -12)
    return float(np.sum((found * true)[inside]) / np.sum(true[inside] ** 2))


@EACH
@pytest.mark.parametrize(("rate_hz", "up_to_hz"), [(10.0, 1.0), (30.0, 5.0), (60.0, 5.0)])
def test_rates_lose_no_more_of_a_sway_than_differences_do(
    found: Any, usual: Any, rate_hz: float, up_to_hz: float
) -> None:
    """A spline kept half of a sway of 3 Hz: a rolling shutter estimated from it was twice too large."""
    time_s = np.arange(12 * rate_hz) / rate_hz
    for sway_hz in np.linspace(0.5, up_to_hz, 7):
        turn = 2 * np.pi * sway_hz * time_s[:, None]
        way, true = np.sin(turn) / (2 * np.pi * sway_hz), np.cos(turn)
        assert abs(kept(found(way, time_s), true) - 1) < abs(kept(usual(way, time_s), true) - 1) + 1e-3


@pytest.mark.parametrize(("rate_hz", "sway_hz"), [(10.0, 0.6), (10.0, 1.0), (10.0, 1.5), (30.0, 3.0)])
def test_rates_of_an_inspection_keep_a_sway(rate_hz: float, sway_hz: float) -> None:
    """Differences made a rolling shutter 16 % too large at 1.5 Hz and 10 frames/s, beyond any σ."""
    time_s = np.arange(12 * rate_hz) / rate_hz
    turn = 2 * np.pi * sway_hz * time_s[:, None]
    found = as_adjusted(np.sin(turn) / (2 * np.pi * sway_hz), time_s)
    assert kept(found, np.cos(turn)) == pytest.approx(1.0, abs=0.035)


@pytest.mark.parametrize(
    ("found", "usual", "most"), [(of_gauge, smoothed_differences, 1.1), (as_adjusted, differences, 1.4)]
)
@pytest.mark.parametrize("rate_hz", [5.0, 10.0, 30.0, 60.0])
def test_a_slow_sway_is_estimated_as_well_as_by_differences_with_noise_of_poses(
    found: Any, usual: Any, most: float, rate_hz: float
) -> None:
    time_s = np.arange(600) / rate_hz
    turn = 2 * np.pi * 0.6 * time_s[:, None]
    way = 0.5 * np.sin(turn) + np.random.default_rng(2).normal(0, 0.01, (600, 3))
    true = 0.5 * 2 * np.pi * 0.6 * np.cos(turn)
    wrong, before = (np.std((rate(way, time_s) - true)[12:-12]) for rate in (found, usual))
    assert wrong < most * before


@pytest.mark.parametrize("rate_hz", [3.0, 5.0, 10.0, 30.0])
def test_noise_of_poses_gives_at_most_a_tenth_of_a_mm_a_second(rate_hz: float) -> None:
    time_s = np.arange(600) / rate_hz
    still = np.random.default_rng(2).normal(0, 0.01, (600, 3))
    assert np.std(of_gauge(still, time_s)) < min(0.01 * rate_hz, 0.1)


@pytest.mark.parametrize("found", [of_gauge, as_adjusted])
@pytest.mark.parametrize("rate_hz", [10.0, 30.0])
def test_a_probe_that_speeds_up_has_its_true_speed_also_at_both_ends(found: Any, rate_hz: float) -> None:
    time_s = np.arange(4 * rate_hz) / rate_hz
    speed = found((10 * time_s + 25 * time_s**2)[:, None], time_s)
    assert speed[:, 0] == pytest.approx(10 + 50 * time_s, abs=1e-6)


@pytest.mark.parametrize("apart_s", [0.002, 0.01])
def test_rates_of_frames_in_close_pairs_equal_those_of_even_ones(apart_s: float) -> None:
    pair_s = np.arange(180) / 15
    time_s = np.sort(np.concatenate([pair_s, pair_s + apart_s]))
    way = np.sin(2 * np.pi * time_s[:, None])
    wrong = of_gauge(way, time_s)[:, 0] / (2 * np.pi) - np.cos(2 * np.pi * time_s)
    assert np.abs(wrong[12:-12]).max() < 0.02
    noise = np.random.default_rng(2).normal(0, 0.01, (len(time_s), 3))
    assert np.std(of_gauge(noise, time_s)[12:-12]) < 0.12


@pytest.mark.parametrize("count", [1, 2, 4])
def test_the_rate_of_few_frames_is_that_of_their_polynomial(count: int) -> None:
    time_s = np.arange(count) / 10
    expected = np.full(count, 3.0 if count > 1 else 0)
    assert of_gauge(3 * time_s[:, None], time_s)[:, 0] == pytest.approx(expected)


def test_unknown_poses_or_equal_times_end_no_diagnosis() -> None:
    time_s = np.arange(40) / 10
    T = swaying(time_s)
    T[7, :3, 3] = np.nan
    moving = Moving.of(T, time_s)
    assert np.isfinite(moving.speed_mm_s[13:]).all()
    time_s[20] = time_s[19]
    assert np.isfinite(Moving.of(swaying(time_s), time_s).speed_mm_s).all()


@pytest.mark.parametrize("stop_s", [2.0, 3.5])
def test_a_probe_that_stops_does_not_go_back(stop_s: float) -> None:
    """Smoothed rates of a sudden stop went back a little, whose sign was taken for a reversal."""
    time_s = np.arange(120) / 30
    T = np.tile(np.eye(4), (120, 1, 1))
    T[:, 2, 3] = 20 * np.minimum(time_s, stop_s)
    speed = Moving.of(T, time_s).speed_mm_s
    assert speed.min() < -1
    course = Coursed(LIBRARY["laser_tilt"], (), CourseKind.REVERSAL)
    points: Any = SimpleNamespace(time_s=time_s, camera_distance_mm=T[:, 2, 3], speed_mm_s=speed)
    (factor,), _, _ = course.factored(points, ())
    assert set(factor) == {0.0, 1.0}


def signs(z_mm: np.ndarray, time_s: np.ndarray) -> np.ndarray:
    """Return the sign of the motion, as used for reversals, for a probe at such places."""
    T = np.tile(np.eye(4), (len(time_s), 1, 1))
    T[:, 2, 3] = z_mm
    speed = Moving.of(T, time_s).speed_mm_s
    points: Any = SimpleNamespace(time_s=time_s, camera_distance_mm=z_mm, speed_mm_s=speed)
    ((factor,), _, _) = Coursed(LIBRARY["laser_tilt"], (), CourseKind.REVERSAL).factored(points, ())
    return np.asarray(factor)


@pytest.mark.parametrize(("forward", "back"), [(20.0, 250.0), (4.0, 45.0)])
def test_a_probe_that_is_withdrawn_quickly_moved_forward_before(forward: float, back: float) -> None:
    time_s = np.arange(600) / 30
    found = signs(np.cumsum(np.where(time_s < 15, forward, -back)) / 30, time_s)
    assert np.mean(found[:430] == 1) == 1
    assert np.mean(found[470:] == -1) == 1


def test_a_jump_of_the_poses_does_not_count_as_a_standstill() -> None:
    time_s = np.arange(600) / 30
    found = signs(20 * time_s + 30 * (time_s > 10), time_s)
    assert np.mean(found == 1) > 0.95


def test_a_probe_that_stands_for_long_has_no_direction() -> None:
    time_s = np.arange(600) / 30
    noise = np.random.default_rng(2).normal(0, 0.01, 600)
    found = signs(20 * np.minimum(time_s, 8) + noise, time_s)
    assert np.mean(found[300:] == 0) > 0.95


@pytest.mark.parametrize(("sway_hz", "most"), [(0.6, 0.02), (2.0, 0.05), (3.0, 0.2), (5.3, 0.8)])
def test_sigma_of_a_rolling_shutter_includes_the_motion_lost_in_rates(
    real_probe: Probe, sway_hz: float, most: float
) -> None:
    """Estimated from a sway of 3 Hz, 16 ms were 31 ± .2 ms: now they are 18 ± 2 ms."""
    time_s = np.arange(300) / 30
    random = np.random.default_rng(3)
    T = np.tile(np.eye(4), (300, 1, 1))
    turn = 2 * np.pi * sway_hz * time_s
    T[:, 0, 3] = 0.3 * np.sin(turn) + random.normal(0, 0.002, 300)
    velocity = np.stack([0.3 * 2 * np.pi * sway_hz * np.cos(turn), 0 * turn, 0 * turn], 1)
    frame, angle = np.repeat(np.arange(300), 24), np.tile(np.radians(np.arange(0, 360, 15)), 300)
    outward = np.stack([np.cos(angle), np.sin(angle)], 1)
    normal = np.column_stack([outward, np.zeros(len(angle))])
    none = np.zeros(len(angle))
    still = ImagePoints(
        real_probe, frame, time_s[frame], real_probe.camera.centre_px + 300 * outward, 50 * normal, normal,
        np.tile([0.0, 0.0, 1.0], (len(angle), 1)), 0 * outward, none, True, none + 2, per_px_c=0.1 * normal,
    )  # fmt: skip
    rings = moved(still, Moving.of(T, time_s), outward)
    run: Any = SimpleNamespace(time_s=time_s, rings=SimpleNamespace(outward=outward))
    found: Any = SimpleNamespace(
        at=lambda _: SimpleNamespace(rings=rings), state=SimpleNamespace(T_pc=T)
    )  # fmt: skip
    shutter = Term(LIBRARY["rolling_shutter"], (), np.array([0.016]))
    true, kept = (
        ring_shift_px(shutter.model, p, (), shutter.amplitude)
        for p in (moved(still, Moving(0 * velocity, velocity, 0 * turn), outward), rings)
    )
    size, share = float(true @ kept / (kept @ kept)), lost_motion(run, found, shutter)
    assert share < most
    assert abs(size - 1) < 1.2 * share * size + 0.01
    assert lost_motion(run, found, Term(LIBRARY["baseline"], (), np.array([0.1]))) == 0
