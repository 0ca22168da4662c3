"""Finds events of the motion: stops, reversals, slip, dropped and duplicated frames, lost texture."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pipeline.arrays import Bool, Float, Int, runs_of
from pipeline.artefacts.measured import Trajectory
from pipeline.artefacts.motion import MotionEvent
from pipeline.geometry.axis import distance_along
from pipeline.machine.stage import Context
from pipeline.recording.base import FrameTable
from stages.motion.tracking.landmarks import TrackedPoses

# Events inform and change no result. None of their bounds was measured; each keeps a steadily driven probe
# free of events (`test_steady_motion_has_no_events`).
_FEWEST_FRAMES = 5
_CRUISE_PERCENT = 90.0
"""The usual speed is the one that nine in ten frames do not exceed."""
_STOP_SHARE = 0.03
_LEAST_SPEED_MM_S = 0.05
_SHORTEST_STOP_S = 0.3
"""A stop is slower than 3 % of the usual speed, or than 0.05 mm/s, for 0.3 s."""
_MOVING_SHARE = 0.05
_SHORTEST_REVERSAL_MM = 0.5
"""A reversal is faster than 5 % of the usual speed and longer than 0.5 mm."""
_GAP_TIMES = 1.6
"""A gap of the clock is longer than so many usual frame times: nearer to two than to one, with some
jitter."""
_SAME_SHARE = 0.05
_LEAST_STEP_MM = 0.05
_MOST_DUPLICATES = 50
"""A duplicated frame moved by less than 5 % of the steps beside it, which are longer than 0.05 mm. No more
than 50 are listed."""
_SLIP_SPREADS = 6.0
_SLIP_STEP_MM = 0.02
_SLIP_MM = 0.3
"""A slip is a row of steps of the encoder's slip beyond six spreads and 0.02 mm, 0.3 mm in all."""
_QUIETEST, _OF_NORMAL = 0.25, 0.3186
"""The spread is estimated from the smallest quarter of the steps in which the probe moves, because encoders
may hang for most of a run. A quarter of normal values with σ = 1 are below the second number."""
_REPORTED_SIGMAS = 5.0
"""A slip is reported from this many σ on, with the σ of the distance over which it occurs."""
_REPORTED_MM = 3.0
"""Smaller slips are not reported (chosen): rings bridge them, and a wheel at rest has some play."""
_ONE_SENSE = 3.0
"""Small slips are reported together if their sum exceeds this many times the root of the sum of their
squares, as one in 400 sums of random signs does. The slips of a probe that jerks cancel."""
_SLIP_CAUSES = (
    ": the wheel slipped or hung, readings stop, or a noise filter held the texture back. Distances "
    "there follow laser and texture. What to do: check that the wheel is pressed to the wall and turns, and "
    "that encoder.csv is complete"
)


def find_events(
    frames: FrameTable, trajectory: Trajectory, tracked: TrackedPoses, slip: Float, has_encoder: bool
) -> tuple[MotionEvent, ...]:
    """Return the events in the order of their frames.

    Parameters
    ----------
    frames, trajectory, tracked
    slip : (N,)
        Encoder's accumulated slip, mm.
    has_encoder : bool
        Whether there is an encoder; without one ``slip`` is not used.
    """
    z, t, f = distance_along(trajectory.axis, trajectory.T_pc), frames.time_s, frames.frame
    if len(z) < _FEWEST_FRAMES:
        return ()
    speed = np.gradient(z, np.maximum.accumulate(t + 1e-9 * np.arange(len(t))))
    cruise = float(np.percentile(np.abs(speed), _CRUISE_PERCENT))
    found = [*_stops(f, t, speed, cruise), *_reversals(f, z, speed, cruise), *_gaps(f, t)]
    found += [*_duplicates(f, z, tracked), *_lost(f, tracked)]
    if has_encoder:
        found += list(_slips(f, z, slip))
    return tuple(sorted(found, key=lambda e: (e.frame_from, e.kind)))


def warn_of_slips(
    events: tuple[MotionEvent, ...],
    trajectory: Trajectory,
    slip: Float,
    scale_sigma: float,
    reading_sigma_mm: float,
    context: Context,
) -> None:
    """Warn where encoder and texture disagree by more than the encoder's σ and its clock explain.

    Each slip is compared with its σ, which combines the encoder's scale over the distance of the slip, two
    readings, and the usual distance per frame, by which the clocks of encoder and pictures may differ. If no
    single slip is significant, their sum is tested in the same way, as far as the encoder did not make up for
    it between them.

    Parameters
    ----------
    events, trajectory
    slip : (N,)
        Encoder's accumulated slip, mm.
    scale_sigma
        1 σ of the encoder's scale (1).
    reading_sigma_mm
        1 σ of a reading, mm.
    context
    """
    z = distance_along(trajectory.axis, trajectory.T_pc)
    frame_mm = float(np.percentile(np.abs(np.diff(z)), _CRUISE_PERCENT)) if len(z) > 1 else 0.0
    slips = [e for e in events if e.kind == "encoder_slip"]
    first = np.searchsorted(trajectory.frame, [e.frame_from for e in slips])
    last = np.searchsorted(trajectory.frame, [e.frame_to for e in slips])
    size = np.array([e.size for e in slips])
    way = np.abs(z[last] - z[first]) + np.abs(size)
    sigma = np.sqrt((scale_sigma * way) ** 2 + 2 * reading_sigma_mm**2 + frame_mm**2)
    significant = np.flatnonzero(_is_significant(np.abs(size), sigma))
    whole = _kept_sum(size, float(slip[last[-1]] - slip[first[0]])) if len(slips) else 0.0
    whole_sigma = np.sqrt(
        scale_sigma**2 * way.sum() ** 2 + 2 * len(slips) * reading_sigma_mm**2 + frame_mm**2
    )
    if len(significant):
        worst = slips[significant[np.argmax(np.abs(size[significant]))]]
        elsewhere = f", and in {len(significant) - 1} other places" if len(significant) > 1 else ""
        context.warn(
            f"encoder and wall's texture disagree by {abs(worst.size):.1f} mm between frame "
            f"{worst.frame_from} and {worst.frame_to}{elsewhere}{_SLIP_CAUSES}"
        )
    elif _is_significant(whole, whole_sigma) and whole > _ONE_SENSE * np.linalg.norm(size):
        context.warn(
            f"encoder and wall's texture disagree {len(slips)} times by up to {np.abs(size).max():.1f} mm, "
            f"each too small to be certain alone, and by {whole:.1f} mm in total between frame "
            f"{slips[0].frame_from} and {slips[-1].frame_to}{_SLIP_CAUSES}"
        )


