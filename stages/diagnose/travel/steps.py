"""Steps of the reading: their time, size and duration, and what else would explain them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter
from scipy.stats import chi2

from pipeline.arrays import Float
from pipeline.recording.base import Encoder
from stages.diagnose.agreement import Agreement, Part, agreement
from stages.diagnose.travel.events import LONGEST_S, SHORTEST_S, SIDE, chance
from stages.diagnose.travel.model import EventKind, TravelFit, candidate_columns, fitted, moment
from stages.diagnose.travel.sight import Sight, quantum_mm, readings_at

# Explanations whose χ² differs by less than this (3 σ squared) are both kept.
_APART = 9.0
# Number of neighbouring frames that may be lost without a trace in the time stamps; error of a stamp, frames.
# Debt: data/debts.md.
_UNNOTICED = 2
_WITHIN, _TIMING = 3.0, 0.03
# Least number of readings around a slip from which its speed is taken. Debt: data/debts.md.
_AROUND = 8
# Least number of other moments that show how far a reading's own motion imitates a slip.
_LEAST_OTHERS = 20
_TAIL = 2.275
# Probability that an even slip is called uneven: its size then comes from single pictures, as for any slip.
_EVEN = 1e-3


def jump_of_reading(encoder: Encoder, at: int, lasting_mm: float, sigma_mm: float) -> Agreement | None:
    """Return whether the reading jumps by what it has permanently gained on the pictures; None if unclear.

    Parameters
    ----------
    at
        Reading after which it would jump.
    lasting_mm, sigma_mm
        By how much the reading is ahead of the pictures after the moment, and 1 σ.
    """
    return _by_reading(lasting_mm, sigma_mm, *reading_jump(encoder, at))


def _by_reading(lasting_mm: float, sigma_mm: float, jump: float, sigma: float) -> Agreement | None:
    """Return whether the reading's own jump, with 1 σ, equals what it has gained on the pictures since."""
    if not np.isfinite(sigma):
        return None
    lasting, alone = (f"{v:+.3f} mm (± {sd:.2g} mm)" for v, sd in ((lasting_mm, sigma_mm), (jump, sigma)))
    return agreement(
        Part.of("what the reading has gained on the pictures ever since", lasting, lasting_mm, sigma_mm),
        Part.of("jump of the reading against its own motion", alone, jump, sigma),
    )


