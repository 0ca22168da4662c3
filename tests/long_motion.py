"""Inputs of the motion stage for a straight pipe of any length, without pictures.

Tracks, rings, an encoder.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Float
from pipeline.geometry.rigid import from_parts, inverse, rotation_from_vector, transform
from pipeline.instrument.probe import Probe
from pipeline.machine.scratch import Scratch
from stages.motion.bore import ONE_BORE
from stages.motion.encoder import EncoderReadings
from stages.motion.parameters import MotionParameters
from stages.motion.rings import RingCircles
from stages.motion.tracking.landmarks import OBSERVATION, ObservationStore, TrackedPoses
from stages.motion.tracking.strips import StripGrid
from stages.motion.tracking.tracker import TrackedTexture
from stages.motion.windows.measured_run import MeasuredRun
from tests.drawn_run import RADIUS, rings_on_wall, small_probe

SCALE, SIGMA_PX, ENCODER_SIGMA_MM = 1.001, 0.1, 0.005
_NEAR, _FAR = np.radians(78.0), np.radians(38.0)
_AT_ONCE = 4000


@dataclass(frozen=True)
class LongMotion:
    """The measurements, and the true poses (N, 4, 4) relative to the first one."""

    run: MeasuredRun
    T_pc: Float


def long_motion(
    frames: int, step_mm: float = 0.6, landmarks_per_mm: float = 20.0, seed: int = 0
) -> LongMotion:
    """Return a run with alternating laser and LED frames, at constant speed with a slow wobble."""
    random, probe, k = np.random.default_rng(seed), small_probe(), np.arange(frames)
    T_pc = _poses(step_mm * k)
    laser = k[::2]
    rings = rings_on_wall(probe, T_pc, laser, random, sigma_px=0.05, azimuths=144)
    grid = StripGrid(RADIUS, 960, RADIUS / np.tan(_NEAR), RADIUS / np.tan(_FAR))
    store = ObservationStore.on(Scratch(), MotionParameters.model_validate({}).most_observations)
    last = 0.0
    count = round(landmarks_per_mm * (step_mm * frames + 60))
    place = np.sort(random.uniform(0, step_mm * frames + 60, count))
    for first in range(0, count, _AT_ONCE):
        _observe(store, probe, grid, T_pc, place[first : first + _AT_ONCE], first, step_mm, random)
        last = float(place[min(first + _AT_ONCE, count) - 1])
    assert last > 0
    lit = k[1::2]
    guess = _guessed(T_pc)
    texture = TrackedTexture(store, grid, TrackedPoses(lit, guess[lit], np.zeros(len(lit), bool)))
    distance = step_mm * k / SCALE + ENCODER_SIGMA_MM * random.standard_normal(frames)
    encoder = EncoderReadings(distance - distance[0], ENCODER_SIGMA_MM, np.ones(frames, bool))
    circles = RingCircles(laser, np.zeros((len(laser), 2)), np.full(len(laser), RADIUS))
    run = MeasuredRun(texture, rings, laser, k / 30, guess, encoder, probe, ONE_BORE, circles)
    return LongMotion(run, T_pc)


def _poses(z_mm: Float) -> Float:
    turn = np.stack([0.004 * np.sin(z_mm / 90), 0.003 * np.sin(z_mm / 70), 0.05 * np.sin(z_mm / 300)], -1)
    origin = np.stack([0.4 * np.sin(z_mm / 80), 0.3 * np.sin(z_mm / 60), z_mm], -1)
    return from_parts(rotation_from_vector(turn), origin)


def _guessed(T_pc: Float) -> Float:
    """Return poses as the tracker estimates them.

    Without pitch and yaw, and with distances slightly too long.
    """
    roll = np.arctan2(T_pc[:, 1, 0], T_pc[:, 0, 0])
    origin = T_pc[:, :3, 3] * np.array([1, 1, 1.002])
    return from_parts(rotation_from_vector(np.stack([0 * roll, 0 * roll, roll], -1)), origin)


def _observe(
    store: ObservationStore, probe: Probe, grid: StripGrid, T_pc: Float, s: Float, number: int,
    step_mm: float, random: np.random.Generator,
) -> None:  # fmt: skip
    psi = random.uniform(-np.pi, np.pi, len(s))
    xyz = np.stack([RADIUS * np.cos(psi), RADIUS * np.sin(psi), s], -1)
    span = int((grid.far_mm - grid.near_mm) / step_mm) + 1
    first = np.ceil((s - grid.far_mm) / step_mm).astype(np.int64)
    frame = first[:, None] + np.arange(span)
    seen = (frame >= 0) & (frame < len(T_pc)) & (frame % 2 == 1)
    landmark, frame = np.broadcast_to(np.arange(len(s))[:, None], seen.shape)[seen], frame[seen]
    records = np.zeros(len(frame), OBSERVATION)
    uv = probe.camera.project(transform(inverse(T_pc[frame]), xyz[landmark])).uv
    records["landmark"], records["frame"] = number + landmark, frame
    records["uv"] = uv + SIGMA_PX * random.standard_normal(uv.shape)
    records["sigma"] = SIGMA_PX
    row, column = 1.002 * s / step_mm, (psi + np.pi) * (grid.columns / (2 * np.pi))
    records["at"] = np.stack([row, column], -1)[landmark]
    store.open.append(records)
    store.write()
