"""What may stand between encoder and sight: offset, scale, delay, play, and single events."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from pipeline.recording.base import Encoder
from stages.diagnose.effects.base import Travel
from stages.diagnose.effects.library import LIBRARY
from stages.diagnose.travel.noise import (
    DriftNoise,
    Whitened,
    estimated_noise,
    robust_coefficients,
    whitened_fit,
)
from stages.diagnose.travel.sight import Sight, quantum_mm, readings_at

Float = NDArray[np.float64]
OFFSET, SCALE, DELAY, PLAY = range(4)
SMOOTH = ("offset", "encoder_scale", "time_offset", "encoder_backlash")
_ROUNDS = 6
_LONGEST_S = 1.0
_AROUND = 10
# The search for delay and play: points a side, finest step, tries of the play, rounds; speeds that differ by
# less than this share tell nothing of a delay.
_SEARCHED, _FINEST_S, _PLAYS, _QUICKLY, _SPEEDS = 8, 1e-3, 3, 8, 0.02
_WIDEST_MM, _PLAY_STEP_MM = 10.0, 0.025
# χ² of two numbers that chance exceeds once in 10⁵.
_FAR_BETTER = 23.0


@dataclass(frozen=True)
class Turns:
    """Where the probe turned between two pictures: before picture ``place`` (K,), at ``distance_mm`` (K,)."""

    place: NDArray[np.int64]
    distance_mm: Float


class EventKind(StrEnum):
    """What happens at one moment."""

    STEP = "the reading gains"
    OUTLIER = "one picture is off"
    LOST_TIME = "frames are missing"


@dataclass(frozen=True)
class Event:
    """Something between frames ``place`` − 1 and ``place`` of a `Sight` (an outlier: in frame ``place``)."""

    kind: EventKind
    place: int


@dataclass(frozen=True)
class TravelFit:
    """Encoder against sight, fitted.

    Attributes
    ----------
    sight : Sight
    events : tuple of Event
    values : (4 + E,)
        Offset in mm, scale, delay in s, play in mm; then gains in mm (for lost time: in s).
    covariance : (4 + E, 4 + E)
        Infinite variance where this motion tells nothing.
    noise : DriftNoise
    difference_mm : (N,)
        Reading − sight, less the offset only.
    whitened : Whitened
        Around ``values``.
    columns : (N, 4 + E)
        What each value adds to reading − sight, per unit.
    """

    sight: Sight
    events: tuple[Event, ...]
    values: Float
    covariance: Float
    noise: DriftNoise
    difference_mm: Float
    whitened: Whitened
    columns: Float

    @property
    def sigma(self) -> Float:
        """(4 + E,) 1 σ of the values."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance), 0)))


def fitted(sight: Sight, encoder: Encoder, events: tuple[Event, ...], noise: DriftNoise | None) -> TravelFit:
    """Fit offset, scale, delay, play and given events; the noise is measured unless given.

    The delay moves the time at which the encoder is read, so that kinks of the motion do no harm; it and the
    play are found by least absolute deviations first, which unknown events do not disturb.
    """
    steady = _without_steps(sight, encoder, events)
    speed = np.gradient(sight.distance_mm, sight.time_s)
    searched = _nearest_start(sight, steady, events, speed)
    # Play and delay can cancel each other: a pair of both must fit far better than what starts from nothing.
    from_search, from_nothing = (_refined(sight, steady, events, speed, s) for s in (searched, (0.0, 0.0)))
    if noise is None:
        noise = estimated_noise(*from_search, sight.path_mm, quantum_mm(encoder) / np.sqrt(12))
    covariance_mm = noise.covariance(sight.path_mm)
    ends = [(whitened_fit(y, x, covariance_mm), x) for y, x in (from_nothing, from_search)]
    plain_misfit, searched_misfit = (float(w.residual @ w.weighted) for w, _ in ends)
    whitened, columns = ends[int(searched_misfit < plain_misfit - _FAR_BETTER)]
    values = np.where(np.isfinite(np.diag(whitened.covariance)), whitened.estimate, 0.0)
    plain = readings_at(encoder, sight.time_s) - sight.distance_mm
    # Noise is measured from the pictures' usual steps: what is left in all may be more, never less.
    left = float(whitened.residual @ whitened.weighted) / max(len(plain) - len(values), 1)
    covariance = max(left, 1.0) * whitened.covariance
    covariance[SCALE, SCALE] += sight.scale_sigma**2
    values[4:] += [_gain(encoder, sight, e) for e in events]
    return TravelFit(sight, events, values, covariance, noise, plain - np.median(plain), whitened, columns)


