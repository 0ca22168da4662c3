"""A late encoder clock is corrected; slips, constant speed and sound encoders are not taken for a delay."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from pipeline.arrays import Float
from pipeline.instrument.probe import Probe
from stages.motion.bore import ONE_BORE, Bore
from stages.motion.bundle_adjustment.encoder_delay import delay_of_encoder, find_delay
from stages.motion.bundle_adjustment.equations import MATCH_BIASES, Measurements
from stages.motion.bundle_adjustment.solver import estimate_state
from stages.motion.bundle_adjustment.unknowns import State
from stages.motion.encoder import EncoderReadings
from stages.motion.parameters import MotionParameters
from stages.motion.tracking.landmarks import TrackedPoses
from stages.motion.windows.first_window import adjust_first
from stages.motion.windows.submaps import Window
from tests.motion_scene import Scene, displaced, scene

TIME_S = np.arange(300) / 30
QUANTUM = 0.05


def way(time_s: Float) -> Float:
    """Return the distance, mm, of a probe pulled by hand at 18 mm/s."""
    return 18 * time_s + 0.9 * np.sin(1.7 * time_s) + 0.4 * np.sin(4.1 * time_s + 1)


def readings(late_s: float, slip_mm: float = 0.0) -> EncoderReadings:
    """Return the readings of an encoder with a late clock: at t it shows the value at t less the delay."""
    distance = np.round(1.01 * way(TIME_S - late_s) / QUANTUM) * QUANTUM
    slipped = slip_mm * np.clip((TIME_S - 4) / 0.3, 0, 1)
    return EncoderReadings(distance - slipped, QUANTUM / 12**0.5, np.ones(len(TIME_S), bool))


@pytest.mark.parametrize("slip_mm", [0.0, 3.0])
@pytest.mark.parametrize("late_s", [0.0, 0.2, -0.13, 0.5])
def test_the_delay_is_found_with_its_sigma_even_if_the_wheel_slips(late_s: float, slip_mm: float) -> None:
    found = find_delay(TIME_S, way(TIME_S), readings(late_s, slip_mm))
    assert found is not None
    assert abs(found.delay_s - late_s) < 3 * found.sigma_s + 1e-3
    assert found.sigma_s < 0.02
    assert found.matters == (late_s != 0)


@pytest.mark.parametrize("late_s", [0.0, 0.2, -0.2])
def test_the_delay_is_found_in_a_short_run(late_s: float) -> None:
    """Within a second of both ends nothing was compared: in 80 frames no delay was ever found."""
    late, short = readings(late_s), slice(0, 80)
    encoder = EncoderReadings(late.distance_mm[short], late.sigma_mm, late.known[short])
    found = find_delay(TIME_S[short], way(TIME_S[short]), encoder)
    assert found is not None
    assert abs(found.delay_s - late_s) < 3 * found.sigma_s + 1e-3
    assert found.matters == (late_s != 0)


def test_times_of_which_most_are_nearly_equal_cost_no_more() -> None:
    """Of frames whose times came in threes, 1 µs apart, a million delays were tried: minutes, and 4 GiB."""
    together = np.repeat(TIME_S[::3], 3) + 1e-6 * np.tile(np.arange(3), len(TIME_S) // 3)
    found = find_delay(together, way(together), readings(0.2))
    assert found is not None
    assert abs(found.delay_s - 0.2) < 0.1  # the time from one bunch to the next


@pytest.mark.parametrize("seed", range(20))
def test_constant_speed_shows_no_delay(seed: int) -> None:
    """The minimum is then anywhere, and as sharp as rounding makes it: .93 ± .03 s was reported."""
    random = np.random.default_rng(seed)
    speed, late_s = random.uniform(10, 25), random.uniform(-0.5, 0.5)
    seen = speed * TIME_S + 0.004 * np.cumsum(random.standard_normal(len(TIME_S)))
    read = np.round(speed * (TIME_S - late_s) / QUANTUM) * QUANTUM
    found = find_delay(TIME_S, seen, EncoderReadings(read, QUANTUM / 12**0.5, np.ones(len(TIME_S), bool)))
    assert found is None or not found.matters


def test_readings_are_shifted_in_time_and_unknown_beyond_their_end() -> None:
    late = readings(0.2)
    found = find_delay(TIME_S, way(TIME_S), late)
    assert found is not None
    mended = found.corrected(late, TIME_S)
    off = mended.distance_mm - 1.01 * (way(TIME_S) - way(TIME_S[:1]))
    assert np.ptp(off[mended.known]) < 2 * QUANTUM
    assert np.ptp((late.distance_mm - 1.01 * way(TIME_S))[mended.known]) > 10 * QUANTUM, (
        "control: they were late"
    )
    assert (~mended.known).sum() == 6, "as many frames as the delay covers"


@dataclass(frozen=True)
class Made:
    """The parts of a measured run that its first window needs."""

    given: Scene
    encoder: EncoderReadings | None
    probe: Probe
    time_s: Float
    bore: Bore = ONE_BORE
    jump: None = None
    much_lost: bool = False
    held_sigma: float = 0.0

    @property
    def whole(self) -> Window:
        """A longer run: no drift of the image scale is removed."""
        return Window(0, 0)

    @property
    def texture(self) -> SimpleNamespace:
        """Texture in most frames, or in two of three."""
        count = len(self.time_s)
        lost = (np.arange(count) % 3 == 2) & self.much_lost
        return SimpleNamespace(poses=TrackedPoses(np.arange(count), np.zeros((count, 4, 4)), lost))

    def measured(self, window: Window, parameters: MotionParameters) -> Measurements:
        return replace(self.given.measured, encoder=self.encoder, probe=self.probe)

    def start(self, window: Window, measured: Measurements, parameters: MotionParameters) -> State:
        return displaced(self.given.truth, np.random.default_rng(1), 0.3)


def test_a_window_is_adjusted_with_the_corrected_encoder() -> None:
    given = scene(100, 250, noise=1.0, swing_mm=2.0)
    sound, time_s = given.measured.encoder, given.measured.time_s
    assert sound is not None
    late = replace(sound, distance_mm=np.interp(time_s - 0.2, time_s, sound.distance_mm))
    run = Made(given, late, given.measured.probe, time_s)
    got = adjust_first(run, Window(0, 100), MotionParameters(), lambda: None)  # type: ignore[arg-type]
    assert got.encoder.delay is not None
    assert got.encoder.delay.delay_s == pytest.approx(0.2, abs=4 * got.encoder.delay.sigma_s)
    z = got.estimate.state.T_pc[:, 2, 3] - given.truth.T_pc[:, 2, 3]
    assert np.ptp(z) < 0.3, "with the late encoder it is 5 mm"


def test_an_estimate_that_follows_a_late_encoder_still_shows_its_delay() -> None:
    """With little texture the poses follow the readings, and the likeliest delay of these was 0."""
    made = scene(60, 40, noise=4.0, swing_mm=1.0)
    sound, time_s = made.measured.encoder, made.measured.time_s
    assert sound is not None
    late = np.interp(time_s - 0.2, time_s, made.truth.T_pc[:, 2, 3])
    measured = replace(made.measured, encoder=replace(sound, distance_mm=late - late[0], sigma_mm=0.015))
    estimate = estimate_state(made.truth, measured, MotionParameters())
    joint = find_delay(time_s, estimate.state.T_pc[:, 2, 3], measured.encoder)
    assert joint is not None
    assert not joint.matters, "control: poses with the encoder do not show it"
    found = delay_of_encoder(estimate, measured)
    assert found is not None
    assert found.matters
    assert found.delay_s == pytest.approx(0.2, abs=4 * found.sigma_s)


def test_a_sound_encoder_is_not_late_beside_weak_texture() -> None:
    """Without it the motion was .3 mm off, smoothly, which looked like .056 ± .011 s, and was "corrected"."""
    made = scene(60, 20, noise=6.0, swing_mm=2.0)
    z, sound = made.truth.T_pc[:, 2, 3], made.measured.encoder
    assert sound is not None
    rounded = np.round((z - z[0]) / 0.05) * 0.05
    measured = replace(made.measured, encoder=replace(sound, distance_mm=rounded, sigma_mm=0.015))
    found = delay_of_encoder(estimate_state(made.truth, measured, MotionParameters()), measured)
    assert found is None or not found.matters


def test_readings_that_scatter_by_more_than_their_rounding_get_a_larger_sigma() -> None:
    given = scene(60, 250, noise=1.0)
    sound, time_s = given.measured.encoder, given.measured.time_s
    assert sound is not None
    shaken = sound.distance_mm + 0.4 * np.random.default_rng(5).standard_normal(len(time_s))
    for reading, noise_mm in ((sound.distance_mm, sound.sigma_mm), (shaken, 0.4)):
        run = Made(given, replace(sound, distance_mm=reading), given.measured.probe, time_s)
        got = adjust_first(run, Window(0, 60), MotionParameters(), lambda: None)  # type: ignore[arg-type]
        assert got.run.encoder is not None
        assert got.run.encoder.sigma_mm == pytest.approx(noise_mm, rel=0.35)
        z = got.estimate.state.T_pc[:, 2, 3] - given.truth.T_pc[:, 2, 3]
        assert np.std(np.diff(z)) < 0.02, "with the σ of rounding it is 0.06"


def test_frequently_lost_texture_that_contradicts_an_encoder_does_not_pull_the_adjustment() -> None:
    """After VP9 the remaining texture pulled the lens by 1 σ: radii were .1 mm larger than without it."""
    given = scene(40, 120, noise=1.0)
    sound, time_s = given.measured.encoder, given.measured.time_s
    assert sound is not None
    longer = replace(sound, distance_mm=1.05 * sound.distance_mm)
    run = Made(given, longer, given.measured.probe, time_s, much_lost=True)
    got = adjust_first(run, Window(0, 40), MotionParameters(), lambda: None)  # type: ignore[arg-type]
    way_mm = np.ptp(got.estimate.state.T_pc[:, 2, 3])
    assert way_mm == pytest.approx(1.05 * np.ptp(given.truth.T_pc[:, 2, 3]), rel=0.005), "it was 2.3 % short"
    assert np.abs(got.estimate.state.instrument[-MATCH_BIASES:]).max() < 1, "they were 6.7 σ"


def test_an_encoder_at_rest_has_no_delay() -> None:
    still = replace(readings(0.0), distance_mm=np.zeros(len(TIME_S)))
    assert find_delay(TIME_S, way(TIME_S), still) is None
