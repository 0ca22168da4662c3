"""Scattered time stamps of a regular rhythm are replaced by it; right ones, irregular or not, are kept."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from pipeline.arrays import Float
from pipeline.recording.base import Encoder, FrameTable
from stages.motion.frame_times import even_rhythm, frame_times
from stages.motion.tracking.landmarks import TrackedPoses
from tests.quiet import quiet_context

FRAMES, RATE = 120, 30.0


@dataclass(frozen=True)
class Recorded:
    """The parts of a recording that the times need."""

    frames: FrameTable
    encoder: Encoder | None


def way(time_s: Float) -> Float:
    return 18 * time_s + 0.9 * np.sin(1.7 * time_s)


def believed(taken_s: Float, stamps: Float, told: list[str] | None = None) -> Float:
    """Return the times that are used for frames taken at ``taken_s`` and stamped otherwise."""
    read_s = np.arange(-0.5, FRAMES / RATE + 0.5, 0.01)
    encoder = Encoder(read_s, np.round(way(read_s) / 0.05) * 0.05)
    recording = Recorded(FrameTable(np.arange(FRAMES), stamps, np.full(FRAMES, "led")), encoder)
    T_pc = np.tile(np.eye(4), (FRAMES, 1, 1))
    T_pc[:, 2, 3] = way(taken_s) + 0.01 * np.random.default_rng(1).standard_normal(FRAMES)
    tracked = TrackedPoses(np.arange(FRAMES), T_pc, np.zeros(FRAMES, bool))
    context = replace(quiet_context(), warn=(told if told is not None else []).append)
    return frame_times(recording, tracked, context)  # type: ignore[arg-type]


@pytest.fixture
def scatter() -> Float:
    return np.random.default_rng(0).uniform(0, 0.012, FRAMES)


EVEN = np.arange(FRAMES) / RATE


def test_scattered_stamps_of_a_regular_rhythm_are_replaced_and_reported(scatter: Float) -> None:
    told: list[str] = []
    got = believed(EVEN, EVEN + scatter, told)
    assert np.ptp(got - EVEN) < 2e-3
    assert "scatter by 3." in told[0]


def test_right_stamps_are_kept_though_they_scatter(scatter: Float) -> None:
    told: list[str] = []
    taken = EVEN + scatter
    assert believed(taken, taken, told) is not EVEN
    np.testing.assert_array_equal(believed(taken, taken), taken)
    assert not told


def test_regular_stamps_and_ones_with_a_gap_are_kept() -> None:
    assert even_rhythm(EVEN) is None
    assert even_rhythm(EVEN + 0.1 * (np.arange(FRAMES) > 60)) is None