def reading_jump(encoder: Encoder, at: int) -> tuple[float, float]:
    """Return what the reading gains at a moment beyond its own speed before and after, mm, and 1 σ.

    NaN too close to the ends.
    """
    step = np.diff(encoder.distance_mm)
    rate = float(np.median(np.diff(encoder.time_s)))
    width = 2 * max(int(np.ceil(SHORTEST_S / rate / 2)), 1) - 1
    weight = np.full(width + 2 * _AROUND, -width / (2 * _AROUND))
    weight[_AROUND : _AROUND + width] = 1.0
    return _filtered(step, weight, at - len(weight) // 2)


def _filtered(step: Float, weight: Float, first: int) -> tuple[float, float]:
    """Return the weighted sum of the steps from ``first`` on, and 1 σ.

    1 σ is a quarter of the range that contains 95.4 % of the same sums at all other moments, including turns
    and bursts. NaN where the steps do not reach, or there are too few other moments.
    """
    if not 0 <= first <= len(step) - len(weight):
        return float("nan"), float("nan")
    gained = np.correlate(step, weight, mode="valid")
    others = np.delete(gained, slice(max(first - len(weight) + 1, 0), first + len(weight)))
    if len(others) < _LEAST_OTHERS:
        return float("nan"), float("nan")
    low, high = np.percentile(others, [_TAIL, 100 - _TAIL])
    return float(gained[first]), float(high - low) / 4


def course_of_reading(fit: TravelFit, place_in_list: int, encoder: Encoder) -> Agreement | None:
    """Return whether the reading's own motion shows a lasting slip like pictures and readings together.

    The progress of the slip from picture to picture is taken from both; its size from the reading alone, as
    what is not motion at constant acceleration. None when it is too uncertain.
    """
    event, sight = fit.events[place_in_list], fit.sight
    gain_mm, sigma = float(fit.values[4 + place_in_list]), float(fit.sigma[4 + place_in_list])
    course = np.pad(_course(fit, place_in_list), event.during)
    even = np.vander(np.linspace(-1, 1, len(course)), 2)
    weight = course - even @ np.linalg.lstsq(even, course, rcond=None)[0]
    step = np.diff(readings_at(encoder, sight.time_s))
    first = event.place - event.during - 1 - event.during
    jump, jump_sigma = _filtered(step, weight * gain_mm / float(weight @ course), first)
    return _by_reading(gain_mm, sigma, jump, jump_sigma)


def _course(fit: TravelFit, place_in_list: int) -> Float:
    """Return what the reading gains from picture to picture during an event (during + 1,), mm."""
    event = fit.events[place_in_list]
    gained = fit.difference_mm - fit.columns[:, 1:4] @ fit.values[1:4]
    return np.diff(gained[event.place - event.during - 1 : event.place + 1])


@dataclass(frozen=True)
class StepFound:
    """A step of the reading.

    Attributes
    ----------
    place : int
        Index in the `Sight` of the first picture after it.
    time_s, time_sigma_s : float
        Its time, and 1 σ.
    p_value : float
        Over all moments at which it might have happened.
    rivals : tuple of EventKind
        What explains it as well.
    lasting_s : float
        Its duration, if the wheel slips evenly.
    agreements : tuple of Agreement
        Whether the reading alone agrees.
    stray : int
        Number of stray pictures that would explain it, if stray pictures can.
    """

    place: int
    time_s: float
    time_sigma_s: float
    gain_mm: float
    sigma_mm: float
    p_value: float
    rivals: tuple[EventKind, ...]
    lasting_s: float = SHORTEST_S
    agreements: tuple[Agreement, ...] = ()
    stray: int = 1

    @property
    def doubt(self) -> str:
        """What else it may be, as a sentence with its time and size; empty where it is a slip."""
        words = {
            EventKind.OUTLIER: f"{self.stray} misplaced picture{'s' * (self.stray != 1)}",
            EventKind.LOST_TIME: "missing frames",
        }
        slip = f"At {self.time_s:.2f} s the reading gains {self.gain_mm:+.2f} mm: a slip of the wheel"
        return or_else(slip, " or ".join(words[r] for r in self.rivals)) if self.rivals else ""


def or_else(slip: str, instead: str) -> str:
    """Return a sentence that a slip may be something else, and how to decide."""
    return f"{slip}, or {instead}; they look the same here: record the passage again, slowly."


def steps_found(fit: TravelFit, encoder: Encoder) -> tuple[StepFound, ...]:
    """Return the steps among the fit's events, each judged with the others included."""
    steps = (k for k, event in enumerate(fit.events) if event.kind is not EventKind.OUTLIER)
    return tuple(_judged(fit, k, encoder) for k in steps)


def _judged(fit: TravelFit, place_in_list: int, encoder: Encoder) -> StepFound:
    event, time_s, own = fit.events[place_in_list], fit.sight.time_s, 4 + place_in_list
    # Where a uniform motion is rounded alike by the counts on one side, no mean helps.
    rounding = quantum_mm(encoder) * np.sqrt(2 / 12)
    gain_mm, sigma = float(fit.values[own]), float(np.hypot(fit.sigma[own], rounding))
    at_s, lasting_s, again = _moment_and_duration(fit, place_in_list, encoder, sigma)
    jumps = again is not None and again.confirmation.agrees
    # Somewhere between two pictures; where the reading itself jumps, for the duration of a short slip.
    short = jumps and not event.during
    within_s = SHORTEST_S if short else float(time_s[event.place] - time_s[event.place - 1])
    beyond, count = min(event.place - event.during, len(time_s) - event.place), len(time_s)
    z2 = float(fit.event_z2[place_in_list]) if np.isfinite(sigma) else 0.0
    if event.kind is EventKind.STEP and np.isfinite(sigma) and not short:
        even = _over_durations(fit, place_in_list)
        if even is not None:
            gain_mm, sigma = even[0], float(np.hypot(even[1], rounding))
    # Errors of pictures cannot make the encoder's reading jump.
    rivals = () if jumps else _rivals(fit, place_in_list, encoder, at_end=beyond <= SIDE)
    # A lasting slip may be stray pictures throughout, one near an end stray pictures up to the end.
    stray = event.during + (beyond if beyond <= SIDE else 0)
    return StepFound(
        event.place, at_s, within_s / np.sqrt(12), gain_mm, sigma, chance(z2, 2 * count, count), rivals,
        lasting_s, () if again is None else (again,), max(stray, 1),
    )  # fmt: skip


def _moment_and_duration(
    fit: TravelFit, place_in_list: int, encoder: Encoder, sigma_mm: float
) -> tuple[float, float, Agreement | None]:
    """Return a step's time and duration, s, and whether the reading alone agrees."""
    event = fit.events[place_in_list]
    if event.during:
        again = course_of_reading(fit, place_in_list, encoder)
        return *_middle_and_duration(fit, place_in_list), again
    k = moment(fit.sight, encoder, event.place)
    again = jump_of_reading(encoder, k, float(fit.values[4 + place_in_list]), sigma_mm)
    return float(encoder.time_s[k] + encoder.time_s[k + 1]) / 2, SHORTEST_S, again


def _over_durations(fit: TravelFit, place_in_list: int) -> tuple[float, float] | None:
    """Return the size and 1 σ of an even slip of unknown time and duration.

    Every moment nearby and every possible duration of a slip are equally likely in advance. What a slip gains
    at its start and end is lost in the noise of single pictures, so that the size is too small if it is taken
    for an instant step or a shorter slip. None where the slip is not even.
    """
    own, event, sight = 4 + place_in_list, fit.events[place_in_list], fit.sight
    first = 4 + len(fit.events) + sum(e.during for e in fit.events[:place_in_list])
    rest = fit.with_columns(np.delete(fit.columns, [own, *range(first, first + event.during)], axis=1))
    steps = np.arange(int(np.ceil(LONGEST_S / sight.frame_time_s)) + 1)
    about_s = np.mean(sight.time_s[[event.place - event.during - 1, event.place]])
    middle = about_s + sight.frame_time_s * 0.5 * np.append(-steps[:0:-1], steps)
    lasts, at = (x.ravel() for x in np.meshgrid(np.maximum(sight.frame_time_s * steps, SHORTEST_S), middle))
    value, gain = rest.gain(np.clip((sight.time_s[:, None] - at) / lasts + 0.5, 0.0, 1.0))
    # Noise is estimated from the pictures' usual steps; the residual may be larger.
    more = float(fit.covariance[own, own] / fit.whitened.covariance[own, own])
    uneven = rest.residual @ rest.weighted - fit.whitened.residual @ fit.whitened.weighted - gain.max()
    if event.during and uneven > more * chi2.isf(_EVEN, event.during):
        return None
    weight = np.exp(0.5 * (gain - gain.max()) / more)
    weight /= weight.sum()
    mean = float(weight @ value)
    variance = more * np.where(gain > 0, value**2 / np.maximum(gain, 1e-12), 0.0)
    jump = float(fit.values[own] - fit.whitened.estimate[own])
    return mean + jump, float(np.sqrt(weight @ (variance + (value - mean) ** 2)))


def _middle_and_duration(fit: TravelFit, place_in_list: int) -> tuple[float, float]:
    """Return when a lasting slip has its middle, and the duration of an even one of that spread, s."""
    event, time_s = fit.events[place_in_list], fit.sight.time_s
    around = time_s[event.place - event.during - 1 : event.place + 1]
    course, middle = _course(fit, place_in_list), around[:-1] + np.diff(around) / 2
    share = course / course.sum()
    mean = float(np.clip(share @ middle, around[0], around[-1]))
    # Within a gap between pictures the slip is taken to be uniform, as in its course.
    spread = float(share @ (middle - mean) ** 2) + float(np.median(np.diff(around))) ** 2 / 12
    return mean, float(np.clip(np.sqrt(12 * max(spread, 0.0)), SHORTEST_S, np.ptp(around)))


def _rivals(
    fit: TravelFit, place_in_list: int, encoder: Encoder, at_end: bool
) -> tuple[EventKind, ...]:  # fmt: skip
    """Return what else explains a step; ``at_end`` of the run, where pictures beside it are few."""
    found = _as_good(fit, place_in_list, encoder)
    few = at_end and EventKind.OUTLIER not in found
    return (EventKind.OUTLIER, *found) if few else found


def _as_good(fit: TravelFit, place_in_list: int, encoder: Encoder) -> tuple[EventKind, ...]:
    """Return the events of another kind that explain a step as well."""
    event, sight = fit.events[place_in_list], fit.sight
    if event.during:
        # Pictures that drift for a while look the same, except in the reading's own motion. Fiducials do not
        # drift.
        return () if sight.placed else (EventKind.OUTLIER,)
    others = fit.events[:place_in_list] + fit.events[place_in_list + 1 :]
    rest = fitted(sight, encoder, others, fit.noise, fit.without)
    # The step itself is excluded from the speed.
    speed = median_filter(np.gradient(sight.distance_mm, sight.time_s), 5)
    score, size = {}, {}
    for kind in EventKind:
        value, gain = rest.whitened.gain_in_parts(candidate_columns(sight, kind, speed))
        near = slice(max(event.place - 2, 0), event.place + 3)
        size[kind], score[kind] = float(value[near][np.argmax(gain[near])]), float(gain[near].max())
    sigma = float(fit.sigma[4 + place_in_list])
    return tuple(
        k
        for k in EventKind
        if k is not event.kind
        and score[k] > score[event.kind] - _APART
        and (k is not EventKind.LOST_TIME or _whole_frames(sight, size[k], sigma, speed[event.place]))
    )


def _whole_frames(sight: Sight, missing_s: float, sigma_mm: float, speed_mm_s: float) -> bool:
    """Return whether a time is that of one or two frames, which a camera may lose or write twice."""
    frames = missing_s / sight.frame_time_s
    sigma = _WITHIN * sigma_mm / max(abs(speed_mm_s), 1e-9) / sight.frame_time_s
    return 0 < abs(round(frames)) <= _UNNOTICED and abs(frames - round(frames)) < sigma + _TIMING
