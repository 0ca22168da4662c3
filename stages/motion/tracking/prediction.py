"""Prediction of the camera's pose in the next frame, which tells where to look for texture."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Float
from pipeline.geometry.rigid import from_parts, rotation_from_vector
from stages.motion.encoder import EncoderReadings
from stages.motion.tracking.landmarks import TrackedPoses


class PosePredictor:
    """Predicts poses in the straightened pipe.

    Distance and roll go on at constant speed (distance as the encoder advances, where there is one); the
    rings say where the pipe's axis passes; pitch and yaw are taken as zero.

    Parameters
    ----------
    time_s : (N,)
        Of all frames.
    encoder : EncoderReadings or None
    centre_c : (N, 2)
        Where the pipe's axis passes the laser's plane, mm in C.
    """

    def __init__(self, time_s: Float, encoder: EncoderReadings | None, centre_c: Float) -> None:
        self._time, self._centre, self._encoder = time_s, centre_c, encoder
        self._known: list[tuple[int, float, float]] = []  # frame, distance, roll of the last two

    def learn(self, frame: int, T_pc: Float) -> None:
        """Take note of a frame's pose (4, 4)."""
        roll = float(np.arctan2(T_pc[1, 0], T_pc[0, 0]))
        self._known = [*self._known[-1:], (frame, float(T_pc[2, 3]), roll)]

    def predict(self, frame: int) -> Float:
        """Return the predicted pose (4, 4) of a frame."""
        z, roll = self._distance_and_roll(frame)
        rotation = rotation_from_vector(np.array([0, 0, roll]))
        offset = rotation @ np.append(-self._centre[frame], 0.0)
        return from_parts(rotation, offset + np.array([0, 0, z]))

    def between(self, tracked: TrackedPoses) -> Float:
        """Return first guesses (N, 4, 4) of all poses, interpolated between those that were tracked."""
        count = len(self._time)
        z = self._encoder.distance_mm if self._encoder is not None else np.zeros(count)
        roll = np.zeros(count)
        if len(tracked.frames):
            every, T_pc = np.arange(count), tracked.T_pc
            z = np.interp(every, tracked.frames, T_pc[:, 2, 3])
            roll = np.interp(every, tracked.frames, np.unwrap(np.arctan2(T_pc[:, 1, 0], T_pc[:, 0, 0])))
        turn = rotation_from_vector(np.stack([0 * roll, 0 * roll, roll], -1))
        centre = np.concatenate([-self._centre, np.zeros((count, 1))], 1)
        origin = np.einsum("nij,nj->ni", turn, centre)
        origin[:, 2] = z
        return from_parts(turn, origin)

    def _distance_and_roll(self, frame: int) -> tuple[float, float]:
        if not self._known:
            return 0.0, 0.0
        last, z, roll = self._known[-1]
        before, z_before, roll_before = self._known[0]
        ratio = (self._time[frame] - self._time[last]) / max(self._time[last] - self._time[before], 1e-9)
        turn = (roll - roll_before + np.pi) % (2 * np.pi) - np.pi
        if self._encoder is not None and self._encoder.known[[last, frame]].all():
            advance = self._encoder.distance_mm[frame] - self._encoder.distance_mm[last]
            return z + float(advance), roll + turn * ratio
        return z + (z - z_before) * ratio, roll + turn * ratio
