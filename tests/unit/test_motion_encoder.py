"""An encoder is used only where it covers the frames and the wall's texture does not contradict it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipeline.arrays import Bool, Float
from pipeline.instrument.probe import Probe
from pipeline.recording.base import Encoder, FrameTable
from stages.motion.bore import ONE_BORE, Bore
from stages.motion.bundle_adjustment.encoder_scale import EncoderScale, uneven_scale
from stages.motion.encoder import EncoderReadings, contradicted, encoder_at_frames, warn_of_unread
from stages.motion.parameters import MotionParameters
from stages.motion.tracking.landmarks import TrackedPoses
from stages.motion.windows import first_window
from stages.motion.windows.submaps import Window
from tests.motion_scene import probe
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
        assert contradicted(said, tracked(z), quiet_context()) is expected


def test_a_coarse_counter_does_not_contradict_the_wall() -> None:
    z = SPEED * np.arange(FRAMES) / RATE
    coarse = EncoderReadings(5 * np.round(z / 5), 5 / np.sqrt(12), np.ones(FRAMES, bool))
    assert not contradicted(coarse, tracked(z), quiet_context())


def test_texture_lost_in_most_frames_does_not_contradict_the_encoder() -> None:
    z = SPEED * np.arange(FRAMES) / RATE
    tracks = tracked(0 * z)
    tracks.lost[2:] = True
    assert not contradicted(EncoderReadings(z, 0.015, np.ones(FRAMES, bool)), tracks, quiet_context())


@pytest.mark.parametrize(
    ("wider", "words"), [(0.026, "suggests that the probe is wrong"), (0.0, "cannot show")]
)
def test_a_diameter_with_the_same_error_as_distance_is_evidence_against_the_probe(
    wider: float, words: str
) -> None:
    """With pictures enlarged by 1 % the radius was 1.3 mm too large, and only the encoder was blamed."""
    told: list[str] = []
    EncoderScale(1.02, 0.001, 0.002).warn(replace(quiet_context(), warn=told.append), wider)
    assert len(told) == 1
    assert words in told[0]
    doubt = EncoderScale(1.02, 0.001, 0.002).doubt_of_probe(wider)
    assert doubt == pytest.approx(0.02 if wider else 0.0), "σ of radii must include the reported deviation"


@pytest.mark.parametrize("scale", [0.98, 1.004])
def test_texture_that_is_not_trusted_does_not_contradict_an_encoder(scale: float) -> None:
    found = EncoderScale(scale, 0.0005, 0.0005)
    assert found.contradicted, "control: trusted texture does"
    doubted = found.without_trust_in_texture()
    assert not doubted.contradicted
    assert doubted.sigma >= abs(scale - 1)


@dataclass(frozen=True)
class Held:
    """The parts of a run and of its measurements that the encoder's scale needs."""

    texture: SimpleNamespace
    bore: Bore = ONE_BORE
    probe: Probe = field(default_factory=probe)


@dataclass(frozen=True)
class Adjusted:
    """A first window that no adjustment changes."""

    run: Held
    measured: Held
    window: Window
    estimate: SimpleNamespace
    parameters: MotionParameters = field(default_factory=MotionParameters)

    def again(self, start: object) -> Adjusted:
        return self

    def with_texture_off(self, times: float) -> Adjusted:
        return self


def window_that_lost(lost: Bool) -> Any:
    """Return the first window of 20 frames in a run that lost its texture in some (N,)."""
    poses = TrackedPoses(np.arange(len(lost)), np.zeros((len(lost), 4, 4)), lost)
    held = Held(SimpleNamespace(poses=poses))
    return Adjusted(held, held, Window(0, 20), SimpleNamespace(state=None))


