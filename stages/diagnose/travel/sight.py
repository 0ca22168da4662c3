"""Distance travelled according to pictures alone, the encoder's readings, and where the probe turned."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pipeline.arrays import Bool, Float, Int
from pipeline.artefacts.measured import Trajectory
from pipeline.recording.base import Encoder, Illumination, Recording
from stages.calibrate.gauge.edges import Edges
from stages.calibrate.gauge.state import Unknowns
from stages.calibrate.gauge.terms import edge_equations
from stages.diagnose.effects.base import Travel
from stages.diagnose.effects.library import LIBRARY

# 1 σ of a picture's position from fiducials, which may be misplaced. Debt: data/debts.md.
PLACED_SIGMA_MM = 0.05
_END_READINGS = 20
# Unknowns of a pose, and 1 σ of each, mm and rad, before anything is measured: any so large a number does.
_POSE, _NOTHING_KNOWN = 6, 1000.0
_ROUNDING_MM, _WHOLE = 2e-4, 0.02


@dataclass(frozen=True)
class Sight:
    """The camera's motion in frames whose own picture determines its position along the pipe.

    Attributes
    ----------
    frame : (N,) int
        Frame numbers.
    time_s : (N,)
    distance_mm : (N,)
        Along the pipe; from poses estimated without the encoder.
    path_mm : (N,)
        Total path travelled to and fro, over which drift accumulates.
    scale_sigma : float
        Relative 1 σ of the scale of ``distance_mm``.
    frame_time_s : float
        Usual time from one frame of the recording to the next.
    placed : bool
        Whether fiducials determine every picture independently, so that errors do not persist.
    """

    frame: Int
    time_s: Float
    distance_mm: Float
    path_mm: Float
    scale_sigma: float
    frame_time_s: float
    placed: bool = False

    @cached_property
    def direction(self) -> Float:
        """(N,) +1 or −1: the direction of the probe's motion, or of the last one before it stopped."""
        step = np.gradient(self.distance_mm)
        # The probe stands where a step is below a twentieth of the usual one (chosen).
        still = np.abs(step) < 0.05 * np.percentile(np.abs(step), 90)
        last = np.maximum.accumulate(np.where(still, -1, np.arange(len(step))))
        first = int(np.argmax(~still))
        return np.asarray(np.sign(step[np.where(last < 0, first, last)]))

    @property
    def reverses(self) -> bool:
        """Whether the probe moves both ways."""
        return len(np.unique(self.direction)) > 1

    def select(self, keep: Bool) -> Sight:
        """Return the frames where ``keep`` (N,) is true."""
        return replace(
            self, frame=self.frame[keep], time_s=self.time_s[keep],
            distance_mm=self.distance_mm[keep], path_mm=self.path_mm[keep],
        )  # fmt: skip


def sight_of_trajectory(recording: Recording, trajectory: Trajectory) -> Sight:
    """Return the motion in a field recording, from a trajectory made without the encoder.

    Only lit frames are used: in the others the pose is interpolated. Frames whose texture was lost are left
    out.
    """
    lit = np.isin(trajectory.frame, recording.frames.of(Illumination.LED, Illumination.BOTH))
    for event in trajectory.events:
        if event.kind == "texture_lost":
            lit &= (trajectory.frame < event.frame_from) | (trajectory.frame > event.frame_to)
    return _sight(recording, trajectory.frame, trajectory.T_pc[:, 2, 3], lit, trajectory.scale_sigma)


def sight_of_poses(recording: Recording, T_pc: Float, index: Int, scale_sigma: float) -> Sight:
    """Return the motion in a gauge run from poses (N, 4, 4), in frames with fiducials (``index``)."""
    posed = np.zeros(len(T_pc), bool)
    posed[index] = True
    return replace(_sight(recording, recording.frames.frame, T_pc[:, 2, 3], posed, scale_sigma), placed=True)


