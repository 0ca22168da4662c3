"""An encoder is used only where it covers the frames and the wall's texture does not contradict it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from pipeline.recording.base import Encoder, FrameTable
from stages.motion.bundle_adjustment.encoder_delay import in_step_with_wall
from stages.motion.encoder import EncoderReadings, contradicted, encoder_at_frames, warn_of_unread
from stages.motion.tracking.landmarks import TrackedPoses
from tests.quiet import quiet_context

RATE = 30.0
SPEED = 18.0
FRAMES = 60


@dataclass(frozen=True)
class Recorded:
    """The parts of a recording that the encoder needs."""

    frames: FrameTable
    encoder: Encoder | None


def recorded(time_s: np.ndarray, distance_mm: np.ndarray) -> Recorded:
    frame = np.arange(FRAMES)
    return Recorded(FrameTable(frame, frame / RATE, np.full(FRAMES, "led")), Encoder(time_s, distance_mm))


def clean() -> tuple[np.ndarray, np.ndarray]:
    time_s = np.arange(0, FRAMES / RATE + 0.1, 0.01)
    return time_s, np.round(SPEED * time_s / 0.05) * 0.05


def readings(time_s: np.ndarray, distance_mm: np.ndarray) -> EncoderReadings | None:
    return encoder_at_frames(recorded(time_s, distance_mm), 0.0, 60.0, quiet_context())  # type: ignore[arg-type]


def tracked(z: np.ndarray) -> TrackedPoses:
    T_pc = np.tile(np.eye(4), (len(z), 1, 1))
    T_pc[:, 2, 3] = z
    return TrackedPoses(np.arange(len(z)), T_pc, np.zeros(len(z), bool))


def test_sigma_is_that_of_rounding_to_counts() -> None:
    found = readings(*clean())
    assert found is not None
    assert found.sigma_mm == pytest.approx(0.05 / np.sqrt(12))
    assert found.known.all()
    np.testing.assert_allclose(found.distance_mm, SPEED * np.arange(FRAMES) / RATE, atol=0.05)


def test_a_jump_is_removed() -> None:
    time_s, distance = clean()
    found = readings(time_s, distance + 40.0 * (time_s > 1))
    assert found is not None
    np.testing.assert_allclose(np.diff(found.distance_mm).max(), SPEED / RATE, atol=0.06)
    assert found.distance_mm[-1] == pytest.approx(SPEED * (FRAMES - 1) / RATE, abs=1.0)


def test_the_distance_over_missing_frames_is_not_a_jump() -> None:
    """While the camera hung for a second the wall moved on by 18 mm, which was taken for a jump."""
    frames = recorded(*clean()).frames
    there = (frames.time_s < 0.5) | (frames.time_s > 1.5)
    table = FrameTable(frames.frame[there], frames.time_s[there], frames.illumination[there])
    found = encoder_at_frames(Recorded(table, Encoder(*clean())), 0.0, 60.0, quiet_context())  # type: ignore[arg-type]
    assert found is not None
    np.testing.assert_allclose(found.distance_mm, SPEED * table.time_s, atol=0.05)


@pytest.mark.parametrize("silent", [True, False])
def test_an_encoder_that_hangs_and_catches_up_is_unknown_in_between(silent: bool) -> None:
    """The jump is a right reading: after its removal, half a second of distance was missing from there on."""
    time_s, distance = clean()
    hung = (time_s > 0.7) & (time_s < 1.2)
    held = np.where(hung, distance[hung][0], distance)
    found = readings(time_s[~hung], distance[~hung]) if silent else readings(time_s, held)
    assert found is not None
    assert found.distance_mm[-1] == pytest.approx(SPEED * (FRAMES - 1) / RATE, abs=0.1)
    assert 12 <= (~found.known).sum() <= 15, "half a second of frames"


def test_an_encoder_that_rests_together_with_its_probe_stays_known() -> None:
    time_s, distance = clean()
    found = readings(time_s, distance - np.clip(time_s - 0.7, 0, 0.5) * SPEED)
    assert found is not None
    assert found.known.all()


def test_frames_after_the_end_of_the_encoder_have_no_reading() -> None:
    time_s, distance = clean()
    found = readings(time_s[time_s < 1], distance[time_s < 1])
    assert found is not None
    assert found.known[: int(0.9 * RATE)].all()
    assert not found.known[int(1.1 * RATE) :].any()


def words_on_unread(time_s: np.ndarray, distance_mm: np.ndarray, z: np.ndarray) -> list[str]:
    """Return the messages on unread frames where texture shows that frames lie at z (FRAMES,)."""
    words: list[str] = []
    found = readings(time_s, distance_mm)
    assert found is not None
    context = replace(quiet_context(), warn=words.append)
    warn_of_unread(found, tracked(z), np.arange(FRAMES), context)
    return words


@pytest.mark.parametrize(
    ("from_s", "until_s", "told"),
    [(0.0, 1.0, "(frames 31 to 59)"), (0.0, 1.95, ""), (0.505, 1.5, "(frames 0 to 14, 46 to 59)")],
)
def test_an_encoder_that_was_cut_off_is_reported(from_s: float, until_s: float, told: str) -> None:
    """Two fifths of a run were without encoder and without a message; one or two frames need none."""
    time_s, distance = clean()
    there = (time_s >= from_s) & (time_s < until_s)
    words = words_on_unread(time_s[there], distance[there], SPEED * np.arange(FRAMES) / RATE)
    assert [told in w for w in words] == [True] * bool(told)


@pytest.mark.parametrize("count_mm", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("rests_s", [(0.0, 0.7), (0.7, 1.3), (1.3, 2.1)])
def test_a_counter_that_logs_only_counts_is_read_while_the_probe_rests(
    count_mm: float, rests_s: tuple[float, float]
) -> None:
    """At rest it "had no readings for 61 of 300 frames", though it had missed nothing."""
    time_s = np.arange(0, FRAMES / RATE, 0.001)
    way = SPEED * (time_s - np.clip(time_s - rests_s[0], 0, rests_s[1] - rests_s[0]))
    counted = count_mm * np.floor(way / count_mm)
    logged = np.flatnonzero(np.diff(counted)) + 1
    z = np.interp(np.arange(FRAMES) / RATE, time_s, way)
    found = readings(time_s[logged], counted[logged])
    assert found is not None
    assert found.known[25:35].all(), "one count is not a gap"
    assert words_on_unread(time_s[logged], counted[logged], z) == []


def test_a_frame_just_outside_the_readings_is_extrapolated() -> None:
    """With the last reading repeated, the end of a run at 280 mm/s was 0.9 mm (7 σ) short."""
    time_s, distance = clean()
    inside = (time_s > 0.025) & (time_s < (FRAMES - 1) / RATE - 0.025)
    found = readings(time_s[inside], distance[inside])
    assert found is not None
    assert found.known.all()
    np.testing.assert_allclose(found.distance_mm, SPEED * np.arange(FRAMES) / RATE, atol=0.15)


@pytest.mark.parametrize(("late_s", "scale"), [(100.0, 1.0), (0.0, 1e6)])
def test_an_encoder_with_another_clock_or_unit_is_left_out(late_s: float, scale: float) -> None:
    time_s, distance = clean()
    assert readings(time_s + late_s, distance * scale) is None


def test_texture_contradicts_a_reversed_or_stuck_encoder_but_not_a_true_one() -> None:
    z = SPEED * np.arange(FRAMES) / RATE * 1.002
    true = EncoderReadings(z / 1.002, 0.015, np.ones(FRAMES, bool))
    for distance, expected in ((true.distance_mm, False), (-true.distance_mm, True), (0 * z, True)):
        said = EncoderReadings(distance, 0.015, true.known)
        assert contradicted(said, tracked(z)) is expected


def test_a_coarse_counter_does_not_contradict_the_wall() -> None:
    z = SPEED * np.arange(FRAMES) / RATE
    coarse = EncoderReadings(5 * np.round(z / 5), 5 / np.sqrt(12), np.ones(FRAMES, bool))
    assert not contradicted(coarse, tracked(z))


def test_texture_lost_in_most_frames_does_not_contradict_the_encoder() -> None:
    z = SPEED * np.arange(FRAMES) / RATE
    tracks = tracked(0 * z)
    tracks.lost[2:] = True
    assert not contradicted(EncoderReadings(z, 0.015, np.ones(FRAMES, bool)), tracks)


def in_step(distance_mm: np.ndarray, z: np.ndarray) -> tuple[EncoderReadings | None, list[str]]:
    """Return the readings that agree with a wall seen at z (N,), and the warnings."""
    words: list[str] = []
    said = EncoderReadings(distance_mm - distance_mm[0], 0.1, np.ones(FRAMES, bool))
    frames, context = recorded(*clean()).frames, replace(quiet_context(), warn=words.append)
    assert contradicted(said, tracked(z))
    return in_step_with_wall(said, tracked(z), frames, context), words


def test_an_encoder_of_a_hand_pulled_probe_is_used_though_its_clock_is_late() -> None:
    """It was thrown away, since stops of texture and encoder did not coincide; only its clock was wrong."""
    time_s = np.arange(FRAMES) / RATE
    way = lambda t: 20 * (t - np.sin(2 * np.pi * 1.3 * t + 0.4) / (2 * np.pi * 1.3))  # noqa: E731
    found, words = in_step(way(time_s - 0.3), way(time_s))
    assert found is not None
    assert len(words) == 1
    assert "0.30" in words[0]
    assert "late" in words[0]
    inside = found.known
    off = found.distance_mm[inside] - way(time_s)[inside]
    assert np.ptp(off) < 0.3


def test_an_encoder_that_stands_is_not_used_and_its_frames_are_named() -> None:
    way = SPEED * np.arange(FRAMES) / RATE
    found, words = in_step(np.where(np.arange(FRAMES) < 20, way, np.maximum(way[20], way - 12.0)), way)
    assert found is None
    assert "in frames 20 to" in words[0]
