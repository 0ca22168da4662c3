"""Single events between encoder and visual distance: slips of the wheel, stray pictures, missing frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter
from scipy.stats import t as student

from pipeline.recording.base import Encoder
from stages.diagnose.agreement import Agreement, Part, agreement
from stages.diagnose.travel.model import (
    Event,
    EventKind,
    TravelFit,
    candidate_columns,
    fitted,
    moment,
)
from stages.diagnose.travel.sight import Sight

_MOST = 8
_ENTERS = 1e-4
# A step needs pictures on both of its sides, else it is one stray picture.
_SIDE = 3
# Explanations whose χ² differs by less than this (3 σ squared) are both kept.
_APART = 9.0
# So many neighbouring frames may be lost without a trace in the time stamps; error of a stamp, frames.
# Debt: data/debts.md.
_UNNOTICED = 2
_WITHIN, _TIMING = 3.0, 0.03
# Duration of a slip, and number of readings around it that its speed is taken from. Debt: data/debts.md.
SLIPS_WITHIN_S = 0.03
_AROUND = 8
_TAIL = 2.275


def jump_of_reading(encoder: Encoder, at: int, lasting_mm: float, sigma_mm: float) -> Agreement | None:
    """Return whether the reading jumps by what it keeps on gaining on the pictures; None when it cannot tell.

    Parameters
    ----------
    at
        Reading after which it would jump.
    lasting_mm, sigma_mm
        By how much the reading is ahead of the pictures after the moment, and 1 σ.
    """
    jump, sigma = reading_jump(encoder, at)
    if not np.isfinite(sigma):
        return None
    lasting = Part(
        "what the reading has gained on the pictures ever since",
        f"{lasting_mm:+.3f} mm (± {sigma_mm:.2g} mm)", np.array([lasting_mm]),
    )  # fmt: skip
    alone = Part(
        "jump of the reading against its own motion", f"{jump:+.3f} mm (± {sigma:.2g} mm)", np.array([jump])
    )
    own = np.array([[sigma_mm**2]]), np.array([[sigma**2]])
    return agreement(lasting, alone, own, own[0] + own[1])


def reading_jump(encoder: Encoder, at: int) -> tuple[float, float]:
    """Return what the reading gains around a moment beyond its own speed before and after, mm, and 1 σ.

    1 σ is a quarter of the range that holds the same sum at 95.4 % of all other moments, turns and bursts
    included. NaN too close to the ends.
    """
    step = np.diff(encoder.distance_mm)
    rate = float(np.median(np.diff(encoder.time_s)))
    width = 2 * max(int(np.ceil(SLIPS_WITHIN_S / rate / 2)), 1) - 1
    side = width // 2
    reach = side + _AROUND
    if not reach <= at < len(step) - reach:
        return float("nan"), float("nan")
    weight = np.full(2 * reach + 1, -width / (2 * _AROUND))
    weight[_AROUND : _AROUND + width] = 1.0
    gained = np.correlate(step, weight, mode="valid")
    here = at - reach
    others = np.delete(gained, slice(max(here - 2 * reach, 0), here + 2 * reach + 1))
    if len(others) < 4 * reach:
        return float("nan"), float("nan")
    low, high = np.percentile(others, [_TAIL, 100 - _TAIL])
    return float(gained[here]), float(high - low) / 4


@dataclass(frozen=True)
class StepFound:
    """A step of the reading.

    Attributes
    ----------
    place : int
        Index in the `Sight` of the first picture after it.
    time_s, time_sigma_s : float
        When, and 1 σ.
    gain_mm, sigma_mm : float
    p_value : float
        Over all moments at which it might have come.
    rivals : tuple of EventKind
        What explains it as well.
    missing_s : float
        Time of missing pictures that would explain it.
    agreements : tuple of Agreement
        What the reading alone says of it.
    """

    place: int
    time_s: float
    time_sigma_s: float
    gain_mm: float
    sigma_mm: float
    p_value: float
    rivals: tuple[EventKind, ...]
    missing_s: float
    agreements: tuple[Agreement, ...] = ()


def with_events(sight: Sight, encoder: Encoder) -> TravelFit:
    """Return the fit with the events that the readings ask for, the strongest first."""
    fit = fitted(sight, encoder, (), None)
    while len(fit.events) < _MOST:
        event, score, count = _strongest(fit)
        if chance(score, count, len(sight.time_s)) > _ENTERS:
            break
        fit = fitted(sight, encoder, (*fit.events, event), None)
    return _without_needless(fit, encoder)


def _without_needless(fit: TravelFit, encoder: Encoder) -> TravelFit:
    """Return the fit less the events that those found later have made needless."""
    while fit.events:
        z2 = (fit.values[4:] / fit.sigma[4:]) ** 2
        least = int(np.argmin(z2))
        if chance(float(z2[least]), 2 * len(fit.sight.time_s), len(fit.sight.time_s)) <= _ENTERS:
            break
        fit = fitted(fit.sight, encoder, fit.events[:least] + fit.events[least + 1 :], None)
    return fit


def steps_found(fit: TravelFit, encoder: Encoder) -> tuple[StepFound, ...]:
    """Return the steps among the fit's events, each judged with the others in place."""
    return tuple(
        _judged(fit, k, encoder) for k, event in enumerate(fit.events) if event.kind is not EventKind.OUTLIER
    )


