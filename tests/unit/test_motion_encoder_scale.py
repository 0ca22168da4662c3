"""An encoder whose scale texture contradicts: its σ, what is told, and whom to blame."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipeline.arrays import Bool, Float
from pipeline.instrument.probe import Probe
from stages.motion.bore import ONE_BORE, Bore
from stages.motion.bundle_adjustment.encoder_scale import EncoderScale, scale_of_encoder, uneven_scale
from stages.motion.bundle_adjustment.solver import estimate_state
from stages.motion.encoder import EncoderReadings
from stages.motion.parameters import MotionParameters
from stages.motion.tracking.landmarks import TrackedPoses
from stages.motion.windows import first_window
from stages.motion.windows.submaps import Window
from tests.motion_scene import probe, scene
from tests.quiet import quiet_context

RATE = 30.0
SPEED = 18.0


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


def test_a_difference_too_small_for_a_warning_is_reported_with_its_sigma() -> None:
    """An encoder that was 1 % off over a short run, 2.4 σ, was mentioned nowhere."""
    warned: list[str] = []
    told: dict[str, float] = {}
    context = replace(
        quiet_context(), warn=warned.append, report=lambda name, value, unit="": told.update({name: value})
    )
    EncoderScale(1 / 1.01, 0.003, 0.003).warn(context, 0.0)
    assert not warned
    more, sigma = told.values()
    assert more == pytest.approx(1.0)
    assert sigma == pytest.approx(0.42, abs=0.01)


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
    held_sigma: float = 0.0
    encoder: EncoderReadings | None = None


@dataclass(frozen=True)
class Adjusted:
    """A first window that no adjustment changes."""

    run: Held
    measured: Held
    window: Window
    estimate: SimpleNamespace
    parameters: MotionParameters = field(default_factory=MotionParameters)

    def resumed(self) -> Adjusted:
        return self

    def with_texture_off(self, times: float) -> Adjusted:
        return self


def without_encoder(moved: float) -> Any:
    """Return an estimate without the encoder, which moves the probe by so many σ; texture's own σ follows."""
    directions = probe().principal_uncertainties().shape[1]
    texture = np.full(3, 9.0)
    return SimpleNamespace(state=SimpleNamespace(instrument=np.r_[np.full(directions, moved), texture]))


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
    monkeypatch.setattr(first_window, "_without_encoder", lambda _: without_encoder(1.0))
    _, found, _ = first_window.with_scale(window_that_lost(np.arange(60) >= 20), 0.001)
    assert found is not None
    assert found.contradicted


@pytest.mark.parametrize(("moved", "rejected"), [(4.0, True), (6.0, False)])
def test_beside_a_probe_that_does_not_fit_no_encoder_is_called_wrong(
    moved: float, rejected: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a principal point 50 σ off, a right encoder was rejected at 4 σ."""
    monkeypatch.setattr(first_window, "scale_of_encoder", lambda *_: EncoderScale(1.02, 0.002, 0.002))
    monkeypatch.setattr(first_window, "_without_encoder", lambda _: without_encoder(moved))
    _, found, unsure = first_window.with_scale(window_that_lost(np.zeros(20, bool)), 0.001)
    assert found is not None
    assert found.contradicted == rejected
    assert rejected or unsure >= 0.02


@pytest.mark.parametrize(("lost", "sigma"), [(0, 0.001), (19, 0.048)])
def test_sigma_of_distances_from_lost_texture_alone_covers_their_error(
    lost: int, sigma: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without encoder σ was .5 %, and distances were 4.8 % short."""
    monkeypatch.setattr(first_window, "scale_of_encoder", lambda *_: None)
    unsure = first_window.with_scale(window_that_lost(np.arange(20, 0, -1) <= lost), 0.001)[2]
    assert unsure == pytest.approx(sigma, rel=0.1)


def test_without_a_landmark_nothing_speaks_against_an_encoder() -> None:
    """Before the end of a pipe no landmark remained, and the encoder was told to be off by 35 274 %."""
    made = scene(9, 25, seed=2)
    for landmarks in (25, 0):
        tracks = made.measured.tracks
        measured = replace(made.measured, tracks=tracks.some(tracks.landmark < landmarks)[0])
        start = replace(made.truth, xyz_p=made.truth.xyz_p[:landmarks])
        estimate = estimate_state(start, measured, MotionParameters(), lambda: None)
        assert (scale_of_encoder(estimate, measured, 0.0, 0.002) is not None) == (landmarks > 0)


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