def _refined(
    sight: Sight, steady: Encoder, events: tuple[Event, ...], speed: Float, start: tuple[float, float]
) -> tuple[Float, Float]:
    """Return reading − sight (N,) and the columns (N, 4 + E) about the delay and play found from a start."""
    delay_s, play_mm = start
    of_events = event_columns(sight, events, speed)
    for _ in range(_ROUNDS):
        reading = readings_at(steady, sight.time_s + delay_s)
        smooth, off = _smooth_columns(sight, steady, speed, delay_s, play_mm)
        columns = np.concatenate([smooth, of_events], 1)
        # What is in the reading already is put back, so that every round gives the values in full.
        difference = reading - sight.distance_mm + columns[:, DELAY] * delay_s + off
        found = robust_coefficients(difference, columns)
        delay_s, play_mm = _within(found[DELAY], _LONGEST_S), _within(found[PLAY], _WIDEST_MM)
    return difference, columns


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
            here, play = _astray(sight, steady, events, speed, float(delay))
            if here < cost:
                cost, nearest, play_mm = here, float(delay), play
        best, width = nearest, width / _SEARCHED
    return best, play_mm


def _astray(
    sight: Sight, steady: Encoder, events: tuple[Event, ...], speed: Float, delay_s: float
) -> tuple[float, float]:
    """Return the sum of absolute increments left at a delay, and the play at which they are least."""
    difference = readings_at(steady, sight.time_s + delay_s) - sight.distance_mm
    of_events, left, play_mm = event_columns(sight, events, speed), np.inf, 0.0
    for _ in range(_PLAYS):
        smooth, off = _smooth_columns(sight, steady, speed, delay_s, play_mm)
        columns = np.concatenate([np.delete(smooth, DELAY, 1), of_events], 1)
        found = robust_coefficients(difference + off, columns, _QUICKLY)
        left = float(np.sum(np.abs(np.diff(difference + off - columns @ found))))
        play_mm = _within(found[PLAY - 1], _WIDEST_MM)
    return left, play_mm


def _within(value: float, most: float) -> float:
    return float(np.clip(value, -most, most))


def turns_between(sight: Sight, steady: Encoder, delay_s: float) -> Turns:
    """Return where the probe turned between pictures: as far beyond the last one as the reading still went.

    Until it turns, the reading follows the probe, whatever play there is after that.
    """
    way = sight.direction
    before = np.flatnonzero(way[1:] != way[:-1])
    place, distance = [], []
    for turn in before:
        # The direction is a mean over neighbours: the turn may be a picture later or earlier.
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
    """Return what one reading gains at a step beyond its neighbours, mm; 0 for other events."""
    if event.kind is not EventKind.STEP:
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
    """Return (N, E)."""
    if not events:
        return np.zeros((len(sight.time_s), 0))
    return np.stack([candidate_columns(sight, e.kind, speed)[:, e.place] for e in events], 1)


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
    low, here, high = (_lag(sight, turns, play_mm + step) for step in (-_PLAY_STEP_MM, 0.0, _PLAY_STEP_MM))
    slope = (high - low) / (2 * _PLAY_STEP_MM)
    way = sight.distance_mm - sight.distance_mm[0]
    return np.stack([np.ones(len(speed)), way, -speed, slope], 1), slope * play_mm - here


def _lag(sight: Sight, turns: Turns, play_mm: float) -> Float:
    """Return (N,) by how much readings are ahead for play of that size."""
    way = np.insert(sight.distance_mm, turns.place, turns.distance_mm)
    same = np.zeros(len(way))
    travel = Travel(same, way, same, way)
    lag = LIBRARY["encoder_backlash"].reading_shift_mm(travel, (), np.array([play_mm]))
    return np.asarray(np.delete(lag, turns.place + np.arange(len(turns.place))))
