"""Model of the encoder against the visual distance: offset, scale, delay, play, and single events.

An effect estimated from disjoint parts of the travel gives two predictions: a column is split by increments,
and what it adds between two pictures belongs to one part.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from pipeline.arrays import Bool, Float, Int
from pipeline.pages import notation
from pipeline.physics.catalogue import effect
from pipeline.recording.base import Encoder
from stages.diagnose.agreement import Agreement, Part, agreement
from stages.diagnose.travel.noise import AT_ONCE, DriftNoise, Whitened, chance_of_noise, whitened_fit
from stages.diagnose.travel.sight import Sight, quantum_mm, readings_at
from stages.diagnose.travel.solve import (
    DELAY,
    PLAY,
    SCALE,
    SMOOTH,
    Asked,
    estimated_noise,
    nearest_start,
    refined,
    simplest,
    starts,
)

_AROUND = 10
# Share of the usual information that a picture must add to what the others determine of it.
_DETERMINED = 1e-6


class EventKind(StrEnum):
    """What happens at one moment."""

    STEP = "the reading gains"
    OUTLIER = "pictures are off"
    LOST_TIME = "frames are missing"


@dataclass(frozen=True)
class Event:
    """An event between frames ``place`` − 1 and ``place`` of a `Sight` (an outlier: in frame ``place``).

    A lasting step began ``during`` pictures earlier. How far it has progressed in each of these is free: a
    wheel need not slip evenly.
    """

    kind: EventKind
    place: int
    during: int = 0


@dataclass(frozen=True)
class TravelFit:
    """The fitted model of the encoder against the visual distance.

    Attributes
    ----------
    values : (4 + E + D,)
        Offset in mm, scale, delay in s, play in mm; then gains in mm (for lost time: in s); then the offset
        of each picture taken during an event.
    covariance : (4 + E + D, 4 + E + D)
        Infinite variance where this motion does not determine a value.
    difference_mm : (N,)
        Reading − visual distance, minus only the offset.
    whitened : Whitened
        Around ``values``.
    columns : (N, 4 + E + D)
        What each value adds to reading − visual distance, per unit.
    told_apart : bool
        Whether delay or play is present and the other does not explain it nearly as well.
    without : tuple of str
        Effects that are treated as unknown.
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
    without: tuple[str, ...] = ()

    @property
    def sigma(self) -> Float:
        """(4 + E + D,) 1 σ of the values."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance), 0)))

    @property
    def stated_mm(self) -> Float:
        """(N,) reading − visual distance, minus only the offset."""
        return self.difference_mm - float(np.mean(self.difference_mm))

    @property
    def left_out_mm(self) -> tuple[Float, Float]:
        """(K,) error of each picture as predicted from all others, and 1 σ of that.

        Pictures that an event leaves free are not included.
        """
        parts = candidate_columns(self.sight, EventKind.OUTLIER, np.zeros(0))
        own = np.concatenate([self.whitened.information(part) for part in parts])
        determined = own > _DETERMINED * np.max(own)
        return self.whitened.weighted[determined] / own[determined], own[determined] ** -0.5

    def with_columns(self, columns: Float, noise: DriftNoise | None = None) -> Whitened:
        """Return the fit with other columns (N, C), and with another noise if one is given."""
        difference_mm = self.whitened.residual + self.columns @ self.whitened.estimate
        return whitened_fit(difference_mm, columns, (noise or self.noise).precision(self.sight.path_mm))

    @property
    def left_over(self) -> float:
        """Remaining χ² per degree of freedom; 1 where the residual is the measured noise."""
        return _left_over(self.whitened, len(self.values))

    @property
    def fits_p(self) -> float:
        """Probability that noise makes such a residual."""
        count = len(self.difference_mm)
        return chance_of_noise(self.left_over, count - len(self.values), count)

    @property
    def event_z2(self) -> Float:
        """(E,) squares of the events' gains over their σ."""
        own = slice(4, 4 + len(self.events))
        return np.asarray((self.values[own] / self.sigma[own]) ** 2)


