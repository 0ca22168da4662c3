"""Stops, reversals, dropped and repeated frames, lost texture and slip are found, and no others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.arrays import Float
from pipeline.artefacts.measured import Trajectory
from pipeline.artefacts.motion import MotionEvent
from pipeline.geometry.axis import PipeAxis, axis_through, frames_at, straight_axis
from pipeline.recording.base import FrameTable
from stages.motion.events import find_events, warn_of_slips
from stages.motion.tracking.landmarks import TrackedPoses
from tests.quiet import quiet_context

FRAMES, RATE, STEP = 120, 30.0, 0.6


def events(
    z: Float,
    *,
    time_s: Float | None = None,
    slip: Float | None = None,
    lost: tuple[int, ...] = (),
    encoder: bool = True,
    axis: PipeAxis | None = None,
) -> dict[str, MotionEvent]:
    n = len(z)
    t = np.arange(n) / RATE if time_s is None else time_s
    number = 10 + np.arange(n)
    axis = straight_axis(-50, 200) if axis is None else axis
    T = np.tile(np.eye(4), (n, 1, 1))
    T[:, :3, 3] = frames_at(axis, z)[0]
    run = Trajectory(number, t, T, np.zeros((n, 6, 6)), axis, 50.0, 1.0, 0.0, 0.0, ())
    gone = np.zeros(n, bool)
    gone[list(lost)] = True
    tracks = TrackedPoses(np.arange(n), T, gone)
    table = FrameTable(number, t, np.array(["both"] * n))
    found = find_events(table, run, tracks, np.zeros(n) if slip is None else slip, encoder)
    assert [e.frame_from for e in found] == sorted(e.frame_from for e in found)
    assert len({e.kind for e in found}) == len(found), "each kind once"
    return {e.kind: e for e in found}


def steady(noise_mm: float = 0.005) -> Float:
    return STEP * np.arange(FRAMES) + noise_mm * np.random.default_rng(0).standard_normal(FRAMES)


def with_steps(step: Float) -> Float:
    return np.concatenate([[0.0], np.cumsum(step)])


def test_steady_motion_has_no_events() -> None:
    creep = 0.002 * np.cumsum(np.random.default_rng(1).standard_normal(FRAMES))
    assert events(steady(), slip=creep) == {}


def test_a_bend_of_more_than_a_right_angle_is_neither_stop_nor_reversal() -> None:
    turn = np.linspace(0, 2.5, 200)
    arc = 29.0 * np.stack([1 - np.cos(turn), 0 * turn, np.sin(turn)], -1)
    assert events(steady(), axis=axis_through(arc, np.array([1.0, 0, 0]), 0.0)) == {}


def test_a_stop_is_found() -> None:
    step = np.full(FRAMES - 1, STEP)
    step[40:60] = 0
    found = events(with_steps(step))
    assert set(found) == {"stop"}
    assert found["stop"].frame_from == pytest.approx(50, abs=2)
    assert found["stop"].size == pytest.approx(20 / RATE, abs=3 / RATE)


def test_a_reversal_is_found() -> None:
    step = np.full(FRAMES - 1, STEP)
    step[50:70] = -STEP
    found = events(with_steps(step))
    assert set(found) == {"reversal"}
    assert found["reversal"].size == pytest.approx(20 * STEP, abs=2 * STEP)
    assert found["reversal"].frame_from == pytest.approx(60, abs=2)


def test_a_run_that_is_driven_backwards_throughout_has_no_reversal() -> None:
    assert events(-steady()) == {}


def test_a_gap_in_the_clock_means_dropped_frames() -> None:
    t = np.arange(FRAMES) / RATE
    t[70:] += 3 / RATE
    found = events(STEP * RATE * t, time_s=t)
    assert set(found) == {"dropped_frames"}
    assert (found["dropped_frames"].frame_from, found["dropped_frames"].size) == (79, 3.0)


def test_the_same_picture_twice_is_a_repeated_frame() -> None:
    step = np.full(FRAMES - 1, STEP)
    step[30] = 0
    found = events(with_steps(step))
    assert set(found) == {"duplicated_frame"}
    assert found["duplicated_frame"].frame_from == 40


def test_lost_texture_is_reported_but_not_for_the_first_frame() -> None:
    found = events(steady(), lost=(0, 20, 21, 22))
    assert set(found) == {"texture_lost"}
    assert (found["texture_lost"].frame_from, found["texture_lost"].frame_to) == (30, 32)


@pytest.mark.parametrize(("encoder", "expected"), [(True, {"encoder_slip"}), (False, set())])
def test_slip_is_found_where_there_is_an_encoder(encoder: bool, expected: set[str]) -> None:
    slip = 0.001 * np.cumsum(np.random.default_rng(2).standard_normal(FRAMES))
    slip[60:] += 4.0
    found = events(steady(), slip=slip, encoder=encoder)
    assert set(found) == expected
    if encoder:
        assert found["encoder_slip"].size == pytest.approx(4.0, abs=0.1)
        assert found["encoder_slip"].frame_from == 69


def told_of(z: Float, slip: Float, scale_sigma: float, reading_sigma_mm: float = 0.015) -> list[str]:
    """Return the messages where the encoder slips against motion (N,), one step for each frame."""
    number, words = np.arange(len(z)), list[str]()
    T = np.tile(np.eye(4), (len(z), 1, 1))
    T[:, 2, 3] = z
    axis = straight_axis(min(z) - 50, max(z) + 50)
    run = Trajectory(number, number / RATE, T, np.zeros((len(z), 6, 6)), axis, 50.0, 1.0, 0.0, 0.0, ())
    table = FrameTable(number, number / RATE, np.full(len(z), "led"))
    found = find_events(table, run, TrackedPoses(number, T, np.zeros(len(z), bool)), slip, True)
    assert [e.kind for e in found if e.kind == "encoder_slip"]
    context = replace(quiet_context(), warn=words.append)
    warn_of_slips(found, run, slip, scale_sigma, reading_sigma_mm, context)
    return words


def hung(first: int, last: int, by_mm: float, frames: int = FRAMES) -> Float:
    return np.interp(np.arange(frames), [first, last], [0.0, by_mm])


@pytest.mark.parametrize("scale_sigma", [0.0, 0.002])
def test_an_encoder_that_stopped_counting_is_reported(scale_sigma: float) -> None:
    """Readings hung for the last quarter of a run without a message, which a σ of 0 suppressed."""
    words = told_of(steady(0.0), hung(89, 119, -18.0), scale_sigma)
    assert len(words) == 1
    assert "disagree by 18.0 mm between frame 89 and 119:" in words[0]


@pytest.mark.parametrize("frames", [10, 30, FRAMES])
def test_a_slip_within_the_distance_of_a_frame_is_not_reported(frames: int) -> None:
    """In a run of ten frames .4 mm were reported."""
    assert told_of(steady(0.0)[:frames], hung(frames // 2, frames // 2 + 1, 0.4, frames), 0.002) == []


def test_a_slip_is_compared_with_the_sigma_of_its_own_distance() -> None:
    """An encoder that hung for 900 mm of 100 m was not reported: σ of the scale over 100 m is 200 mm."""
    words = told_of(5.0 * np.arange(20000), hung(9000, 9180, -900.0, 20000), 0.002)
    assert len(words) == 1
    assert "disagree by 900.0 mm between frame 9000 and 9180" in words[0]


def test_an_encoder_that_hangs_for_more_than_half_of_a_run_is_reported() -> None:
    """Its steps without counts, of less than .5 mm, were taken for the usual difference to texture."""
    jitter = 0.01 * np.random.default_rng(1).standard_normal(FRAMES)
    words = told_of(0.4 * np.arange(FRAMES), hung(30, 100, -28.0) + jitter, 0.002)
    assert len(words) == 1
    assert "disagree by 28.0 mm between frame 30 and 100:" in words[0]


def test_an_encoder_that_counts_while_the_probe_rests_is_reported() -> None:
    assert len(told_of(np.zeros(600), hung(300, 330, 30.0, 600), 0.002)) == 1


def test_many_small_slips_of_jerks_are_not_summed() -> None:
    slip = np.sum([hung(at, at + 2, 2.0 * (-1) ** at) for at in range(5, 110, 7)], axis=0)
    assert told_of(steady(0.0), slip, 0.002) == []


def test_a_coarse_counter_does_not_slip_by_a_count() -> None:
    assert told_of(steady(0.0), hung(50, 51, 8.0), 0.002, 8 / np.sqrt(12)) == []


def test_few_frames_have_no_events() -> None:
    assert events(np.zeros(4)) == {}


@pytest.mark.parametrize(("sense", "words"), [(1, ["disagree 12 times by up to 1.2 mm"]), (-1, [])])
def test_many_small_slips_in_one_direction_are_reported_and_jerks_are_not(
    sense: int, words: list[str]
) -> None:
    """Slips of 1.2 mm, each too small to be reported, summed to more than 10 mm without a message."""
    slip = np.zeros(FRAMES)
    for k, at in enumerate(range(10, 114, 9)):
        slip[at:] += 1.2 * sense**k
    told = told_of(steady(0.0), slip, 0.002)
    assert len(told) == len(words)
    assert all(w in t for w, t in zip(words, told, strict=True))


def test_jerks_in_random_directions_are_not_summed() -> None:
    """They were reported in one run of twenty."""
    told = 0
    for seed in range(150):
        slip = np.zeros(400)
        for at, sense in zip(
            range(10, 390, 12), np.random.default_rng(seed).choice([-1, 1], 32), strict=True
        ):
            slip[at:] += 1.2 * sense
        told += len(told_of(0.6 * np.arange(400), slip, 0.002))
    assert told <= 2


@pytest.mark.parametrize("late_frames", [0.5, 0.8])
def test_a_late_clock_of_a_probe_that_starts_suddenly_is_not_a_slip(late_frames: float) -> None:
    """After 16 sudden starts, each made up for by the encoder later, 8 mm were reported."""
    push = np.r_[np.ones(10), np.linspace(1, 0, 30), np.zeros(5)]
    z = with_steps(np.tile(push, 16))
    number = np.arange(len(z))
    slip = np.interp(number - late_frames, number, z) - z
    assert told_of(z, slip + 0.002 * np.random.default_rng(0).standard_normal(len(z)), 0.002) == []
