"""Jumps of an encoder and restarted counters are distinguished from coarse counts and stops."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.arrays import Float
from pipeline.recording.base import Encoder, FrameTable
from pipeline.recording.encoder_checks import checked_encoder

FRAME = np.arange(300)
FRAMES = FrameTable(FRAME, FRAME / 30, np.full(300, "led"))


def noticed(way_mm: Float, rate_hz: float) -> tuple[Encoder, tuple[str, ...]]:
    encoder, found = checked_encoder(Encoder(np.arange(len(way_mm)) / rate_hz, way_mm), FRAMES)
    assert encoder is not None
    return encoder, found


@pytest.mark.parametrize("count_mm", [0.5, 2.0, 5.0])
@pytest.mark.parametrize("speed_mm_s", [3.0, 30.0])
def test_a_counter_with_coarse_counts_does_not_jump(count_mm: float, speed_mm_s: float) -> None:
    """At 3 mm a second with counts of 2 mm, each count was reported as a jump."""
    way = count_mm * np.floor(speed_mm_s * np.arange(1000) / 100 / count_mm)
    encoder, found = noticed(way, 100)
    assert found == ()
    np.testing.assert_array_equal(encoder.distance_mm, way)


@pytest.mark.parametrize("jitter_mm", [0.0, 0.01])
@pytest.mark.parametrize("moves", [3, 4, 20])
def test_a_probe_that_stands_and_then_goes_does_not_jump(jitter_mm: float, moves: int) -> None:
    """With a probe that stood for most of the time, its start was reported as jumps."""
    speed = np.zeros(100 + 10 * moves)
    speed[50 : 50 + moves] = 4.0
    way = np.cumsum(speed) + jitter_mm * np.random.default_rng(1).standard_normal(len(speed))
    assert noticed(way, (len(way) - 1) / 9.95)[1] == ()


@pytest.mark.parametrize("way", ["jumps", "spike", "jumps while it stands"])
def test_a_jump_is_reported(way: str) -> None:
    read = 0.3 * np.arange(1000)
    read = np.minimum(read, 60) if way == "jumps while it stands" else read
    read[500 : 501 if way == "spike" else None] += 40
    assert f"jumps by up to 40{'.3' * (way != 'jumps while it stands')} mm" in noticed(read, 100)[1][0]


@pytest.mark.parametrize("rate_hz", [30, 100, 200, 1000])
@pytest.mark.parametrize("jump_mm", [40.0, -40.0])
def test_a_jump_with_interpolated_readings_is_reported(jump_mm: float, rate_hz: float) -> None:
    """A logger that interpolates 30 readings a second to 100 spreads a jump over three: "it sets out"."""
    read_s = np.arange(300) / 30
    way = 27 * read_s + jump_mm * (read_s > 5)
    time_s = np.arange(0, read_s[-1], 1 / rate_hz)
    assert "jumps by" in " ".join(noticed(np.interp(time_s, read_s, way), rate_hz)[1])


@pytest.mark.parametrize("stands", [0, 2000])
@pytest.mark.parametrize("count_mm", [0.01, 2.0])
def test_a_restarted_counter_counts_on(count_mm: float, stands: int) -> None:
    """If the probe also stood for most of the time, a restarted counter was reported as a jump."""
    way = np.concatenate([np.zeros(stands), 0.3 * np.arange(1000)]) + count_mm / 2
    way = count_mm * np.floor(way / count_mm)
    encoder, found = noticed(way % 100, (len(way) - 1) / 9.95)
    assert len(found) == 1
    assert "restarts 2 times" in found[0] or "restarts 3 times" in found[0]
    np.testing.assert_allclose(encoder.distance_mm, way, atol=2 * max(count_mm, 0.3))


def test_readings_with_equal_times_are_checked() -> None:
    """A logger that gives three readings one time ended the run: between half of them no time passes."""
    times = np.repeat(np.arange(100) / 10, 3)
    assert checked_encoder(Encoder(times, 0.3 * np.arange(300)), FRAMES)[1] == ()


def test_a_wheel_that_slips_back_in_a_short_run_is_not_a_restarted_counter() -> None:
    """The slip itself counted among the usual steps, and the distances after it were changed."""
    way = 0.2 * np.arange(15)
    way = np.repeat(np.append(way, way[-1] - 2.1 + 0.2 * np.arange(3)), 30)
    encoder, found = noticed(way, 54)
    assert "jumps by up to 2.1 mm" in found[0]
    np.testing.assert_array_equal(encoder.distance_mm, way)