def fitted(
    sight: Sight, encoder: Encoder, events: tuple[Event, ...], noise: DriftNoise | None,
    without: tuple[str, ...] = (),
) -> TravelFit:  # fmt: skip
    """Fit offset, scale, delay, play and given events; the noise is estimated unless given.

    The delay shifts the time at which the encoder is read, so that kinks of the motion do no harm; delay and
    play are first found by least absolute deviations, which unknown events do not disturb. Effects in
    ``without`` are taken to be zero.
    """
    speed = np.gradient(sight.distance_mm, sight.time_s)
    steady = _without_steps(sight, encoder, events)
    asked = Asked(sight, steady, speed, event_columns(sight, events, speed), without)
    ends = [refined(asked, start, held) for held, start in starts(asked, *nearest_start(asked))]
    if noise is None:
        richest = ends[-1]
        noise = estimated_noise(
            richest.difference_mm, richest.columns, sight.path_mm, quantum_mm(encoder) / np.sqrt(12)
        )
    precision = noise.precision(sight.path_mm)
    end, told_apart = simplest(ends, precision)
    whitened = whitened_fit(end.difference_mm, end.columns, precision)
    values = end.values(precision)
    plain = readings_at(encoder, sight.time_s) - sight.distance_mm
    # Noise is estimated from the pictures' usual steps: the total residual may be larger, never smaller.
    covariance = max(_left_over(whitened, len(values)), 1.0) * whitened.covariance
    covariance[SCALE, SCALE] += sight.scale_sigma**2
    values[4 : 4 + len(events)] += [_gain(encoder, sight, e) for e in events]
    return TravelFit(
        sight, events, values, covariance, noise, plain - np.median(plain), whitened, end.columns, told_apart,
        without,
    )  # fmt: skip


def _left_over(whitened: Whitened, fitted_values: int) -> float:
    count = len(whitened.residual)
    return float(whitened.residual @ whitened.weighted) / max(count - fitted_values, 1)


def moment(sight: Sight, encoder: Encoder, place: int) -> int:
    """Return the reading after which it jumped most between two pictures; readings are more frequent."""
    # One reading more on either side: that is the accuracy of the stamps of pictures and readings.
    stamp = float(np.median(np.diff(encoder.time_s)))
    before, after = sight.time_s[place - 1] - stamp, sight.time_s[place] + stamp
    inside = np.flatnonzero((encoder.time_s[1:] >= before) & (encoder.time_s[:-1] <= after))
    if not len(inside):
        return int(np.clip(np.searchsorted(encoder.time_s, after) - 1, 0, len(encoder.time_s) - 2))
    step = np.diff(encoder.distance_mm)[inside]
    return int(inside[np.argmax(np.abs(step - np.median(step)))])


def _gain(encoder: Encoder, sight: Sight, event: Event) -> float:
    """Return by how much one reading jumps beyond its neighbours at a short step, mm; else 0."""
    if event.kind is not EventKind.STEP or event.during:
        return 0.0
    k = moment(sight, encoder, event.place)
    around = np.diff(encoder.distance_mm)[max(k - _AROUND, 0) : k + _AROUND + 1]
    return float(encoder.distance_mm[k + 1] - encoder.distance_mm[k] - np.median(around))


def _without_steps(sight: Sight, encoder: Encoder, events: tuple[Event, ...]) -> Encoder:
    """Return the readings without jumps between two of them, so that small errors of time do no harm."""
    distance = encoder.distance_mm.copy()
    for event in events:
        distance[moment(sight, encoder, event.place) + 1 :] -= _gain(encoder, sight, event)
    return Encoder(encoder.time_s, distance)


def event_columns(sight: Sight, events: tuple[Event, ...], speed: Float) -> Float:
    """Return (N, E + D): what each event adds, then each picture taken during one."""
    if not events:
        return np.zeros((len(sight.time_s), 0))
    each = [_columns_at(sight, e.kind, speed, np.array([e.place])) for e in events]
    free = np.concatenate([np.arange(e.place - e.during, e.place) for e in events])
    return np.concatenate([*each, _columns_at(sight, EventKind.OUTLIER, speed, free)], axis=1)