def chance(score: float, count: int, measurements: int) -> float:
    """Return the probability that the largest of ``count`` scores z² is so large by chance.

    Medians of increments measure the noise about as well as a third of the measurements would.
    """
    one = 2 * student.sf(np.sqrt(max(score, 0.0)), max(measurements / 3, 3.0))
    return float(min(1.0, count * one))


def _strongest(fit: TravelFit) -> tuple[Event, float, int]:
    sight = fit.sight
    speed = np.gradient(sight.distance_mm, sight.time_s)
    best, score, count = Event(EventKind.STEP, 0), 0.0, 0
    for kind in (EventKind.STEP, EventKind.OUTLIER):
        gain = fit.whitened.gain(candidate_columns(sight, kind, speed))[1]
        if kind is EventKind.STEP:
            gain[:_SIDE], gain[len(gain) - _SIDE + 1 :] = 0.0, 0.0
        count += len(gain)
        if gain.max(initial=0.0) > score:
            best, score = Event(kind, int(np.argmax(gain))), float(gain.max())
    return best, score, count


def _judged(fit: TravelFit, place_in_list: int, encoder: Encoder) -> StepFound:
    event, sight = fit.events[place_in_list], fit.sight
    others = fit.events[:place_in_list] + fit.events[place_in_list + 1 :]
    without = fitted(sight, encoder, others, fit.noise)
    # The step itself does not count as speed.
    speed = median_filter(np.gradient(sight.distance_mm, sight.time_s), 5)
    score, size = {}, {}
    for kind in EventKind:
        value, gain = without.whitened.gain(candidate_columns(sight, kind, speed))
        near = slice(max(event.place - 2, 0), event.place + 3)
        size[kind], score[kind] = float(value[near][np.argmax(gain[near])]), float(gain[near].max())
    at = 4 + place_in_list
    sigma = float(fit.sigma[at])
    rivals = tuple(
        k
        for k in EventKind
        if k is not event.kind
        and score[k] > score[event.kind] - _APART
        and (k is not EventKind.LOST_TIME or _whole_frames(sight, size[k], sigma, speed[event.place]))
    )
    z2 = (fit.values[at] / sigma) ** 2 if np.isfinite(sigma) else 0.0
    count = len(sight.time_s)
    k = moment(sight, encoder, event.place)
    time_s = (encoder.time_s[k] + encoder.time_s[k + 1]) / 2
    again = jump_of_reading(encoder, k, float(fit.values[at]), sigma)
    # Somewhere between two pictures; where the reading itself jumps, as long as a slip lasts.
    within_s = float(sight.time_s[event.place] - sight.time_s[event.place - 1])
    if again is not None and again.confirmation.agrees:
        # Errors of pictures cannot make the encoder's reading jump.
        rivals, within_s = (), SLIPS_WITHIN_S
    return StepFound(
        event.place, float(time_s), within_s / np.sqrt(12), float(fit.values[at]), sigma,
        chance(z2, 2 * count, count), rivals, size[EventKind.LOST_TIME], () if again is None else (again,),
    )  # fmt: skip


def _whole_frames(sight: Sight, missing_s: float, sigma_mm: float, speed_mm_s: float) -> bool:
    """Return whether a time is that of one or two frames, which a camera may lose or write twice."""
    frames = missing_s / sight.frame_time_s
    sigma = _WITHIN * sigma_mm / max(abs(speed_mm_s), 1e-9) / sight.frame_time_s
    return 0 < abs(round(frames)) <= _UNNOTICED and abs(frames - round(frames)) < sigma + _TIMING
