"""Simulated runs of a probe pulled by hand: it stops, turns and jerks, and pictures may be lost."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from pipeline.arrays import Float, Int
from pipeline.recording.base import Encoder, FrameTable
from stages.premises.losses import Steps, rows_by_motion

RADIUS_MM, RATE, MM_A_FRAME = 50.0, 30.0, 1.0
# The encoder starts this many frames before the pictures, and ends as long after them.
BESIDE = 30
# Errors of a step by phase correlation in open-3: a share of the step, and in radii; half of it in open-1.
RELATIVE, ABSOLUTE = 0.03, 0.0015
NOTHING = np.empty(0, np.int64)


@dataclass(frozen=True)
class Pulled:
    """A simulated run: the input of premises, and the true row (F,) of each picture."""

    steps: Steps
    table: FrameTable
    encoder: Encoder | None
    rhythm: int
    true_row: Int
    radius_mm: Float | float = RADIUS_MM

    def rows(self) -> Int:
        """Return the rows that premises assigns."""
        rows, sway = np.arange(len(self.true_row)), np.ones(len(self.true_row))
        given = self.steps, self.rhythm, self.table, self.encoder, sway
        return rows_by_motion(rows, *given, self.radius_mm)

    def over_steps(self) -> tuple[Int, Int]:
        """Return by how many rows each step (K,) goes on: as found, and in truth."""
        found, true = (np.diff(r[self.steps.end], prepend=0) for r in (self.rows(), self.true_row))
        return found, true

    def invented(self) -> int:
        """Return how many pictures are reported as lost that were not."""
        found, true = self.over_steps()
        return int(np.maximum(found - true, 0).sum())


def way_mm(frames: int, random: np.random.Generator, *, steady: bool = False) -> Float:
    """Return the distance (frames, 10), mm, of the probe at tenths of each frame's time."""
    if steady:
        return MM_A_FRAME * np.arange(10 * frames).reshape(frames, 10) / 10
    speed: list[float] = []
    while len(speed) < 10 * frames:
        kind = random.random()
        now = 0.0 if kind < 0.2 else random.uniform(0.5, 1.7) * (-1.0 if kind > 0.85 else 1.0)
        speed += [now] * int(10 * RATE * random.uniform(0.3, 2.0))
    hand_s = random.uniform(0.04, 0.2)
    smooth = gaussian_filter1d(np.array(speed[: 10 * frames]), 10 * RATE * hand_s)
    return np.asarray(MM_A_FRAME * np.cumsum(smooth).reshape(frames, 10) / 10)


def encoder_of(way: Float, rate_hz: float, quantum_mm: float, random: np.random.Generator) -> Encoder:
    """Return an encoder of so many readings a second; its readings start before the pictures."""
    fine_s = np.arange(way.size) / (10 * RATE)
    time_s = np.arange(random.uniform(0, 1 / rate_hz), fine_s[-1], 1 / rate_hz)
    read = np.interp(time_s, fine_s, way.ravel())
    return Encoder(time_s - BESIDE / RATE, quantum_mm * np.floor(read / quantum_mm) if quantum_mm else read)


def pulled(
    seed: int,
    *,
    frames: int = 400,
    rhythm: int = 2,
    encoder_hz: float = 100.0,
    quantum_mm: float = 0.0,
    lost: Int = NOTHING,
    steady: bool = False,
    errors: float = 1.0,
) -> Pulled:
    """Simulate a run: of each ``rhythm`` pictures one shows the wall.

    Some of the ``frames`` pictures are ``lost``. The table numbers the remaining pictures. ``encoder_hz`` of
    0 means no encoder; ``errors`` scales the errors of steps relative to those of open-3.
    """
    random = np.random.default_rng(seed)
    way = way_mm(frames + 2 * BESIDE, random, steady=steady)
    row = np.setdiff1d(np.arange(frames), lost)
    wall = np.flatnonzero(row % rhythm == 0)
    true = np.diff(way[BESIDE + row[wall], 0]) / RADIUS_MM
    error = errors * (RELATIVE * np.abs(true) + ABSOLUTE)
    steps = Steps(wall[:-1], wall[1:], true + error * random.standard_normal(len(true)))
    count = len(row)
    table = FrameTable(np.arange(count), np.arange(count) / RATE, np.full(count, "led"))
    encoder = encoder_of(way, encoder_hz, quantum_mm, random) if encoder_hz else None
    return Pulled(steps, table, encoder, rhythm, row)