def candidate_columns(sight: Sight, kind: EventKind, speed: Float) -> Iterator[Float]:
    """Yield the columns (N, M) of an event of this kind at every place, `AT_ONCE` places at a time."""
    count = len(sight.time_s)
    for places in np.array_split(np.arange(count), count // AT_ONCE + 1):
        yield _columns_at(sight, kind, speed, places)


def _columns_at(sight: Sight, kind: EventKind, speed: Float, places: Int) -> Float:
    """Return the columns (N, M) of events of this kind at places (M,)."""
    frame = np.arange(len(sight.time_s))[:, None]
    if kind is EventKind.OUTLIER:
        return np.asarray(frame == places, np.float64)
    after = np.asarray(frame >= places, np.float64)
    # With frames missing after a moment, pictures are later than their stamps, by what the probe then moves.
    return after if kind is EventKind.STEP else -after * speed[:, None]


def second_predictions(
    fit: TravelFit, column: int, allowed: float = 0.0, known: float = 0.0
) -> tuple[Agreement, ...]:
    """Return whether disjoint parts of the travel agree on the effect of a column, where precise enough.

    ``allowed`` is the 1 σ of errors of each part beyond the noise of single readings; ``known`` is the part
    of the size that another effect makes, in the column's unit.
    """
    each = [_compared(fit, column, words, first, allowed, known) for words, first in _splits(fit, column)]
    return tuple(a for a in each if a is not None)


def _splits(fit: TravelFit, column: int) -> list[tuple[tuple[str, str], Bool]]:
    """Return the names of two parts, and which steps (N − 1,) between pictures belong to the first."""
    if column == SCALE:
        path = fit.sight.path_mm
        halves = (("first half of the way", "second half of the way"), path[1:] <= path[-1] / 2)
        return [halves, (("forward travel", "backward travel"), np.diff(fit.sight.distance_mm) > 0)]
    change = np.abs(np.diff(fit.columns[:, column]))
    if column == DELAY:
        early = np.cumsum(change) <= np.sum(change) / 2
        return [(("earlier changes of speed", "later changes of speed"), early)]
    turn = _turn(np.diff(fit.columns[:, PLAY]))
    return [(("first reversal", "later reversals"), turn == 0)] if turn.max(initial=0) > 0 else []


def _turn(step: Float) -> Int:
    """Return the number (N − 1,) of the reversal that each step of the play's column belongs to."""
    moved = np.flatnonzero(np.abs(step) > 1e-9)
    if not len(moved):
        return np.zeros(len(step), np.int64)
    sign = np.sign(step)[moved]
    number = np.concatenate([[0], np.cumsum(sign[1:] != sign[:-1])])
    return np.asarray(number[np.clip(np.searchsorted(moved, np.arange(len(step))), 0, len(moved) - 1)])


def _compared(
    fit: TravelFit, column: int, where: tuple[str, str], first: Bool, allowed: float, known: float
) -> Agreement | None:
    value, covariance = split(fit, column, first)
    value = value - known
    covariance = covariance + allowed**2 * np.eye(2)
    if not np.all(np.isfinite(covariance)):
        return None
    each = zip(where, value, np.sqrt(np.diag(covariance)), strict=True)
    one, other = (Part.of(name, _words(column, v, sigma), v, sigma) for name, v, sigma in each)
    gap = covariance[0, 0] + covariance[1, 1] - 2 * covariance[0, 1]
    return agreement(one, other, np.array([[gap]]))


def split(fit: TravelFit, column: int, first: Bool) -> tuple[Float, Float]:
    """Return a column's size (2,) in two parts with its covariance (2, 2), with all others in common."""
    step = np.diff(fit.columns[:, column])
    halves = [np.concatenate([[0.0], np.cumsum(np.where(mask, step, 0.0))]) for mask in (first, ~first)]
    design = np.column_stack([np.delete(fit.columns, column, 1), *halves])
    found = fit.with_columns(design)
    return found.estimate[-2:], found.covariance[-2:, -2:]


def _words(column: int, value: float, sigma: float) -> str:
    quantity = effect(SMOOTH[column]).quantities[0]
    return f"{quantity.name} {value:.4g} {notation.plus_minus(sigma, quantity.unit)}"
