"""One effect estimated from disjoint parts of a recording's travel, so that each part predicts the other.

A column is split by increments: what it adds between two pictures belongs to one part, so that a part keeps
what it has gained. Everything else stays shared, and the difference of the parts has its true covariance.
"""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Bool, Float, Int
from pipeline.pages import notation
from pipeline.physics.catalogue import effect
from stages.diagnose.agreement import Agreement, Part, agreement
from stages.diagnose.travel.model import TravelFit
from stages.diagnose.travel.noise import whitened_fit
from stages.diagnose.travel.solve import DELAY, PLAY, SCALE, SMOOTH


def second_predictions(fit: TravelFit, column: int, allowed: float = 0.0) -> tuple[Agreement, ...]:
    """Return what disjoint parts of the travel say of the effect of a column, those that tell enough.

    ``allowed`` is 1 σ by which each part may be off for what is no noise of single readings.
    """
    each = [_compared(fit, column, words, first, allowed) for words, first in _splits(fit, column)]
    return tuple(a for a in each if a is not None)


def _splits(fit: TravelFit, column: int) -> list[tuple[tuple[str, str], Bool]]:
    """Return names of two parts, and which steps (N − 1,) from picture to picture belong to the first."""
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
    """Return the number (N − 1,) of the reversal to which each step of the play's column belongs."""
    moved = np.flatnonzero(np.abs(step) > 1e-9)
    if not len(moved):
        return np.zeros(len(step), np.int64)
    sign = np.sign(step)[moved]
    number = np.concatenate([[0], np.cumsum(sign[1:] != sign[:-1])])
    return np.asarray(number[np.clip(np.searchsorted(moved, np.arange(len(step))), 0, len(moved) - 1)])


def _compared(
    fit: TravelFit, column: int, where: tuple[str, str], first: Bool, allowed: float
) -> Agreement | None:
    value, covariance = split(fit, column, first)
    covariance = covariance + allowed**2 * np.eye(2)
    if not np.all(np.isfinite(covariance)):
        return None
    parts = [
        Part(name, _words(column, v, float(np.sqrt(variance))), np.array([v]))
        for name, v, variance in zip(where, value, np.diag(covariance), strict=True)
    ]
    gap = covariance[0, 0] + covariance[1, 1] - 2 * covariance[0, 1]
    own = (covariance[:1, :1], covariance[1:, 1:])
    return agreement(parts[0], parts[1], own, np.array([[gap]]))


def split(fit: TravelFit, column: int, first: Bool) -> tuple[Float, Float]:
    """Return a column's size (2,) in two parts with its covariance (2, 2), all others shared."""
    step = np.diff(fit.columns[:, column])
    halves = [np.concatenate([[0.0], np.cumsum(np.where(mask, step, 0.0))]) for mask in (first, ~first)]
    design = np.column_stack([np.delete(fit.columns, column, 1), *halves])
    difference = fit.whitened.residual + fit.columns @ fit.whitened.estimate
    found = whitened_fit(difference, design, fit.noise.covariance(fit.sight.path_mm))
    return found.estimate[-2:], found.covariance[-2:, -2:]


def _words(column: int, value: float, sigma: float) -> str:
    quantity = effect(SMOOTH[column]).quantities[0]
    return f"{quantity.name} {value:.4g} {notation.plus_minus(sigma, quantity.unit)}"
