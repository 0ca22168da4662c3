"""What the motion showed: stops, reversals, slip, dropped and duplicated frames, lost texture."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pipeline.adjustment.robust import robust_spread
from pipeline.arrays import Bool, Float, Int
from pipeline.artefacts.measured import MotionEvent, Trajectory
from pipeline.geometry.axis import distance_along
from pipeline.recording.base import FrameTable
from stages.motion.tracking.observations import Course

_STOP_SHARE = 0.03
_SHORTEST_STOP_S = 0.3
_SLIP_MM = 0.3


def find_events(
    frames: FrameTable, trajectory: Trajectory, tracks: Course, slip: Float, has_encoder: bool
) -> tuple[MotionEvent, ...]:
    """Return the events in the order of their frames."""
    z, t, f = distance_along(trajectory.axis, trajectory.T_pc), frames.time_s, frames.frame
    if len(z) < 5:
        return ()
    speed = np.gradient(z, np.maximum.accumulate(t + 1e-9 * np.arange(len(t))))
    cruise = float(np.percentile(np.abs(speed), 90))
    found = [*_stops(f, t, speed, cruise), *_reversals(f, z, speed, cruise), *_gaps(f, t)]
    found += [*_duplicates(f, z, tracks), *_lost(f, tracks)]
    if has_encoder:
        found += list(_slips(f, slip))
    return tuple(sorted(found, key=lambda e: (e.frame_from, e.kind)))


def _runs(mask: Bool) -> Iterator[tuple[int, int]]:
    """Yield first and last index of each run of true."""
    edge = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int)))
    for a, b in zip(edge[::2], edge[1::2], strict=True):
        yield int(a), int(b) - 1


def _stops(f: Int, t: Float, speed: Float, cruise: float) -> Iterator[MotionEvent]:
    for a, b in _runs(np.abs(speed) < max(_STOP_SHARE * cruise, 0.05)):
        if t[b] - t[a] >= _SHORTEST_STOP_S:
            yield MotionEvent("stop", int(f[a]), int(f[b]), float(t[b] - t[a]), "s", "the probe stood still")


def _reversals(f: Int, z: Float, speed: Float, cruise: float) -> Iterator[MotionEvent]:
    moving = np.where(np.abs(speed) > 0.05 * cruise, np.sign(speed), 0)
    main = 1 if z[-1] >= z[0] else -1
    for a, b in _runs(moving == -main):
        back = float(abs(z[b] - z[a]))
        if back > 0.5:
            yield MotionEvent("reversal", int(f[a]), int(f[b]), back, "mm", "the probe moved back")


def _gaps(f: Int, t: Float) -> Iterator[MotionEvent]:
    step = np.diff(t)
    usual = float(np.median(step))
    for k in np.flatnonzero(step > 1.6 * usual):
        lost = float(round(step[k] / usual) - 1)
        yield MotionEvent("dropped_frames", int(f[k]), int(f[k + 1]), lost, "frames", "the clock jumps")


def _duplicates(f: Int, z: Float, tracks: Course) -> Iterator[MotionEvent]:
    step = np.abs(np.diff(z[tracks.frames]))
    if len(step) < 3:
        return
    around = np.minimum(np.roll(step, 1), np.roll(step, -1))
    for k in np.flatnonzero((step < 0.05 * around) & (around > 0.05))[:50]:
        if 0 < k < len(step) - 1:
            a, b = tracks.frames[k], tracks.frames[k + 1]
            yield MotionEvent("duplicated_frame", int(f[a]), int(f[b]), 1.0, "frames", "no motion between")


def _lost(f: Int, tracks: Course) -> Iterator[MotionEvent]:
    for a, b in _runs(tracks.lost & (np.arange(len(tracks.lost)) > 0)):
        first, last = int(f[tracks.frames[a]]), int(f[tracks.frames[b]])
        yield MotionEvent("texture_lost", first, last, float(b - a + 1), "lit frames", "too little texture")


def _slips(f: Int, slip: Float) -> Iterator[MotionEvent]:
    step = np.diff(slip)
    usual = robust_spread(step) + 1e-6
    for a, b in _runs(np.abs(step) > max(6 * usual, 0.02)):
        size = float(slip[b + 1] - slip[a])
        if abs(size) > _SLIP_MM:
            yield MotionEvent("encoder_slip", int(f[a]), int(f[b + 1]), size, "mm", "encoder and wall differ")
