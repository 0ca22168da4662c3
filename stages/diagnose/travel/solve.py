"""Offset, scale, delay and play of an encoder by least absolute deviations, and the noise that remains."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dgelsy

from pipeline.adjustment.robust import spread_about_median
from pipeline.arrays import Float, Int
from pipeline.recording.base import Encoder
from stages.diagnose.travel.noise import SOLID, DriftNoise, Precision, whitened_fit
from stages.diagnose.travel.sight import Sight, Turns, lag_mm, readings_at, turns_between

OFFSET, SCALE, DELAY, PLAY = range(4)
SMOOTH = ("offset", "encoder_scale", "time_offset", "encoder_backlash")
_ROUNDS = 6
_LONGEST_S = 1.0
# Search for delay and play: points per side, finest step, tries of the play, rounds; relative spread of speed
# below which a delay is not determined.
_SEARCHED, _FINEST_S, _PLAYS, _QUICKLY, _SPEEDS = 8, 1e-3, 3, 8, 0.02
_WIDEST_MM, _PLAY_STEP_MM = 10.0, 0.025
# χ² of one parameter exceeds 19.5 by chance once in 10⁵; 23 leaves a margin for noise that is not exactly
# normal.
FAR_BETTER = 23.0
_LEAST_WHITE_MM = 0.002
_LAGS = (2, 4, 8, 16, 32)
# Least number of increments per lag: one or two steps among twelve do not change their median by much.
_PER_LAG = 12
_REWEIGHTINGS = 30


@dataclass(frozen=True)
class Asked:
    """Inputs of a fit: readings without jumps, visual distance (N,), and columns of events (N, E + D)."""

    sight: Sight
    steady: Encoder
    speed: Float
    of_events: Float
    without: tuple[str, ...]


@dataclass(frozen=True)
class End:
    """The result of a fit: reading − visual distance (N,), columns (N, 4 + E) there, and those held at 0."""

    held: tuple[int, ...]
    difference_mm: Float
    columns: Float

    def values(self, precision: Precision) -> Float:
        """Return the values (4 + E,); 0 for those held, and those that this motion does not determine."""
        free = _free(self.columns, self.held)
        fit = whitened_fit(self.difference_mm, self.columns[:, free], precision)
        out = np.zeros(self.columns.shape[1])
        out[free] = np.where(np.isfinite(np.diag(fit.covariance)), fit.estimate, 0.0)
        return out

    def misfit(self, precision: Precision) -> float:
        """Return χ² of the residual."""
        free = _free(self.columns, self.held)
        fit = whitened_fit(self.difference_mm, self.columns[:, free], precision)
        return float(fit.residual @ fit.weighted)


def _free(columns: Float, held: tuple[int, ...]) -> Int:
    return np.setdiff1d(np.arange(columns.shape[1]), held)


def starts(asked: Asked, delay_s: float, play_mm: float) -> list[tuple[tuple[int, ...], tuple[float, float]]]:
    """Return what is held at 0, and where the rest starts: delay and play both held, then one, then none."""
    every = [
        ((DELAY, PLAY), (0.0, 0.0)),
        ((PLAY,), (0.0, 0.0)), ((PLAY,), (delay_s, 0.0)),
        ((DELAY,), (0.0, 0.0)), ((DELAY,), (0.0, play_mm)),
        ((), (0.0, 0.0)), ((), (delay_s, play_mm)),
    ]  # fmt: skip
    unknown = {k for k in (DELAY, PLAY) if SMOOTH[k] in asked.without}
    return [(held, start) for held, start in every if unknown <= set(held)]


def simplest(ends: Sequence[End], precision: Precision) -> tuple[End, bool]:
    """Return the simplest solution that no other beats by far, and whether delay and play are distinguished.

    Delay and play can imitate or cancel each other, so that each is kept only where it improves the fit much.
    """
    cost = [e.misfit(precision) + FAR_BETTER * (2 - len(e.held)) for e in ends]
    best = int(np.argmin(cost))
    held = ends[best].held
    rivals = [c for c, e in zip(cost, ends, strict=True) if len(e.held) == 1 and e.held != held]
    return ends[best], len(held) == 0 or (
        len(held) == 1 and min(rivals, default=np.inf) > cost[best] + FAR_BETTER
    )


def refined(asked: Asked, start: tuple[float, float], held: tuple[int, ...]) -> End:
    """Return the result of a fit from a start of delay and play, with some columns held at 0."""
    delay_s, play_mm = start
    for _ in range(_ROUNDS):
        reading = readings_at(asked.steady, asked.sight.time_s + delay_s)
        turns = turns_between(asked.sight, asked.steady, delay_s)
        smooth, off = _smooth_columns(asked, turns, play_mm)
        columns = np.concatenate([smooth, asked.of_events], 1)
        # The effect already applied to the reading is added back, so that every round gives whole values.
        difference = reading - asked.sight.distance_mm + columns[:, DELAY] * delay_s + off
        found, free = np.zeros(columns.shape[1]), _free(columns, held)
        found[free] = robust_coefficients(difference, columns[:, free])
        delay_s, play_mm = _within(found[DELAY], _LONGEST_S), _within(found[PLAY], _WIDEST_MM)
    return End(held, difference, columns)


def nearest_start(asked: Asked) -> tuple[float, float]:
    """Return the start of delay and play, found by search: play can look like delay from afar.

    Where the speed changes abruptly, a delay is visible in a few pictures only, and its gradient there is of
    little use.
    """
    best, play_mm, width, speed = 0.0, 0.0, _LONGEST_S, asked.speed
    if np.ptp(speed) < _SPEEDS * float(np.max(np.abs(speed), initial=1e-9)):
        return best, play_mm
    while width > _FINEST_S:
        cost = np.inf
        for delay in best + width * np.linspace(-1, 1, 2 * _SEARCHED + 1):
            here, play = _misfit_at_delay(asked, float(delay))
            if here < cost:
                cost, nearest, play_mm = here, float(delay), play
        best, width = nearest, width / _SEARCHED
    return best, play_mm


def _misfit_at_delay(asked: Asked, delay_s: float) -> tuple[float, float]:
    """Return the sum of absolute increments left at a delay, and the play that minimises it."""
    difference = readings_at(asked.steady, asked.sight.time_s + delay_s) - asked.sight.distance_mm
    turns = turns_between(asked.sight, asked.steady, delay_s)
    left, play_mm = np.inf, 0.0
    for _ in range(_PLAYS if asked.sight.reverses else 1):
        smooth, off = _smooth_columns(asked, turns, play_mm)
        columns = np.concatenate([np.delete(smooth, DELAY, 1), asked.of_events], 1)
        found = robust_coefficients(difference + off, columns, _QUICKLY)
        left = float(np.sum(np.abs(np.diff(difference + off - columns @ found))))
        play_mm = _within(found[PLAY - 1], _WIDEST_MM)
    return left, play_mm


def _within(value: float, most: float) -> float:
    return float(np.clip(value, -most, most))


def _smooth_columns(asked: Asked, turns: Turns, play_mm: float) -> tuple[Float, Float]:
    """Return columns (N, 4) of offset, scale, delay and play, and a correction (N,) of the play's column.

    The effect of the play on a reading is the column times the size minus the correction. Columns of unknown
    effects are 0.
    """
    sight = asked.sight
    low, here, high = (lag_mm(sight, turns, play_mm + step) for step in (-_PLAY_STEP_MM, 0.0, _PLAY_STEP_MM))
    slope = (high - low) / (2 * _PLAY_STEP_MM)
    way = sight.distance_mm - sight.distance_mm[0]
    columns = np.stack([np.ones(len(way)), way, -asked.speed, slope], 1)
    columns[:, [name in asked.without for name in SMOOTH]] = 0.0
    return columns, columns[:, PLAY] * play_mm - here


def estimated_noise(difference_mm: Float, columns: Float, path_mm: Float, least_mm: float) -> DriftNoise:
    """Return the noise of differences (N,) beside columns (N, C), whatever events they contain.

    Events are few steps of the differences, so that least absolute deviations and medians of increments
    ignore them. Drift is the largest that increments over several lags show, so that drift smoother than a
    random walk is not mistaken for events. It is at least ``least_mm``: increments of a uniform motion may
    all be rounded alike by the readings' quanta.
    """
    left = difference_mm - columns @ robust_coefficients(difference_mm, columns)
    one = _increment_variance(left, 1)
    white = max(one / 2, least_mm**2, _LEAST_WHITE_MM**2)
    step, drift = float(np.median(np.diff(path_mm))), 0.0
    for lag in _LAGS:
        if lag == _LAGS[0] or _PER_LAG * lag <= len(left):
            way = float(np.median(path_mm[lag:] - path_mm[:-lag])) - step
            drift = max(drift, (_increment_variance(left, lag) - one) / max(way, 1e-6))
    return DriftNoise(float(np.sqrt(white)), float(np.sqrt(drift)))


def _increment_variance(values: Float, lag: int) -> float:
    step = values[lag:] - values[:-lag]
    return spread_about_median(step) ** 2 if len(step) else 0.0


def robust_coefficients(values: Float, columns: Float, rounds: int = _REWEIGHTINGS) -> Float:
    """Return coefficients (C,) by least absolute deviations of the increments (iterated reweighting)."""
    y, a = np.diff(values), np.diff(columns, axis=0)
    scale = np.maximum(np.linalg.norm(a, axis=0), 1e-12)
    even, found = a / scale, np.zeros(columns.shape[1])
    for _ in range(rounds):
        weight = 1 / np.sqrt(np.maximum(np.abs(y - a @ found), 1e-4))
        found = _least_squares(weight[:, None] * even, weight * y) / scale
    return found


def _least_squares(columns: Float, values: Float) -> Float:
    """Return the shortest (C,) that fits values (N,) best; directions below `SOLID` of the largest get 0.

    By an orthogonal factorisation with pivots, called without the wrappers of NumPy and SciPy: those, and the
    singular values by which they determine the rank, take ten times as long, and searches call this 20,000
    times.
    """
    n, count = columns.shape
    if not columns.size:
        return np.zeros(count)
    right = np.zeros(max(n, count))
    right[:n] = values
    pivots, work = np.zeros(count, np.int32), 4 * count + n + 32 * (count + 1)
    found = np.asarray(dgelsy(columns, right, pivots, SOLID, work)[1][:count])
    if not np.isfinite(found).all():
        raise np.linalg.LinAlgError("readings or columns are not finite")
    return found
