"""Model of the encoder against the visual distance: offset, scale, delay, play, and single events."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from pipeline.arrays import Float, Int
from pipeline.recording.base import Encoder
from stages.diagnose.travel.noise import (
    DriftNoise,
    Whitened,
    estimated_noise,
    robust_coefficients,
    whitened_fit,
)
from stages.diagnose.travel.sight import Sight, lag_mm, quantum_mm, readings_at, turns_between

OFFSET, SCALE, DELAY, PLAY = range(4)
SMOOTH = ("offset", "encoder_scale", "time_offset", "encoder_backlash")
_ROUNDS = 6
_LONGEST_S = 1.0
_AROUND = 10
# The search for delay and play: points a side, finest step, tries of the play, rounds; speeds that differ by
# less than this share tell nothing of a delay.
_SEARCHED, _FINEST_S, _PLAYS, _QUICKLY, _SPEEDS = 8, 1e-3, 3, 8, 0.02
_WIDEST_MM, _PLAY_STEP_MM = 10.0, 0.025
# χ² of one number exceeds 19.5 by chance once in 10⁵; 23 leaves a margin for noise that is not quite normal.
_FAR_BETTER = 23.0


class EventKind(StrEnum):
    """What happens at one moment."""

    STEP = "the reading gains"
    OUTLIER = "pictures are off"
    LOST_TIME = "frames are missing"


@dataclass(frozen=True)
class Event:
    """Something between frames ``place`` − 1 and ``place`` of a `Sight` (an outlier: in frame ``place``).

    A step that takes its time began ``during`` pictures earlier. How far it has come in each of these is
    free: a wheel need not slip evenly.
    """

    kind: EventKind
    place: int
    during: int = 0


@dataclass(frozen=True)
class TravelFit:
    """Encoder against sight, fitted.

    Attributes
    ----------
    sight : Sight
    events : tuple of Event
    values : (4 + E + D,)
        Offset in mm, scale, delay in s, play in mm; then gains in mm (for lost time: in s); then how far off
        each picture is that was taken during an event.
    covariance : (4 + E + D, 4 + E + D)
        Infinite variance where this motion tells nothing.
    noise : DriftNoise
    difference_mm : (N,)
        Reading − sight, less the offset only.
    whitened : Whitened
        Around ``values``.
    columns : (N, 4 + E + D)
        What each value adds to reading − sight, per unit.
    told_apart : bool
        Whether delay or play is there, and the other does not explain it nearly as well.
    """

    sight: Sight
    events: tuple[Event, ...]
    values: Float
    covariance: Float
    noise: DriftNoise
    difference_mm: Float
    whitened: Whitened
    columns: Float
    told_apart: bool

    @property
    def sigma(self) -> Float:
        """(4 + E + D,) 1 σ of the values."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance), 0)))

    @property
    def event_z2(self) -> Float:
        """(E,) squares of the events' gains over their σ."""
        own = slice(4, 4 + len(self.events))
        return np.asarray((self.values[own] / self.sigma[own]) ** 2)


def fitted(sight: Sight, encoder: Encoder, events: tuple[Event, ...], noise: DriftNoise | None) -> TravelFit:
    """Fit offset, scale, delay, play and given events; the noise is measured unless given.

    The delay moves the time at which the encoder is read, so that kinks of the motion do no harm; it and the
    play are found by least absolute deviations first, which unknown events do not disturb.
    """
    steady = _without_steps(sight, encoder, events)
    speed = np.gradient(sight.distance_mm, sight.time_s)
    searched = _nearest_start(sight, steady, events, speed)
    ends = [_refined(sight, steady, events, speed, start, held) for held, start in _starts(*searched)]
    if noise is None:
        richest = ends[-1]
        noise = estimated_noise(
            richest.difference_mm, richest.columns, sight.path_mm, quantum_mm(encoder) / np.sqrt(12)
        )
    covariance_mm = noise.covariance(sight.path_mm)
    end, told_apart = _simplest(ends, covariance_mm)
    whitened = whitened_fit(end.difference_mm, end.columns, covariance_mm)
    values = end.values(covariance_mm)
    plain = readings_at(encoder, sight.time_s) - sight.distance_mm
    # Noise is measured from the pictures' usual steps: what is left in all may be more, never less.
    left = float(whitened.residual @ whitened.weighted) / max(len(plain) - len(values), 1)
    covariance = max(left, 1.0) * whitened.covariance
    covariance[SCALE, SCALE] += sight.scale_sigma**2
    values[4 : 4 + len(events)] += [_gain(encoder, sight, e) for e in events]
    return TravelFit(
        sight, events, values, covariance, noise, plain - np.median(plain), whitened, end.columns, told_apart
    )


