"""How errors run on through a chain of windows, and what closed loops leave of them.

Errors are a Gauss-Markov chain: within a window as its adjustment has them, from window to window by the
anchors, and alike in all by the numbers that windows share. A closure measures a difference of errors between
two far ends; conditioning on all closures is the least-squares distribution of what they show. D. Simon,
"Optimal state estimation", 2006, § 3.1.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.stats import chi2

from pipeline.arrays import Float, Int


@dataclass(frozen=True)
class Link:
    """A window in the chain.

    Attributes
    ----------
    at : (k,) int
        Frames, of the list of all, whose errors are known: from the window's anchor to the next one's.
    carry : (k, 6, 6)
        What the anchor's error does there.
    joint : (k, 6, k, 6)
        Covariance of the errors since the anchor.
    response : (k, 6, S)
        Change of the poses since the run's first frame with the shared numbers.
    """

    at: Int
    carry: Float
    joint: Float
    response: Float


@dataclass(frozen=True)
class ErrorSums:
    """C weighed sums of errors, each at a few of the chain's K frames.

    Attributes
    ----------
    knot : (E,) int
        Which of the chain's frames, ascending.
    column : (E,) int
        Which sum.
    weight : (E, 6)
    columns : int
        Number C of sums.
    """

    knot: Int
    column: Int
    weight: Float
    columns: int

    @staticmethod
    def of(knot: Int, column: Int, weight: Float, columns: int) -> ErrorSums:
        """Return the sums of terms in any order."""
        order = np.argsort(knot, kind="stable")
        return ErrorSums(knot[order], column[order], weight[order], columns)

    def on(self, first: int, last: int) -> Float:
        """Return the weights (k, 6, C) at frames ``first`` to ``last`` (exclusive) of the chain."""
        part = slice(*np.searchsorted(self.knot, [first, last]))
        out = np.zeros(((last - first) * self.columns, 6))
        np.add.at(out, (self.knot[part] - first) * self.columns + self.column[part], self.weight[part])
        return out.reshape(-1, self.columns, 6).swapaxes(1, 2)

    def some(self, columns: Int, factor: Float) -> ErrorSums:
        """Return some of the sums (c,), each times a factor (c,)."""
        place = np.full(self.columns, -1)
        place[columns] = np.arange(len(columns))
        at = place[self.column]
        mine = at >= 0
        weight = self.weight[mine] * factor[at[mine], None]
        return ErrorSums(self.knot[mine], at[mine], weight, len(columns))


@dataclass(frozen=True)
class Closures:
    """What C measured differences show of the chain's errors.

    Attributes
    ----------
    by_error : ErrorSums
    residual : (C,)
    sigma : (C,)
        1 σ of the measurements, which do not err alike.
    place : (C,) int
        Which place each belongs to: those of one place are judged together.
    """

    by_error: ErrorSums
    residual: Float
    sigma: Float
    place: Int

    def at(self, places: Int) -> Closures:
        """Return those of some places."""
        mine = np.flatnonzero(np.isin(self.place, places))
        by_error = self.by_error.some(mine, np.ones(len(mine)))
        return Closures(by_error, self.residual[mine], self.sigma[mine], self.place[mine])


@dataclass(frozen=True)
class Conditioned:
    """Errors (K, 6) that closures show, and by how much the errors' covariances (K, 6, 6) fall."""

    error: Float
    gained: Float