@pytest.mark.parametrize(("lost", "doubted"), [(0, False), (4, False), (8, True), (19, True)])
def test_texture_lost_in_many_pictures_is_no_evidence_against_an_encoder(
    lost: int, doubted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After VP9 half of the pictures had no texture, the rest were 4.8 % short: the encoder was rejected."""
    found = EncoderScale(0.98, 0.005, 0.002)
    monkeypatch.setattr(first_window, "scale_of_encoder", lambda *_: found)
    _, scale, unsure = first_window.with_scale(window_that_lost(np.arange(20, 0, -1) <= lost), 0.001)
    assert scale is not None
    assert (scale.sigma > found.sigma) == doubted
    assert unsure == (scale.sigma if doubted else np.hypot(0.001, found.doubt))


def test_a_difference_from_lost_texture_within_its_sigma_does_not_widen_the_encoders(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Distances got the σ of the remaining texture, however little it showed."""
    monkeypatch.setattr(first_window, "scale_of_encoder", lambda *_: EncoderScale(1.001, 0.6, 0.002))
    assert first_window.with_scale(window_that_lost(np.ones(20, bool)), 0.001)[2] == 0.001


@pytest.mark.parametrize(("off", "doubted"), [(0.05, False), (0.08, True)])
def test_lost_texture_widens_the_sigma_of_distances_only_where_its_own_is_small(
    off: float, doubted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From 1 σ on, a distance of 102 mm got a σ of 60 mm, since rings gave its scale as .51 ± .32."""
    found = [EncoderScale(1 + off * size / 0.02, size, 0.002) for size in (0.019, 0.32)]
    lost = window_that_lost(np.ones(20, bool))
    for scale, sure in zip(found, (not doubted, True), strict=True):
        monkeypatch.setattr(first_window, "scale_of_encoder", lambda *_, scale=scale: scale)
        assert (first_window.with_scale(lost, 0.001)[2] == 0.001) == sure


@pytest.mark.parametrize("scale", [1.2, 0.95, 1.01])
def test_an_encoder_that_differs_from_lost_texture_is_followed_and_reported(
    scale: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A wheel 20 % off was followed without a message: the σ that included the difference hid it."""
    told: list[str] = []
    monkeypatch.setattr(first_window, "scale_of_encoder", lambda *_: EncoderScale(scale, 0.002, 0.002))
    _, found, unsure = first_window.with_scale(window_that_lost(np.arange(20) > 10), 0.001)
    assert found is not None
    assert not found.contradicted
    found.warn(replace(quiet_context(), warn=told.append), 0.0)
    assert len(told) == (abs(scale - 1) > 0.02)
    assert all("too little texture to decide" in words for words in told)
    assert unsure >= abs(scale - 1)


def test_texture_lost_after_the_first_window_does_not_save_a_wrong_encoder(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Only the first window decides the scale: with its good texture an encoder 20 % off is rejected."""
    monkeypatch.setattr(first_window, "scale_of_encoder", lambda *_: EncoderScale(1.2, 0.002, 0.002))
    _, found, _ = first_window.with_scale(window_that_lost(np.arange(60) >= 20), 0.001)
    assert found is not None
    assert found.contradicted


@pytest.mark.parametrize(("lost", "sigma"), [(0, 0.001), (19, 0.048)])
def test_sigma_of_distances_from_lost_texture_alone_covers_their_error(
    lost: int, sigma: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without encoder σ was .5 %, and distances were 4.8 % short."""
    monkeypatch.setattr(first_window, "scale_of_encoder", lambda *_: None)
    unsure = first_window.with_scale(window_that_lost(np.arange(20, 0, -1) <= lost), 0.001)[2]
    assert unsure == pytest.approx(sigma, rel=0.1)


BY_TEXTURE, STATED = 0.0024, 0.002


def errors_in_sigma(encoder_off: float) -> tuple[Float, Float]:
    """Return drawn errors of distances from texture and encoder, in the whole σ and in that without doubt."""
    random = np.random.default_rng(7)
    texture = BY_TEXTURE * random.standard_normal(4000)
    encoder = encoder_off + STATED * random.standard_normal(4000)
    weight = BY_TEXTURE**2 / (BY_TEXTURE**2 + STATED**2)
    found = [EncoderScale(1 + d, BY_TEXTURE, STATED) for d in texture - encoder]
    error = np.where([f.contradicted for f in found], texture, texture + weight * (encoder - texture))
    sigma = np.where([f.contradicted for f in found], BY_TEXTURE, STATED * np.sqrt(weight))
    return error / np.hypot(sigma, [f.doubt for f in found]), error / sigma


@pytest.mark.parametrize("off", [0.004, 0.006, 0.008, 0.01, 0.015])
def test_sigma_of_distances_holds_beside_an_encoder_off_by_more_than_stated(off: float) -> None:
    """An encoder 1 % off where .2 % was stated moved distances by 4 σ, and nothing told of it."""
    whole, alone = errors_in_sigma(off)
    assert np.mean(np.abs(whole) < 2) > 0.78
    assert np.sqrt(np.mean(whole**2)) < 1.7
    assert np.mean(np.abs(alone) < 2) < np.mean(np.abs(whole) < 2), "control"


def test_a_sound_encoder_is_hardly_doubted() -> None:
    whole, alone = errors_in_sigma(0.0)
    assert 0.9 < np.sqrt(np.mean(whole**2)) < 1
    assert np.median(alone / whole) == 1
    assert np.mean(alone / whole) < 1.2


@pytest.mark.parametrize(("scale", "warned"), [(1.003, False), (1.009, False), (1.0105, True), (1.03, True)])
def test_a_difference_that_may_be_no_chance_is_told(scale: float, warned: bool) -> None:
    told: list[str] = []
    EncoderScale(scale, BY_TEXTURE, STATED).warn(replace(quiet_context(), warn=told.append), 0.0)
    assert len(told) == warned


def slipping(part: slice, creep: float, jump_mm: float = 0.0) -> float:
    """Return how uneven the scale is with ``creep`` in a part of 80 frames, and a jump in the middle."""
    read, step = np.full(79, 0.6), 0.0004 * np.random.default_rng(3).standard_normal(79)
    step[part] += creep * read[part]
    step[40] += jump_mm
    distance = np.concatenate([[0.0], np.cumsum(read)])
    return uneven_scale(
        np.concatenate([[0.0], np.cumsum(step)]), EncoderReadings(distance, 0.015, np.ones(80, bool)), 0.002
    )


def test_an_encoder_that_creeps_in_a_part_of_the_run_is_uneven() -> None:
    """One that read 1 % too much over half a run moved distances by 2 σ, and nothing told of it."""
    assert slipping(slice(0, 40), 0.008) == pytest.approx(0.0045, abs=0.001)
    assert slipping(slice(40, 60), 0.008) == pytest.approx(0.004, abs=0.001)
    assert slipping(slice(0, 79), 0.008) < 2e-4, "a scale that is wrong everywhere is even"
    assert slipping(slice(0, 0), 0.0) < 2e-4
    assert slipping(slice(0, 0), 0.0, jump_mm=2.0) < 5e-4, "a sudden slip is no creep"


def test_an_encoder_that_creeps_is_told_once() -> None:
    told: list[str] = []
    EncoderScale(1.001, BY_TEXTURE, STATED, uneven=0.004).warn(
        replace(quiet_context(), warn=told.append), 0.0
    )
    assert len(told) == 1
    assert "creeps" in told[0]