def place_sigma_mm(state: Unknowns, edges: Edges) -> Float:
    """Return the 1 σ (N,), mm, of each frame's place along the pipe by its own edges of fiducials alone.

    Where borders across the pipe are too narrow to be measured, or no border is, the place is not determined
    by the picture but by the frames around it, and σ is large.
    """
    rows = edge_equations(state, edges).rows
    by_pose = rows.by_frame[:, 0, :_POSE]
    information = np.tile(np.eye(_POSE) * _NOTHING_KNOWN**-2, (len(state.T_pc), 1, 1))
    each = rows.weight[:, None, None] * by_pose[:, :, None] * by_pose[:, None]
    np.add.at(information, rows.frame[:, 0], each)
    return np.asarray(np.sqrt(np.linalg.inv(information)[:, 2, 2]))


def readings_at(encoder: Encoder, time_s: Float) -> Float:
    """Return readings (N,) at times (N,), extrapolated with constant speed beyond the ends."""
    held = np.clip(time_s, encoder.time_s[0], encoder.time_s[-1])
    last = min(_END_READINGS, len(encoder.time_s) - 1)
    early = (encoder.distance_mm[last] - encoder.distance_mm[0]) / (encoder.time_s[last] - encoder.time_s[0])
    late = (encoder.distance_mm[-1] - encoder.distance_mm[-1 - last]) / (
        encoder.time_s[-1] - encoder.time_s[-1 - last]
    )
    beyond = (time_s - held) * np.where(time_s < held, early, late)
    return np.asarray(np.interp(held, encoder.time_s, encoder.distance_mm) + beyond)


def quantum_mm(encoder: Encoder) -> float:
    """Return the finest unit of the readings, mm; 0 where every step differs."""
    sizes = np.unique(np.round(np.abs(np.diff(encoder.distance_mm)), 4))
    units = np.concatenate([sizes, np.diff(sizes)])
    units = units[units > _ROUNDING_MM]
    if not len(units):
        return 0.0
    unit = float(units.min())
    return unit if np.all(np.abs(sizes / unit - np.round(sizes / unit)) < _WHOLE) else 0.0


def _sight(recording: Recording, frame: Int, distance_mm: Float, use: Bool, scale_sigma: float) -> Sight:
    place = np.searchsorted(recording.frames.frame, frame)
    time_s = recording.frames.time_s[place]
    path = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(distance_mm[use])))]) if use.any() else np.zeros(0)
    frame_time = float(np.median(np.diff(recording.frames.time_s))) if len(time_s) > 1 else 0.0
    return Sight(frame[use], time_s[use], distance_mm[use], path[: int(use.sum())], scale_sigma, frame_time)


@dataclass(frozen=True)
class Turns:
    """Where the probe turned between two pictures: before picture ``place`` (K,), at ``distance_mm`` (K,)."""

    place: Int
    distance_mm: Float


def turns_between(sight: Sight, steady: Encoder, delay_s: float) -> Turns:
    """Return where the probe turned between pictures: as far beyond the last one as the reading still went.

    Until it turns, the reading follows the probe, whatever play follows.
    """
    way = sight.direction
    before = np.flatnonzero(way[1:] != way[:-1])
    place, distance = [], []
    for turn in before:
        # The direction is a mean over neighbours, so that the reversal may be a picture later or earlier.
        first, last = max(int(turn) - 1, 0), min(int(turn) + 2, len(way) - 1)
        inside = (steady.time_s > sight.time_s[first] + delay_s) & (
            steady.time_s < sight.time_s[last] + delay_s
        )
        if not inside.any():
            continue
        at = np.flatnonzero(inside)[np.argmax(way[turn] * steady.distance_mm[inside])]
        k = int(np.clip(np.searchsorted(sight.time_s, steady.time_s[at] - delay_s), 1, len(way) - 1))
        went = steady.distance_mm[at] - readings_at(steady, sight.time_s[k - 1 : k] + delay_s)[0]
        place.append(k)
        distance.append(sight.distance_mm[k - 1] + went)
    return Turns(np.array(place, np.int64), np.array(distance, float))


def lag_mm(sight: Sight, turns: Turns, play_mm: float) -> Float:
    """Return by how much (N,), mm, readings are ahead for play of that size."""
    way = np.insert(sight.distance_mm, turns.place, turns.distance_mm)
    same = np.zeros(len(way))
    travel = Travel(same, way, same)
    lag = LIBRARY["encoder_backlash"].reading_shift_mm(travel, (), np.array([play_mm]))
    return np.asarray(np.delete(lag, turns.place + np.arange(len(turns.place))))
