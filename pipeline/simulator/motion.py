"""The camera's true motion along the pipe, and the odometer that reports it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from pipeline.arrays import Float
from pipeline.geometry.axis import PipeAxis, frames_at, to_pipe
from pipeline.geometry.rigid import from_parts, rotation_from_vector
from pipeline.recording.base import Encoder
from pipeline.simulator.scene import MotionScene, SwayScene


@dataclass(frozen=True)
class Wave:
    """A sinusoid amplitude · sin(2π frequency · t + phase)."""

    amplitude: float
    frequency_hz: float
    phase_rad: float = 0.0


@dataclass(frozen=True)
class Signal:
    """A smooth function of time: a cubic spline through knots plus waves; constant before and after.

    Attributes
    ----------
    time_s : (K,)
        Increasing; one knot alone makes a constant.
    value : (K,)
    waves : tuple of Wave
    """

    time_s: Float
    value: Float
    waves: tuple[Wave, ...] = ()

    def at(self, time_s: Float) -> Float:
        """Return the value (...) at times (...)."""
        t = np.asarray(time_s, float)
        inside = np.clip(t, self.time_s[0], self.time_s[-1])
        if len(self.time_s) == 1:
            smooth = np.full(t.shape, self.value[0])
        else:
            smooth = CubicSpline(self.time_s, self.value, bc_type="natural")(inside)
        for w in self.waves:
            smooth = smooth + w.amplitude * np.sin(2 * np.pi * w.frequency_hz * t + w.phase_rad)
        return np.asarray(smooth)


def constant(value: float) -> Signal:
    """Return a signal that does not change."""
    return Signal(np.zeros(1), np.array([value]))


_ZERO = constant(0.0)


@dataclass(frozen=True)
class Motion:
    """Where the camera is, as seen from the pipe's axis.

    Attributes
    ----------
    distance_mm : Signal
        Distance along the axis.
    x_mm, y_mm : Signal
        Off the axis, in the section there.
    yaw_rad, pitch_rad, roll_rad : Signal
        The camera's axis leans by yaw towards +x and by pitch towards −y (rotation vector (pitch, yaw, 0) in
        the section's frame), after a roll about its own axis.
    """

    distance_mm: Signal
    x_mm: Signal = _ZERO
    y_mm: Signal = _ZERO
    yaw_rad: Signal = _ZERO
    pitch_rad: Signal = _ZERO
    roll_rad: Signal = _ZERO

    def pose(self, time_s: Float, axis: PipeAxis) -> Float:
        """Return ``T_pc`` (..., 4, 4) at times (...)."""
        t = np.asarray(time_s, float)
        origin, R_pa = frames_at(axis, self.distance_mm.at(t))
        zero = np.zeros(t.shape)
        lean = rotation_from_vector(np.stack([self.pitch_rad.at(t), self.yaw_rad.at(t), zero], -1))
        turn = rotation_from_vector(np.stack([zero, zero, self.roll_rad.at(t)], -1))
        aside = R_pa[..., :, 0] * self.x_mm.at(t)[..., None] + R_pa[..., :, 1] * self.y_mm.at(t)[..., None]
        return from_parts(R_pa @ lean @ turn, origin + aside)


@dataclass(frozen=True)
class Slip:
    """A slip at ``time_s`` by which the reading grows by ``slip_mm``."""

    time_s: float
    slip_mm: float


@dataclass(frozen=True)
class Odometer:
    """Cable or wheel encoder.

    Attributes
    ----------
    rate_hz : float
        Readings a second of its own clock.
    quantum_mm : float
        Step of its counter.
    scale : float
        Reading over true distance, less one.
    backlash_mm : float
        Play b: the reading is s − (b/2) sgn v, turning over within the play at a reversal.
    delay_s : float
        Delay τ of the readings: the one at camera time t belongs to t − τ, so visual − encoder = v τ.
    slips : tuple of Slip
    """

    rate_hz: float = 100.0
    quantum_mm: float = 0.05
    scale: float = 0.0
    backlash_mm: float = 0.0
    delay_s: float = 0.0
    slips: tuple[Slip, ...] = ()

    def readings(self, motion: Motion, until_s: float) -> Encoder:
        """Return the readings from 0 to ``until_s`` of its own clock; the first reading is 0."""
        clock = np.arange(0.0, until_s, 1.0 / self.rate_hz)
        happened = clock - self.delay_s
        way = motion.distance_mm.at(happened)
        counted = self._with_play(way) * (1 + self.scale)
        for slip in self.slips:
            counted = counted + np.where(happened >= slip.time_s, slip.slip_mm, 0.0)
        counted = counted - counted[0]
        if self.quantum_mm > 0:
            counted = self.quantum_mm * np.rint(counted / self.quantum_mm)
        return Encoder(clock, counted)

    def _with_play(self, way_mm: Float) -> Float:
        """Return the wheel's distance: it does not change while the cable moves within the play."""
        half, at = 0.5 * self.backlash_mm, np.empty_like(way_mm)
        state = way_mm[0]
        for i, way in enumerate(way_mm.tolist()):
            state = min(max(state, way - half), way + half)
            at[i] = state
        return at


