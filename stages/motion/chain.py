"""How errors run on through a chain of windows, and what closed loops leave of them.

Errors are a Gauss-Markov chain: within a window as its adjustment has them, from window to window by the
anchors, and alike in all by the numbers that windows share. A closure measures a difference of errors between
two far ends; conditioning on all closures is the least-squares distribution of what they show. D. Simon,
"Optimal state estimation", 2006, § 3.1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.stats import chi2

Float = NDArray[np.float64]
Int = NDArray[np.int64]


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
class Closures:
    """What C measured differences show of errors at the chain's K frames.

    Attributes
    ----------
    by_error : (K, 6, C)
    residual : (C,)
    sigma : (C,)
        1 σ of the measurements, which do not err alike.
    place : (C,) int
        Which place each belongs to: those of one place are judged together.
    """

    by_error: Float
    residual: Float
    sigma: Float
    place: Int

    def at(self, places: Int) -> Closures:
        """Return those of some places."""
        mine = np.isin(self.place, places)
        return Closures(self.by_error[..., mine], self.residual[mine], self.sigma[mine], self.place[mine])


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

    def covariance_with(self, by_error: Float) -> Float:
        """Return the covariance (K, 6, C) of all errors with C sums of them, given by weights (K, 6, C).

        Once back through the chain and once forth: the work grows with its length and no faster.
        """
        cuts = np.cumsum([len(link.at) for link in self.links])[:-1]
        weights = [part.copy() for part in np.split(by_error, cuts)]
        response = np.concatenate([link.response for link in self.links])
        shared = self.shared @ np.einsum("kis,kic->sc", response, by_error)
        later = np.zeros(by_error.shape[1:])
        for link, weight in zip(reversed(self.links), reversed(weights), strict=True):
            weight[-1] += later
            later = np.einsum("kij,kic->jc", link.carry, weight)
        anchor, found = self.start @ later, []
        for link, weight in zip(self.links, weights, strict=True):
            found.append(np.tensordot(link.joint, weight, 2) + link.carry @ anchor)
            anchor = found[-1][-1]
        return np.asarray(np.concatenate(found) + response @ shared)

    def spread(self, closures: Closures) -> Float:
        """Return the covariance (C, C) of the residuals before any loop is closed."""
        own = np.einsum("kic,kid->cd", closures.by_error, self.covariance_with(closures.by_error))
        return np.asarray((own + own.T) / 2 + np.diag(closures.sigma**2))

    def conditioned(self, closures: Closures) -> Conditioned:
        """Return what closures together say of the errors."""
        with_all = self.covariance_with(closures.by_error)
        solved = cho_factor(self.spread(closures), lower=True)
        gain = cho_solve(solved, with_all.reshape(-1, len(closures.residual)).T).T.reshape(with_all.shape)
        gained = np.einsum("kic,kjc->kij", gain, with_all)
        return Conditioned(gain @ closures.residual, (gained + np.swapaxes(gained, 1, 2)) / 2)


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