@dataclass(frozen=True)
class _End:
    """Where a fit came to: reading − sight (N,), columns (N, 4 + E) there, and which are held at 0."""

    held: tuple[int, ...]
    difference_mm: Float
    columns: Float

    def values(self, covariance_mm: Float) -> Float:
        """Return (4 + E,) the values; 0 of what is held, and of what this motion does not tell."""
        free = _free(self.columns, self.held)
        fit = whitened_fit(self.difference_mm, self.columns[:, free], covariance_mm)
        out = np.zeros(self.columns.shape[1])
        out[free] = np.where(np.isfinite(np.diag(fit.covariance)), fit.estimate, 0.0)
        return out

    def misfit(self, covariance_mm: Float) -> float:
        """Return χ² of what is left."""
        free = _free(self.columns, self.held)
        fit = whitened_fit(self.difference_mm, self.columns[:, free], covariance_mm)
        return float(fit.residual @ fit.weighted)


def _free(columns: Float, held: tuple[int, ...]) -> Int:
    return np.setdiff1d(np.arange(columns.shape[1]), held)


def _starts(delay_s: float, play_mm: float) -> list[tuple[tuple[int, ...], tuple[float, float]]]:
    """Return what is held at 0 and from where the rest starts: neither, each alone, and last of all both."""
    return [
        ((DELAY, PLAY), (0.0, 0.0)),
        ((PLAY,), (0.0, 0.0)), ((PLAY,), (delay_s, 0.0)),
        ((DELAY,), (0.0, 0.0)), ((DELAY,), (0.0, play_mm)),
        ((), (0.0, 0.0)), ((), (delay_s, play_mm)),
    ]  # fmt: skip


def _simplest(ends: Sequence[_End], covariance_mm: Float) -> tuple[_End, bool]:
    """Return the simplest solution that no other beats by far, and whether delay and play are told apart.

    Delay and play can imitate or cancel each other, so that each is kept only where it improves the fit much.
    """
    cost = [e.misfit(covariance_mm) + _FAR_BETTER * (2 - len(e.held)) for e in ends]
    best = int(np.argmin(cost))
    held = ends[best].held
    rivals = [c for c, e in zip(cost, ends, strict=True) if len(e.held) == 1 and e.held != held]
    return ends[best], len(held) == 0 or (len(held) == 1 and min(rivals) > cost[best] + _FAR_BETTER)


def _refined(
    sight: Sight, steady: Encoder, events: tuple[Event, ...], speed: Float,
    start: tuple[float, float], held: tuple[int, ...],
) -> _End:  # fmt: skip
    """Return where a fit comes to from a delay and a play, some columns being held at 0."""
    delay_s, play_mm = start
    of_events = event_columns(sight, events, speed)
    for _ in range(_ROUNDS):
        reading = readings_at(steady, sight.time_s + delay_s)
        smooth, off = _smooth_columns(sight, steady, speed, delay_s, play_mm)
        columns = np.concatenate([smooth, of_events], 1)
        # The effect already applied to the reading is added back, so that every round gives whole values.
        difference = reading - sight.distance_mm + columns[:, DELAY] * delay_s + off
        found, free = np.zeros(columns.shape[1]), _free(columns, held)
        found[free] = robust_coefficients(difference, columns[:, free])
        delay_s, play_mm = _within(found[DELAY], _LONGEST_S), _within(found[PLAY], _WIDEST_MM)
    return _End(held, difference, columns)


def _nearest_start(
    sight: Sight, steady: Encoder, events: tuple[Event, ...], speed: Float
) -> tuple[float, float]:
    """Return delay and play from which the fit starts, by search: play can look like delay from afar.

    Where the speed changes at once, a delay shows in a few pictures only, and its slope there tells little.
    """
    best, play_mm, width = 0.0, 0.0, _LONGEST_S
    if np.ptp(speed) < _SPEEDS * float(np.max(np.abs(speed), initial=1e-9)):
        return best, play_mm
    while width > _FINEST_S:
        cost = np.inf
        for delay in best + width * np.linspace(-1, 1, 2 * _SEARCHED + 1):
            here, play = _misfit_at_delay(sight, steady, events, speed, float(delay))
            if here < cost:
                cost, nearest, play_mm = here, float(delay), play
        best, width = nearest, width / _SEARCHED
    return best, play_mm