# Number of spline knots in an easing time.
_KNOTS_AN_EASING = 8
# Steps of the integration between two knots.
_FINE = 16


def motion_of(scene: MotionScene, until_s: float) -> Motion:
    """Return the motion over 0 … ``until_s``; after the last leg the camera stands still."""
    return Motion(
        distance_mm=_way(scene, until_s),
        x_mm=_sway(scene.x_mm, until_s),
        y_mm=_sway(scene.y_mm, until_s),
        yaw_rad=_sway(scene.yaw_deg, until_s, math.radians(1)),
        pitch_rad=_sway(scene.pitch_deg, until_s, math.radians(1)),
        roll_rad=_sway(scene.roll_deg, until_s, math.radians(1)),
    )


def _way(scene: MotionScene, until_s: float) -> Signal:
    """Return the distance: the speed, averaged over the easing time, is integrated."""
    easing = scene.easing_s
    fine = easing / (_KNOTS_AN_EASING * _FINE)
    time = np.arange(-easing, until_s + easing + fine, fine)
    ends = np.cumsum([leg.duration_s for leg in scene.legs])
    speeds = np.array([leg.speed_mm_s for leg in scene.legs] + [0.0])
    distance = np.concatenate([[0.0], np.cumsum(speeds[:-1] * np.diff(ends, prepend=0.0))])
    sharp = np.interp(time, np.concatenate([[0.0], ends]), distance)
    sharp = np.where(time < 0, speeds[0] * time, sharp)
    window = np.hanning(2 * (_KNOTS_AN_EASING * _FINE // 2) + 3)
    smooth = np.convolve(sharp, window / window.sum(), mode="same")
    knots = (time >= -easing / 4) & (time <= until_s + easing / 4)
    smooth = smooth - np.interp(0.0, time, smooth)
    return Signal(time[knots][::_FINE], scene.start_mm + smooth[knots][::_FINE])


def _sway(scene: SwayScene, until_s: float, unit: float = 1.0) -> Signal:
    waves = tuple(
        Wave(unit * w.amplitude, 1 / w.period_s, math.radians(w.phase_deg)) for w in scene.waves
    )  # fmt: skip
    ends = np.array([0.0, max(until_s, 1e-3)])
    return Signal(ends, unit * (scene.mean + scene.trend_per_s * ends), waves)


def motion_through(T_pc: Float, time_s: Float, axis: PipeAxis) -> Motion:
    """Return the motion that passes through poses (N, 4, 4) at their times."""
    s, psi, r = to_pipe(axis, T_pc[:, :3, 3])
    R = np.swapaxes(frames_at(axis, s)[1], -1, -2) @ T_pc[:, :3, :3]
    forward = R[:, :, 2]
    across = np.hypot(forward[:, 0], forward[:, 1])
    angle = np.arctan2(across, forward[:, 2]) / np.maximum(across, 1e-12)
    pitch, yaw = -forward[:, 1] * angle, forward[:, 0] * angle
    lean = rotation_from_vector(np.stack([pitch, yaw, 0 * yaw], -1))
    turn = np.swapaxes(lean, -1, -2) @ R
    roll = np.unwrap(np.arctan2(turn[:, 1, 0], turn[:, 0, 0]))
    values = (s, r * np.cos(psi), r * np.sin(psi), yaw, pitch, roll)
    return Motion(*(Signal(time_s, value) for value in values))
