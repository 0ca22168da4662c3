"""Chooses the candidate of each sector that is the line: traces the ring as one closed curve.

The candidates are the states of a hidden Markov chain around the circle. The likelihood of a candidate
depends on its distance from the ring expected from the image before, on its brightness relative to the rest
of the ring, and on how well the curve continues to the next sector. Each of these has an upper bound: the
wall may jump, a pit may be dark, and no single property decides. The forward–backward algorithm (L. R.
Rabiner, Proc. IEEE 77, 1989, § III) gives every candidate's probability; σ of the position includes the
chance of a wrong choice.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from pipeline.adjustment.robust import robust_spread
from pipeline.arrays import Float
from stages.rings.kernels import slow_around
from stages.rings.search import Candidates

# 1 σ by which the curve moves radially from one sector to the next, and by which it leaves the ring expected
# from the image before, in line widths. Both are generous: they separate candidates a few widths apart.
_BEND_WIDTHS, _MOVE_WIDTHS = 0.5, 1.5
# Most that each may count against a candidate, as a logarithm of odds. A jump weighs like one sample of wrong
# brightness, so that a step of two or three sectors is accepted; leaving the expected place weighs least.
_MOST_BEND, _MOST_MOVE, _MOST_BRIGHTNESS = 4.0, 1.0, 3.0
# 1 σ of the logarithm of a line's brightness from sector to sector, where the wall reflects evenly.
_LEAST_SPREAD = 0.3


class Choice(NamedTuple):
    """The line's place in every sector, (A,) each; NaN where there is no candidate.

    ``radius_px``: the most likely candidate; ``probability``: that it is the line; ``spread_px``: root of the
    mean square distance of all candidates from it, weighted with their probabilities.
    """

    radius_px: Float
    probability: Float
    spread_px: Float


def choose_line(candidates: Candidates, expected_px: Float, width_px: float) -> Choice:
    """Return the most likely closed curve through ``candidates`` (A, K) near ``expected_px`` (A,)."""
    known = np.isfinite(candidates.radius_px)
    first = np.where(known[:, 0], candidates.radius_px[:, 0] - expected_px, np.nan)
    away = candidates.radius_px - (expected_px + slow_around(first))[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        brightness = np.where(known, np.log(candidates.score), np.nan)
    brightness = brightness - slow_around(brightness[:, 0].copy())[:, None]
    spread = robust_spread(brightness[known[:, 0], 0]) if known.any() else 0.0
    odds = -np.minimum(0.5 * (away / (_MOVE_WIDTHS * width_px)) ** 2, _MOST_MOVE)
    odds -= np.minimum(0.5 * (brightness / max(spread, _LEAST_SPREAD)) ** 2, _MOST_BRIGHTNESS)
    probability = _posterior(away, np.where(known, np.exp(odds), 0.0), _BEND_WIDTHS * width_px, _MOST_BEND)
    return _likeliest(candidates.radius_px, probability)


def _likeliest(radius_px: Float, probability: Float) -> Choice:
    sector = np.arange(len(radius_px))
    best = np.argmax(probability, axis=1)
    chosen = radius_px[sector, best]
    apart = np.nan_to_num(radius_px - chosen[:, None])
    spread = np.sqrt((probability * apart**2).sum(1))
    return Choice(np.where(probability[sector, best] > 0, chosen, np.nan), probability[sector, best], spread)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _step(message, away, other, weight, bend, most, out):  # type: ignore[no-untyped-def]
    """Pass ``message`` (K,) at places ``away`` on to the places ``other``, times their ``weight``."""
    total = 0.0
    for j in range(other.size):
        out[j] = 0.0
        if weight[j] > 0.0:
            for i in range(away.size):
                if message[i] > 0.0:
                    x = (other[j] - away[i]) / bend
                    out[j] += message[i] * np.exp(-min(0.5 * x * x, most))
            out[j] *= weight[j]
            total += out[j]
    for j in range(other.size):
        out[j] = out[j] / total if total > 0.0 else 0.0
    return total > 0.0


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _posterior(away, weight, bend, most):  # type: ignore[no-untyped-def]
    """Probability (A, K) of every candidate, 0 in sectors without any.

    Each direction is walked twice around, and the second turn is used: it no longer depends on the start.
    Sectors without a candidate are passed over.
    """
    sectors, states = away.shape
    forward, backward = np.zeros((sectors, states)), np.zeros((sectors, states))
    message, out = np.empty(states), np.empty(states)
    for messages, way in ((forward, 1), (backward, -1)):
        last = -1
        for s in range(2 * sectors):
            a = s % sectors if way > 0 else sectors - 1 - s % sectors
            total = 0.0
            for j in range(states):
                total += weight[a, j]
            if not total > 0.0:
                continue
            if last >= 0:
                _step(message, away[last], away[a], weight[a], bend, most, out)
            for j in range(states):
                message[j] = out[j] if last >= 0 else weight[a, j] / total
                messages[a, j] = message[j]
            last = a
    for a in range(sectors):
        total = 0.0
        for j in range(states):
            # Both messages hold the sector's own weight once.
            forward[a, j] = forward[a, j] * backward[a, j] / weight[a, j] if weight[a, j] > 0.0 else 0.0
            total += forward[a, j]
        for j in range(states):
            forward[a, j] = forward[a, j] / total if total > 0.0 else 0.0
    return forward