def _misfit_at_delay(
    sight: Sight, steady: Encoder, events: tuple[Event, ...], speed: Float, delay_s: float
) -> tuple[float, float]:
    """Return the sum of absolute increments left at a delay, and the play at which they are least."""
    difference = readings_at(steady, sight.time_s + delay_s) - sight.distance_mm
    of_events, left, play_mm = event_columns(sight, events, speed), np.inf, 0.0
    for _ in range(_PLAYS if sight.reverses else 1):
        smooth, off = _smooth_columns(sight, steady, speed, delay_s, play_mm)
        columns = np.concatenate([np.delete(smooth, DELAY, 1), of_events], 1)
        found = robust_coefficients(difference + off, columns, _QUICKLY)
        left = float(np.sum(np.abs(np.diff(difference + off - columns @ found))))
        play_mm = _within(found[PLAY - 1], _WIDEST_MM)
    return left, play_mm


def _within(value: float, most: float) -> float:
    return float(np.clip(value, -most, most))


def moment(sight: Sight, encoder: Encoder, place: int) -> int:
    """Return the reading after which it jumped most between two pictures: readings come more often."""
    # One reading more on either side: pictures and readings are stamped to about that.
    stamp = float(np.median(np.diff(encoder.time_s)))
    before, after = sight.time_s[place - 1] - stamp, sight.time_s[place] + stamp
    inside = np.flatnonzero((encoder.time_s[1:] >= before) & (encoder.time_s[:-1] <= after))
    if not len(inside):
        return int(np.clip(np.searchsorted(encoder.time_s, after) - 1, 0, len(encoder.time_s) - 2))
    step = np.diff(encoder.distance_mm)[inside]
    return int(inside[np.argmax(np.abs(step - np.median(step)))])


def _gain(encoder: Encoder, sight: Sight, event: Event) -> float:
    """Return what one reading gains at a step beyond its neighbours, mm; 0 for other and longer events."""
    if event.kind is not EventKind.STEP or event.during:
        return 0.0
    k = moment(sight, encoder, event.place)
    around = np.diff(encoder.distance_mm)[max(k - _AROUND, 0) : k + _AROUND + 1]
    return float(encoder.distance_mm[k + 1] - encoder.distance_mm[k] - np.median(around))


def _without_steps(sight: Sight, encoder: Encoder, events: tuple[Event, ...]) -> Encoder:
    """Return the readings less what jumps between two of them, so that they may be read a little off time."""
    distance = encoder.distance_mm.copy()
    for event in events:
        distance[moment(sight, encoder, event.place) + 1 :] -= _gain(encoder, sight, event)
    return Encoder(encoder.time_s, distance)


def event_columns(sight: Sight, events: tuple[Event, ...], speed: Float) -> Float:
    """Return (N, E + D): what each event adds, then each picture taken during one."""
    if not events:
        return np.zeros((len(sight.time_s), 0))
    each = [candidate_columns(sight, e.kind, speed)[:, e.place] for e in events]
    free = [k for e in events for k in range(e.place - e.during, e.place)]
    return np.concatenate([np.stack(each, 1), np.eye(len(sight.time_s))[:, free]], axis=1)


def candidate_columns(sight: Sight, kind: EventKind, speed: Float) -> Float:
    """Return (N, N): the column of an event of that kind at every place."""
    count = len(sight.time_s)
    if kind is EventKind.OUTLIER:
        return np.eye(count)
    after = np.tril(np.ones((count, count)))
    # Frames missing after a moment: pictures are later than their times say, by what the probe then moves.
    return after if kind is EventKind.STEP else -after * speed[:, None]


def _smooth_columns(
    sight: Sight, steady: Encoder, speed: Float, delay_s: float, play_mm: float
) -> tuple[Float, Float]:
    """Return (N, 4) columns of offset, scale, delay and play, and what (N,) the play's is off at its size.

    What the play does to a reading is the column times the size less the second.
    """
    turns = turns_between(sight, steady, delay_s)
    low, here, high = (lag_mm(sight, turns, play_mm + step) for step in (-_PLAY_STEP_MM, 0.0, _PLAY_STEP_MM))
    slope = (high - low) / (2 * _PLAY_STEP_MM)
    way = sight.distance_mm - sight.distance_mm[0]
    return np.stack([np.ones(len(speed)), way, -speed, slope], 1), slope * play_mm - here
