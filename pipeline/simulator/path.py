"""The motion of a scene: legs of speed joined smoothly, and swaying."""

from __future__ import annotations

import math

import numpy as np

from pipeline.arrays import Float
from pipeline.artefacts.measured import PipeAxis
from pipeline.geometry.axis import frames_at, to_pipe
from pipeline.geometry.rigid import rotation_from_vector
from pipeline.simulator.motion import Motion, Signal, Wave
from pipeline.simulator.scene import MotionScene, SwayScene

_KNOTS_AN_EASING = 8
_FINE = 16


def motion_of(scene: MotionScene, until_s: float) -> Motion:
    """Return the motion over 0 … ``until_s``; after the last leg the camera stands."""
    return Motion(
        distance_mm=_way(scene, until_s),
        x_mm=_sway(scene.x_mm, until_s),
        y_mm=_sway(scene.y_mm, until_s),
        yaw_rad=_sway(scene.yaw_deg, until_s, math.radians(1)),
        pitch_rad=_sway(scene.pitch_deg, until_s, math.radians(1)),
        roll_rad=_sway(scene.roll_deg, until_s, math.radians(1)),
    )


def _way(scene: MotionScene, until_s: float) -> Signal:
    """Return the distance: speeds averaged over the easing time, and integrated."""
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
