"""Estimates the delay of the encoder's clock relative to the pictures' clock from the motion.

A reading is the scaled distance at a shifted time. The residual is rounding, and a random walk that models
slips of the wheel and drifts of the estimate. The difference is whitened by both and fitted robustly at
every delay; of several strengths of the walk the most likely is taken.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solve_triangular

from pipeline.adjustment.robust import Cauchy, GemanMcClure
from pipeline.arrays import Float
from pipeline.geometry.axis import distance_along
from pipeline.machine.stage import Context
from pipeline.recording.base import FrameTable
from stages.motion.bundle_adjustment.equations import Measurements
from stages.motion.bundle_adjustment.solver import Estimate
from stages.motion.bundle_adjustment.unknowns import ENCODER_SCALE
from stages.motion.encoder import EncoderReadings, contradicted, warn_of_contradiction
from stages.motion.tracking.landmarks import TrackedPoses

_LONGEST_S = 1.0
"""Longest delay tried: an encoder that is off by more than a second shows another motion and is left out
(`stages.motion.encoder.contradicted`). Delays are tried by whole frames, because between two frames the
rounding of both would be averaged."""
_OF_RUN = 0.2
"""Longest delay tried as a share of the run: three fifths of it are then compared. Chosen."""
_WALKS_MM = np.geomspace(0.002, 0.064, 6)
"""Strengths of the walk tried, mm per frame: motion from texture walks by .002 in open-1, slips by more."""
_SHORTER = 4.0
"""Delays are tried by no less than a fourth of the mean time between frames: where most come at once, by the
median of these times (1 µs) a million delays were tried. Chosen: pauses make the mean so much longer."""
_FRAMES = 400
"""Frames compared at most: a matrix of that size takes a hundredth of a second."""
_FEWEST = 30
_SURE = 5.0
"""Delays of fewer σ count as none: one in a million is larger by chance."""
_MOVES = 2.0
"""A delay matters if it moves the readings, after a shift and a scale, by more than twice their rounding. At
even speed any delay moves them by 1.4 times, since both are rounded; one of .2 s that moved them by 2.5
times was taken for a picture that shrinks (open-3 at half size)."""
_ROUNDS = 5
_STANDS = 1e-12
"""Share of the readings' mean square that must remain after removal of their mean, for them to move at
all."""
_REDESCENT = 2.5
"""Larger whitened differences are weighted down: they belong to slips, which could be taken for a delay."""


@dataclass(frozen=True)
class EncoderDelay:
    """Delay of the encoder's times relative to those of the pictures, s, with its 1 σ.

    ``better`` is the log likelihood ratio of the delay to none. It is needed in addition to σ: at even speed
    one delay is nearly as likely as another, even where the optimum is sharp. ``moves`` is the rms change of
    the readings by the delay after a shift and a scale, in σ of a reading.
    """

    delay_s: float
    sigma_s: float
    better: float
    moves: float

    @property
    def matters(self) -> bool:
        """Whether there is a delay, and one that moves distances."""
        certain = self.better > 0.5 * _SURE**2 and abs(self.delay_s) > _SURE * self.sigma_s
        return certain and self.moves > _MOVES

    def corrected(self, encoder: EncoderReadings, time_s: Float) -> EncoderReadings:
        """Return readings corrected to the times (N,) of the pictures; at one end they are unknown."""
        then = time_s + self.delay_s
        shown = encoder.known & (then >= time_s[0]) & (then <= time_s[-1])
        at_frames = np.interp(then, time_s, encoder.distance_mm)
        return EncoderReadings(at_frames - at_frames[0], encoder.sigma_mm, shown)

    def warn(self, context: Context) -> None:
        """Warn of clocks that differ."""
        if not self.matters:
            return
        way = "late" if self.delay_s > 0 else "early"
        context.warn(
            f"the times in encoder.csv are {abs(self.delay_s):.3f} ± {self.sigma_s:.3f} s {way} relative to "
            "the motion in the pictures; this is corrected. What to do: synchronise the clocks, or correct "
            "time_s"
        )


def in_step_with_wall(
    encoder: EncoderReadings, tracked: TrackedPoses, frames: FrameTable, context: Context
) -> EncoderReadings | None:
    """Return readings that agree with the wall's motion once their clock is corrected, or None; warn of both.

    A clock that is late by more than the time in which the probe starts and stops shows another motion in
    most steps, though nothing else is wrong with the encoder.
    """
    at_mm = np.interp(np.arange(len(frames.time_s)), tracked.frames, tracked.T_pc[:, 2, 3])
    delay = find_delay(frames.time_s, at_mm, encoder)
    if delay is not None and delay.matters:
        corrected = delay.corrected(encoder, frames.time_s)
        if not contradicted(corrected, tracked):
            delay.warn(context)
            return corrected
    warn_of_contradiction(encoder, tracked, frames.frame, context)
    return None


def delay_of_encoder(estimate: Estimate, measured: Measurements) -> EncoderDelay | None:
    """Return the delay of the encoder relative to the motion in the pictures; None without evidence.

    Where texture is weak, the estimate follows a late encoder. So one linear step without it is made first.
    What is wrong with that motion then looks like a delay as well: all equations must confirm it.
    """
    if measured.encoder is None or measured.tracks.poses.much_lost:
        return None
    try:
        step = estimate.without_encoder().adjusted.equations.step(0.0)
    except np.linalg.LinAlgError:
        return None
    state = estimate.state.step(step.frames, step.border, step.landmarks)
    found = find_delay(measured.time_s, distance_along(state.axis, state.T_pc), measured.encoder)
    if found is None or not found.matters:
        return found
    frame_s = _frame_time(measured.time_s)
    whole = replace(found, delay_s=frame_s * round(found.delay_s / frame_s))
    corrected = whole.corrected(measured.encoder, measured.time_s)
    return replace(found, better=min(found.better, _gained(estimate, measured.encoder, corrected)))


def _gained(estimate: Estimate, encoder: EncoderReadings, corrected: EncoderReadings) -> float:
    """Return by how much less all linear equations contradict each other with the corrected readings."""
    equations, scale = estimate.adjusted.equations, estimate.state.globals[ENCODER_SCALE]
    if equations.readings is None:
        return np.inf
    costs = []
    for distance_mm in (encoder.distance_mm, corrected.distance_mm):
        rows = list(equations.rows)
        row = rows[equations.readings]
        rows[equations.readings] = replace(
            row,
            residual=row.residual - scale * (distance_mm - encoder.distance_mm),
            sigma=np.where(corrected.known, row.sigma, np.inf),
        )
        with_readings = replace(equations, rows=tuple(rows))
        costs.append(with_readings.cost - with_readings.decrease(with_readings.step(0.0)))
    return float(costs[0] - costs[1])


def find_delay(time_s: Float, distance_mm: Float, encoder: EncoderReadings) -> EncoderDelay | None:
    """Return the delay of readings (N,) relative to distances (N,); None without evidence."""
    longest = min(_LONGEST_S, _OF_RUN * float(time_s[-1] - time_s[0]))
    inside = (time_s > time_s[0] + longest) & (time_s < time_s[-1] - longest) & encoder.known
    used = np.flatnonzero(inside)
    if len(used) < _FEWEST:
        return None
    used = used[:: -(-len(used) // _FRAMES)]
    step = _frame_time(time_s)
    delays = step * np.arange(-int(longest / step), int(longest / step) + 1)
    reading = np.interp(time_s[used] + delays[:, None], time_s, encoder.distance_mm).T
    costs = [_costs(distance_mm[used], reading, encoder.sigma_mm, walk) for walk in _WALKS_MM]
    cost = min(costs, key=np.min)
    best = int(np.argmin(cost))
    if not 0 < best < len(cost) - 1:
        return None
    slope, bend = (cost[best + 1] - cost[best - 1]) / 2, cost[best + 1] - 2 * cost[best] + cost[best - 1]
    better = float(cost[len(cost) // 2] - cost[best])
    sigma_s = step / float(np.sqrt(bend))
    moves = _moved_mm(reading[:, len(cost) // 2], reading[:, best]) / encoder.sigma_mm
    return EncoderDelay(float(delays[best] - step * slope / bend), sigma_s, better, moves)


def _frame_time(time_s: Float) -> float:
    """Return the usual time from one frame to the next, s; where most come at once, a part of their mean."""
    mean = float(time_s[-1] - time_s[0]) / (len(time_s) - 1)
    return max(float(np.median(np.diff(time_s))), mean / _SHORTER)


def _moved_mm(before: Float, after: Float) -> float:
    """Return the rms difference of readings (M,) after a shift and a scale between them."""
    by = np.column_stack([before, np.ones_like(before)])
    return float(np.std(after - by @ np.linalg.lstsq(by, after, rcond=None)[0]))


def _costs(z: Float, reading: Float, sigma_mm: float, walk_mm: float) -> Float:
    """Return the negative log likelihood (K,) of distances (M,) for the readings (M, K) at each delay."""
    count = np.arange(1.0, len(z) + 1)
    root = np.linalg.cholesky(sigma_mm**2 * np.eye(len(z)) + walk_mm**2 * np.minimum(count[:, None], count))
    white = solve_triangular(root, np.column_stack([z, np.ones_like(z), reading]), lower=True)
    steps = np.log(np.diagonal(root)).sum()
    return np.asarray(_misfits(white[:, 0], white[:, 1], white[:, 2:]) + steps, float)


def _misfits(z: Float, origin: Float, reading: Float) -> Float:
    """Return the robust costs (K,) of whitened distances (M,) by ``origin`` (M,) and each reading (M, K)."""
    one, redescending = np.ones_like(reading), GemanMcClure(_REDESCENT)
    weight, off = one, one
    for loss in (Cauchy(),) * _ROUNDS + (redescending,) * _ROUNDS:
        at_origin, whole = weight * origin[:, None], origin**2 @ weight
        rest = reading - origin[:, None] * (np.sum(at_origin * reading, 0) / whole)
        size, all_size = np.sum(weight * rest**2, 0), np.sum(weight * reading**2, 0)
        moves = size > _STANDS * all_size  # an encoder that stands has no scale
        scale = np.where(moves, z @ (weight * rest), 0.0) / np.where(moves, size, 1.0)
        off = z[:, None] - origin[:, None] * (z @ at_origin / whole) - rest * scale
        weight = loss.weight(off, one)
    return np.asarray(redescending.cost(off, one).sum(0), float)