def _kept_sum(size_mm: Float, net_mm: float) -> float:
    """Return the size of the sum of slips (K,), mm, or of the net slip if smaller; 0 if their signs differ.

    The net slip from first to last matters if the encoder's clock is late: each sudden start of the probe
    then looks like a slip in one direction, and its slow stop makes up for it in steps too small to be slips.
    """
    total = float(size_mm.sum())
    return min(abs(total), abs(net_mm)) if total * net_mm > 0 else 0.0


def _is_significant(size_mm: Float | float, sigma_mm: Float | float) -> Bool:
    return np.asarray((size_mm > _REPORTED_MM) & (size_mm > _REPORTED_SIGMAS * sigma_mm))


def _ends_of_runs(mask: Bool) -> list[tuple[int, int]]:
    """Return first and last index of each run of true."""
    return [(run.start, run.stop - 1) for run in runs_of(mask)]


def _stops(f: Int, t: Float, speed: Float, cruise: float) -> Iterator[MotionEvent]:
    for a, b in _ends_of_runs(np.abs(speed) < max(_STOP_SHARE * cruise, _LEAST_SPEED_MM_S)):
        if t[b] - t[a] >= _SHORTEST_STOP_S:
            lasted = float(t[b] - t[a])
            yield MotionEvent("stop", int(f[a]), int(f[b]), lasted, "s", "The probe stood still.")


def _reversals(f: Int, z: Float, speed: Float, cruise: float) -> Iterator[MotionEvent]:
    moving = np.where(np.abs(speed) > _MOVING_SHARE * cruise, np.sign(speed), 0)
    main = 1 if z[-1] >= z[0] else -1
    for a, b in _ends_of_runs(moving == -main):
        back = float(abs(z[b] - z[a]))
        if back > _SHORTEST_REVERSAL_MM:
            yield MotionEvent("reversal", int(f[a]), int(f[b]), back, "mm", "The probe moved back.")


def _gaps(f: Int, t: Float) -> Iterator[MotionEvent]:
    step = np.diff(t)
    usual = float(np.median(step))
    for k in np.flatnonzero(step > _GAP_TIMES * usual):
        lost = float(round(step[k] / usual) - 1)
        note = "The frames' times jump here: frames are missing."
        yield MotionEvent("dropped_frames", int(f[k]), int(f[k + 1]), lost, "frames", note)


def _duplicates(f: Int, z: Float, tracked: TrackedPoses) -> Iterator[MotionEvent]:
    step = np.abs(np.diff(z[tracked.frames]))
    if len(step) < 3:
        return
    beside = np.minimum(np.roll(step, 1), np.roll(step, -1))
    same = (step < _SAME_SHARE * beside) & (beside > _LEAST_STEP_MM)
    note = "The wall did not move between these frames, but before and after: one picture was recorded twice."
    for k in np.flatnonzero(same)[:_MOST_DUPLICATES]:
        if 0 < k < len(step) - 1:
            a, b = tracked.frames[k], tracked.frames[k + 1]
            yield MotionEvent("duplicated_frame", int(f[a]), int(f[b]), 1.0, "frames", note)


def _lost(f: Int, tracked: TrackedPoses) -> Iterator[MotionEvent]:
    note = "The wall showed too little texture to be followed."
    for a, b in _ends_of_runs(tracked.lost & (np.arange(len(tracked.lost)) > 0)):
        first, last = int(f[tracked.frames[a]]), int(f[tracked.frames[b]])
        yield MotionEvent("texture_lost", first, last, float(b - a + 1), "lit frames", note)


def _slips(f: Int, z: Float, slip: Float) -> Iterator[MotionEvent]:
    step, way = np.diff(slip), np.abs(np.diff(z))
    moves = way >= _STOP_SHARE * np.percentile(way, _CRUISE_PERCENT)
    usual = float(np.quantile(np.abs(step[moves]), _QUIETEST)) / _OF_NORMAL + 1e-6
    note = "The encoder and the wall's texture disagree: the encoder slipped."
    for a, b in _ends_of_runs(np.abs(step) > max(_SLIP_SPREADS * usual, _SLIP_STEP_MM)):
        size = float(slip[b + 1] - slip[a])
        if abs(size) > _SLIP_MM:
            yield MotionEvent("encoder_slip", int(f[a]), int(f[b + 1]), size, "mm", note)