@dataclass(frozen=True)
class Chain:
    """A run's windows, the covariance of its first pose (6, 6) and of the shared numbers (S, S)."""

    links: tuple[Link, ...]
    start: Float
    shared: Float

    @property
    def at(self) -> Int:
        """Return the frames (K,), ascending, whose errors are known."""
        return np.concatenate([link.at for link in self.links])

    def covariances_with(self, sums: ErrorSums) -> Iterator[Float]:
        """Yield the covariance (k, 6, C) of each window's errors with C sums of errors.

        Once back through the chain and once forth: the work grows with its length and no faster, and in
        memory is a window's covariance alone, besides six numbers a window and sum.
        """
        ends = np.cumsum([0] + [len(link.at) for link in self.links])
        later = np.zeros((6, sums.columns))
        behind, by_shared = [], np.zeros((len(self.shared), sums.columns))
        for n, link in reversed(list(enumerate(self.links))):
            weight = sums.on(ends[n], ends[n + 1])
            by_shared += np.einsum("kis,kic->sc", link.response, weight)
            behind.append(later)
            later = np.einsum("kij,kic->jc", link.carry, _with_last(weight, later))
        anchor, shared = self.start @ later, self.shared @ by_shared
        for n, link in enumerate(self.links):
            weight = _with_last(sums.on(ends[n], ends[n + 1]), behind.pop())
            own = np.tensordot(link.joint, weight, 2) + link.carry @ anchor
            anchor = own[-1]
            yield own + link.response @ shared

    def covariance_of(self, sums: ErrorSums) -> Float:
        """Return the covariance (C, C) of sums of errors."""
        out, first = np.zeros((sums.columns, sums.columns)), 0
        for found in self.covariances_with(sums):
            out += np.einsum("kic,kid->cd", sums.on(first, first + len(found)), found)
            first += len(found)
        return (out + out.T) / 2

    def spread(self, closures: Closures) -> Float:
        """Return the covariance (C, C) of the residuals before any loop is closed."""
        return self.covariance_of(closures.by_error) + np.diag(closures.sigma**2)

    def conditioned(self, closures: Closures) -> Conditioned:
        """Return what closures together say of the errors."""
        solved = cho_factor(self.spread(closures), lower=True)
        error, gained = [], []
        for found in self.covariances_with(closures.by_error):
            gain = cho_solve(solved, found.reshape(-1, found.shape[2]).T).T.reshape(found.shape)
            error.append(gain @ closures.residual)
            gained.append(np.einsum("kic,kjc->kij", gain, found))
        fall = np.concatenate(gained)
        return Conditioned(np.concatenate(error), (fall + np.swapaxes(fall, 1, 2)) / 2)


def _with_last(weight: Float, later: Float) -> Float:
    """Return a window's weights (k, 6, C) with those that came in by the windows after it (6, C)."""
    weight[-1] += later
    return weight


def beside(wanted: Int, at: Int) -> tuple[Int, Int, Float]:
    """Return the places in ``at`` (K,), ascending, beside wanted ones (N,), and the right ones' weight."""
    right = np.clip(np.searchsorted(at, wanted), min(1, len(at) - 1), len(at) - 1)
    left = np.maximum(right - 1, 0)
    return left, right, (wanted - at[left]) / np.maximum(at[right] - at[left], 1)


def interpolated(wanted: Int, at: Int, value: Float) -> Float:
    """Return values (N, ...), linear between those (K, ...) at places (K,) in ascending order."""
    left, right, share = beside(wanted, at)
    weight = share.reshape(-1, *[1] * (value.ndim - 1))
    return np.asarray(value[left] * (1 - weight) + value[right] * weight)


def astray(spread: Float, closures: Closures, least_probability: float) -> set[int]:
    """Return the places whose closures the motion and all other places together contradict.

    The worst goes first, then the rest is judged anew. Where two contradict each other and no third tells
    which is wrong, both go.
    """
    out: set[int] = set()
    while True:
        found = _probabilities(spread, closures, out)
        worst = min(found, key=lambda place: (found[place], place), default=-1)
        if worst < 0 or found[worst] >= least_probability:
            return out
        doubted = {place for place in found if place != worst and found[place] < least_probability}
        out |= {worst} | {
            place
            for place in doubted
            if _probabilities(spread, closures, out | {place})[worst] >= least_probability
        }


def _probabilities(spread: Float, closures: Closures, out: set[int]) -> dict[int, float]:
    """Return for each place how probable it is that it lies so far off what all others predict.

    Without a place, the covariance of its residuals is the inverse of its block of the inverse spread.
    """
    keep = np.flatnonzero(~np.isin(closures.place, list(out)))
    information = np.asarray(np.linalg.inv(spread[np.ix_(keep, keep)]), float)
    pull = information @ closures.residual[keep]
    found = {}
    for place in np.unique(closures.place[keep]).tolist():
        mine = closures.place[keep] == place
        square = float(pull[mine] @ np.linalg.solve(information[np.ix_(mine, mine)], pull[mine]))
        found[place] = float(chi2.sf(square, int(mine.sum())))
    return found
