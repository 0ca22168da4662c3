"""Single events between encoder and visual distance: slips of the wheel, stray pictures, missing frames."""

from __future__ import annotations

import numpy as np
from scipy.stats import t as student

from pipeline.recording.base import Encoder
from stages.diagnose.travel.model import Event, EventKind, TravelFit, candidate_columns, fitted
from stages.diagnose.travel.noise import DriftNoise
from stages.diagnose.travel.sight import Sight
from stages.diagnose.travel.solve import DELAY, FAR_BETTER, PLAY, SMOOTH

# At most this many events are included, one after the other.
_MOST = 16
_ENTERS = 1e-4
# A step needs at least this many pictures on both sides, or they may be stray; with only that many it is in
# doubt.
SIDE = 3
# Prior of the duration of a slip: uniform between the time of a few readings, as over a bead, and this, as in
# mud or grease. What creeps for longer is modelled by the noise's random walk. Debt: data/debts.md.
SHORTEST_S, LONGEST_S = 0.03, 0.5
SLIP = "encoder_slip"
# Below this p-value, motion against encoder shows an effect: in 300 recordings without any, with three smooth
# effects each, a hundredth of one is expected.
TRAVEL_FOUND = 1e-5


def with_events(sight: Sight, encoder: Encoder, without: tuple[str, ...] = ()) -> TravelFit:
    """Return the fit with the events that the readings require, the strongest first.

    Effects in ``without`` are unknown: what they do is attributed to others, and to noise. A slip at a turn
    of the probe looks like play at first, and what that play predicts elsewhere looks like more slips: where
    delay or play is found, events found without them are tested as well.
    """
    fit = _searched(sight, encoder, without)
    lags = [SMOOTH[k] for k in (DELAY, PLAY) if fit.values[k] != 0]
    others = (_searched(sight, encoder, (*without, name)).events for name in lags)
    again = [fitted(sight, encoder, events, None, without) for events in others]
    return min((fit, *again), key=lambda f: _cost(f, fit.noise))


def _cost(fit: TravelFit, noise: DriftNoise) -> float:
    """Return χ² of the residual plus the least gain required of each included event and effect."""
    left = fit.with_columns(fit.columns, noise)
    taken_up = len(fit.events) + np.count_nonzero(fit.values[[DELAY, PLAY]])
    free = sum(e.during for e in fit.events)
    return float(left.residual @ left.weighted + FAR_BETTER * taken_up + np.log(len(left.residual)) * free)


def _searched(sight: Sight, encoder: Encoder, without: tuple[str, ...]) -> TravelFit:
    """Return the fit with the events that the readings require, one after the other."""
    fit = fitted(sight, encoder, (), None, without)
    for _ in range(_MOST):
        event, score, count = _strongest(fit)
        if chance(score, count, len(sight.time_s)) > _ENTERS:
            break
        fit = fitted(sight, encoder, _joined(sight, (*fit.events, event)), None, without)
    fit = _without_needless(fit, encoder)
    wider = tuple(_with_its_ends(sight, e) for e in fit.events)
    if wider == fit.events:
        return fit
    return _without_needless(fitted(sight, encoder, wider, None, without), encoder)


def _with_its_ends(sight: Sight, event: Event) -> Event:
    """Return a lasting slip with one more picture on either side: none alone shows its start and end."""
    if not event.during:
        return event
    first, end = max(event.place - event.during - 1, 1), min(event.place + 1, len(sight.time_s) - 1)
    return Event(event.kind, end, end - first)


def _joined(sight: Sight, events: tuple[Event, ...]) -> tuple[Event, ...]:
    """Return the events, with a step and others during the same possible slip joined to one."""
    out: list[Event] = []
    for event in sorted(events, key=lambda e: e.place - e.during):
        both = _one_slip(out[-1], event, len(sight.time_s) - 1) if out else None
        lasts_s = LONGEST_S if both is None else _around_s(sight, both)[1] - _around_s(sight, both)[0]
        # Between the pictures around it, the slip is shorter by up to one picture's time.
        if both is not None and lasts_s < LONGEST_S + sight.time_s[both.place] - sight.time_s[both.place - 1]:
            out[-1] = both
        else:
            out.append(event)
    return tuple(out)


def _one_slip(first: Event, second: Event, last: int) -> Event | None:
    """Return the slip that two events form together; None where both are stray pictures.

    It begins after the first picture and has ended at the ``last`` one.
    """
    if EventKind.STEP not in (first.kind, second.kind):
        return None
    begins = max(min(e.place - e.during for e in (first, second)), 1)
    end = min(max(e.place + (e.kind is EventKind.OUTLIER) for e in (first, second)), last)
    return Event(EventKind.STEP, end, end - begins)


def _around_s(sight: Sight, event: Event) -> tuple[float, float]:
    """Return the times of the last picture before an event and of the first one after it, s."""
    return float(sight.time_s[event.place - event.during - 1]), float(sight.time_s[event.place])


def _without_needless(fit: TravelFit, encoder: Encoder) -> TravelFit:
    """Return the fit without events that later ones have made unnecessary."""
    while fit.events:
        least = int(np.argmin(fit.event_z2))
        if chance(fit.event_z2[least], 2 * len(fit.sight.time_s), len(fit.sight.time_s)) <= _ENTERS:
            break
        fit = fitted(fit.sight, encoder, fit.events[:least] + fit.events[least + 1 :], None, fit.without)
    return fit


def is_found(p_value: float) -> bool:
    """Return whether a p-value is small enough for an effect between motion and encoder, or in motion."""
    return p_value < TRAVEL_FOUND


def chance(score: float, count: int, measurements: int) -> float:
    """Return the probability that chance makes the largest of ``count`` scores z² as large.

    Medians of increments determine the noise about as well as a third of the measurements would.
    """
    one = 2 * student.sf(np.sqrt(max(score, 0.0)), max(measurements / 3, 3.0))
    return float(min(1.0, count * one))


def _strongest(fit: TravelFit) -> tuple[Event, float, int]:
    sight = fit.sight
    speed = np.gradient(sight.distance_mm, sight.time_s)
    best, score, count = Event(EventKind.STEP, 0), 0.0, 0
    known = (EventKind.STEP,) if SLIP not in fit.without else ()
    for kind in (*known, EventKind.OUTLIER):
        gain = fit.whitened.gain_in_parts(candidate_columns(sight, kind, speed))[1]
        if kind is EventKind.STEP:
            gain[:SIDE], gain[len(gain) - SIDE + 1 :] = 0.0, 0.0
        count += len(gain)
        if gain.max(initial=0.0) > score:
            best, score = Event(kind, int(np.argmax(gain))), float(gain.max())
    return best, score, count
