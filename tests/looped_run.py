"""A run forth and back without pictures or adjustment: windows that drift, and a wall to recognise."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np

from pipeline.arrays import Float, Float32, Int
from pipeline.geometry.axis import axis_through, frames_at, to_pipe
from pipeline.geometry.rigid import from_parts, rotation_from_vector
from stages.motion.loops.revisits import Passage
from stages.motion.tracking.strips import Strip, StripGrid
from stages.motion.windows.submap_joining import JoinedRun, join_submaps
from stages.motion.windows.submaps import SharedParameters, Submap, Window, cut_windows, handover

STEP_MM, FRAMES, LENGTH, OVERLAP, SHARED = 4.0, 400, 80, 30, 2
GRID = StripGrid(50.0, 720, 10.5, 64.0)
_FROM_MM = -100.0
# 1 σ of the drift from frame to frame: position, mm, and rotation, rad.
DRIFT = np.array([2e-3, 2e-3, 0.05, 2e-5, 2e-5, 2e-4])
_BEND_PER_MM = 2e-6
_BEND_FROM_MM, _BEND_TO_MM = 300.0, 600.0


@dataclass(frozen=True)
class LoopedRun:
    """The estimates of all windows, and the true distance (N,) and roll (N,)."""

    joined: JoinedRun
    distance_mm: Float
    roll_rad: Float

    @property
    def passage(self) -> Passage:
        """Return the estimated positions along the pipe of every other frame."""
        lit = np.arange(1, FRAMES, 2)
        return Passage.of(lit, self.believed()[0][lit], GRID.near_mm, GRID.far_mm)

    def believed(self, joined: JoinedRun | None = None) -> tuple[Float, Float, Float]:
        """Return distance, roll and offset (N, 2) from the axis as the run estimates them.

        The true offset is 0.
        """
        run = joined or self.joined
        distance, azimuth, radius = to_pipe(run.axis, run.T_pc[:, :3, 3])
        own = np.swapaxes(frames_at(run.axis, distance)[1], 1, 2) @ run.T_pc[:, :3, :3]
        roll = np.unwrap(np.arctan2(own[:, 1, 0], own[:, 0, 0]))
        return distance, roll, radius[:, None] * np.stack([np.cos(azimuth), np.sin(azimuth)], -1)


def looped_run(seed: int = 0, curvature_per_mm: float = 0.0) -> LoopedRun:
    """Return 400 frames, 0.8 m forth and back, in windows of 80 that each drift and bend a little.

    The pipe itself is straight up to 0.3 m, and bent from there to 0.6 m.
    """
    random, k = np.random.default_rng(seed), np.arange(FRAMES)
    distance = STEP_MM * np.minimum(k, FRAMES - 1 - k).astype(float)
    roll = 0.1 * np.sin(k / 60)
    windows = cut_windows(FRAMES, LENGTH, OVERLAP)
    submaps = [_submap(windows, n, distance, roll, curvature_per_mm, random) for n in range(len(windows))]
    return LoopedRun(
        join_submaps(submaps, SharedParameters(np.zeros(SHARED), np.eye(SHARED))), distance, roll
    )


def _submap(
    windows: tuple[Window, ...], n: int, distance_mm: Float, roll_rad: Float, curvature: float,
    random: np.random.Generator,
) -> Submap:  # fmt: skip
    window = windows[n]
    mine = slice(window.first, window.last)
    rate = DRIFT * random.standard_normal(6) / np.sqrt(LENGTH - OVERLAP)
    bend = _BEND_PER_MM * random.standard_normal()
    away = np.arange(window.frames) - window.frames // 2
    z = distance_mm[mine] + rate[2] * away
    origin, lean = _bent(z, bend, float(z.mean()), curvature)
    roll = roll_rad[mine] + rate[5] * away
    turn = rotation_from_vector(np.stack([0 * z, lean, 0 * z], -1))
    T_pc = from_parts(turn @ rotation_from_vector(np.stack([0 * z, 0 * z, roll], -1)), origin)
    along = np.arange(z.min() - 20.0, z.max() + 90.0, 2.0)
    axis = axis_through(
        _bent(along, bend, float(z.mean()), curvature)[0], np.array([1.0, 0, 0]), float(along[0])
    )
    anchor = handover(windows[n - 1], window) - window.first if n else 0
    end = handover(window, windows[n + 1]) - window.first if n + 1 < len(windows) else window.frames - 1
    some = np.unique(np.linspace(anchor, end, 8).astype(int))
    together = np.minimum.outer(some - anchor, some - anchor).astype(float)
    joint = together[:, None, :, None] * np.diag(DRIFT**2)[None, :, None, :]
    zero = np.zeros(window.frames)
    response = np.zeros((len(some), 6, SHARED))
    return Submap(window, T_pc, zero, axis, 50.0, anchor, some, joint, response, 0.01, np.zeros(SHARED))


def _bent(z: Float, bend: float, middle: float, curvature: float) -> tuple[Float, Float]:
    """Return points (n, 3) and lean (n,) of a pipe estimated to bend about a middle beside its true bend."""
    s = np.arange(-200.0, 1200.0, 0.5)
    lean = curvature * np.clip(s - _BEND_FROM_MM, 0, _BEND_TO_MM - _BEND_FROM_MM) + bend * (s - middle)
    x, along = (
        0.5 * np.concatenate([[0.0], np.cumsum(f((lean[:-1] + lean[1:]) / 2))]) for f in (np.sin, np.cos)
    )
    start = np.interp(0.0, s, along)
    return np.stack([np.interp(z, s, x), 0 * z, np.interp(z, s, along) - start], -1), np.interp(z, s, lean)


def rough_wall(seed: int = 1, repeat_mm: float | None = None, welds_every_mm: float | None = None) -> Float32:
    """Return contrast from −100 to 1000 mm: natural, repeating itself, or with identical bands."""
    rows = round(1100 / GRID.step_mm)
    random = np.random.default_rng(seed)
    white = random.standard_normal((rows, GRID.columns)).astype(np.float32)
    if repeat_mm is not None:
        white = np.resize(white[: round(repeat_mm / GRID.step_mm)], white.shape)
    wide = np.concatenate([white[:, -20:], white, white[:, :20]], 1)
    smooth = cv2.GaussianBlur(wide, (0, 0), 2.0)[:, 20:-20]
    wall = 0.15 * smooth / smooth.std()
    if welds_every_mm is not None:
        z = _FROM_MM + GRID.step_mm * np.arange(rows)
        off = np.abs((z + welds_every_mm / 2) % welds_every_mm - welds_every_mm / 2)
        bead = np.random.default_rng(9).standard_normal((rows, GRID.columns)).astype(np.float32)
        bead = cv2.GaussianBlur(
            np.resize(bead[: round(welds_every_mm / GRID.step_mm)], wall.shape), (0, 0), 2.0
        )
        wall = np.where((off < 4.0)[:, None], 0.5 + 0.15 * bead / bead.std(), wall)
    return np.asarray(wall, np.float32)


@dataclass(frozen=True)
class DrawnView:
    """Unrolls a drawn wall as seen by frames whose estimated poses are wrong.

    ``later_wall`` is the wall that frames of the second half see; ``shifted_mm`` gives how far the wall of
    some frames is moved, keyed by frame.
    """

    run: LoopedRun
    wall: Float32
    later_wall: Float32
    shifted_mm: dict[int, float]

    @property
    def grid(self) -> StripGrid:
        """Sampling of the strips."""
        return GRID

    def strips(self, place: Int, T_pc: Float) -> Iterator[Strip | None]:
        """Yield the strips that frames with the estimated poses see in the straightened pipe."""
        for frame, T in zip(place.tolist(), T_pc, strict=True):
            yield self._strip(frame, T)

    def _strip(self, frame: int, T_pc: Float) -> Strip:
        first = int(np.ceil((T_pc[2, 3] + GRID.near_mm) / GRID.step_mm))
        ahead = T_pc[2, 3] - self.run.distance_mm[frame] + self.shifted_mm.get(frame, 0.0)
        turned = np.arctan2(T_pc[1, 0], T_pc[0, 0]) - self.run.roll_rad[frame]
        row = first + np.arange(GRID.rows) - (ahead + _FROM_MM) / GRID.step_mm
        column = np.mod(np.arange(GRID.columns) - turned * GRID.columns / (2 * np.pi), GRID.columns)
        wall = self.wall if frame < FRAMES // 2 else self.later_wall
        wide = np.concatenate([wall, wall[:, :2]], 1)
        x, y = np.meshgrid(column.astype(np.float32), row.astype(np.float32))
        noise = 0.01 * np.random.default_rng(frame).standard_normal(x.shape).astype(np.float32)
        seen = cv2.remap(wide, x, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE) + noise
        usable = np.ones(x.shape, bool)
        usable[:, 100:140] = False
        coarse = np.zeros((GRID.rows // 4 + 1, GRID.columns // 4 + 1, 2), np.float32)
        contrast = np.where(usable, seen, 0).astype(np.float32)
        return Strip(first, contrast, usable, coarse, np.full(GRID.rows, 0.01, np.float32))
