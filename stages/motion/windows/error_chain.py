"""Accumulation of pose errors along a chain of submaps.

Errors form a Gauss-Markov chain (D. Simon, "Optimal state estimation", 2006, § 3.1). Within a window they
have the covariance of its adjustment. From window to window they propagate through the anchors, and the
shared parameters have the same errors in all windows.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Float, Int


@dataclass(frozen=True)
class Link:
    """A window in the chain.

    Attributes
    ----------
    at : (k,) int
        Frames, of the list of all, whose errors are known: from the window's anchor to the next anchor.
    carry : (k, 6, 6)
        Derivatives of the errors at these frames by the anchor's error.
    joint : (k, 6, k, 6)
        Covariance of the errors relative to the anchor, the shared parameters given.
    response : (k, 6, S)
        Derivatives of the poses, relative to the run's first frame, by the shared parameters.
    """

    at: Int
    carry: Float
    joint: Float
    response: Float


@dataclass(frozen=True)
class ErrorSums:
    """C weighted sums of errors, each at a few of the chain's K frames; stored sparsely.

    Attributes
    ----------
    knot : (E,) int
        Indices of the chain's frames, ascending.
    column : (E,) int
        Indices of the sums.
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
        """Return the sums of entries in any order."""
        order = np.argsort(knot, kind="stable")
        return ErrorSums(knot[order], column[order], weight[order], columns)

    def dense(self, first: int, last: int) -> Float:
        """Return the weights (k, 6, C) at frames ``first`` to ``last`` (exclusive) of the chain."""
        part = slice(*np.searchsorted(self.knot, [first, last]))
        out = np.zeros(((last - first) * self.columns, 6))
        np.add.at(out, (self.knot[part] - first) * self.columns + self.column[part], self.weight[part])
        return out.reshape(-1, self.columns, 6).swapaxes(1, 2)

    def select(self, columns: Int, factor: Float) -> ErrorSums:
        """Return some of the sums (c,), each times a factor (c,)."""
        place = np.full(self.columns, -1)
        place[columns] = np.arange(len(columns))
        at = place[self.column]
        mine = at >= 0
        weight = self.weight[mine] * factor[at[mine], None]
        return ErrorSums(self.knot[mine], at[mine], weight, len(columns))


@dataclass(frozen=True)
class ErrorChain:
    """A run's windows, the covariance of its first pose (6, 6) and of the shared parameters (S, S)."""

    links: tuple[Link, ...]
    start: Float
    shared: Float

    @property
    def at(self) -> Int:
        """Return the frames (K,), ascending, whose errors are known."""
        return np.concatenate([link.at for link in self.links])

    def covariances(self) -> Float:
        """Return the covariance (K, 6, 6) of each frame's error."""
        anchor, found = self.start, []
        for link in self.links:
            each = np.arange(len(link.at))
            own = link.carry @ anchor @ np.swapaxes(link.carry, 1, 2) + link.joint[each, :, each]
            found.append(own + link.response @ self.shared @ np.swapaxes(link.response, 1, 2))
            anchor = own[-1]
        return np.concatenate(found)

    def turn_variances(self) -> Float:
        """Return the variance (K, 3) of rotations in C summed up to each frame, given the shared parameters.

        It is the variance of rotations summed from frame to frame, so it only grows along the run: on a
        curved path, an error of heading at the start is not counted as roll later on.
        """
        before, found = np.zeros(3), []
        for link in self.links:
            each = np.arange(len(link.at))
            own = np.diagonal(link.joint[each, :, each], axis1=1, axis2=2)[:, 3:]
            found.append(before + np.maximum.accumulate(np.maximum(own, 0.0), axis=0))
            before = found[-1][-1]
        return np.concatenate(found)

    def covariances_with(self, sums: ErrorSums) -> Iterator[Float]:
        """Yield the covariance (k, 6, C) of each window's errors with C sums of errors.

        The chain is passed once backwards and once forwards: the work grows linearly with its length, and
        memory holds one window's covariance and six numbers for each window and sum.
        """
        ends = np.cumsum([0] + [len(link.at) for link in self.links])
        later = np.zeros((6, sums.columns))
        behind, by_shared = [], np.zeros((len(self.shared), sums.columns))
        for n, link in reversed(list(enumerate(self.links))):
            weight = sums.dense(ends[n], ends[n + 1])
            by_shared += np.einsum("kis,kic->sc", link.response, weight)
            behind.append(later)
            later = np.einsum("kij,kic->jc", link.carry, _with_last(weight, later))
        anchor, shared = self.start @ later, self.shared @ by_shared
        for n, link in enumerate(self.links):
            weight = _with_last(sums.dense(ends[n], ends[n + 1]), behind.pop())
            own = np.tensordot(link.joint, weight, 2) + link.carry @ anchor
            anchor = own[-1]
            yield own + link.response @ shared

    def covariance_of(self, sums: ErrorSums) -> Float:
        """Return the covariance (C, C) of sums of errors."""
        out, first = np.zeros((sums.columns, sums.columns)), 0
        for found in self.covariances_with(sums):
            out += np.einsum("kic,kid->cd", sums.dense(first, first + len(found)), found)
            first += len(found)
        return (out + out.T) / 2


def neighbours(wanted: Int, at: Int) -> tuple[Int, Int, Float]:
    """Return the indices (N,) in ascending ``at`` (K,) on either side of ``wanted``, and the right weight."""
    right = np.clip(np.searchsorted(at, wanted), min(1, len(at) - 1), len(at) - 1)
    left = np.maximum(right - 1, 0)
    return left, right, (wanted - at[left]) / np.maximum(at[right] - at[left], 1)


def interpolated(wanted: Int, at: Int, value: Float) -> Float:
    """Return values (N, ...), linear between those (K, ...) at places (K,) in ascending order."""
    left, right, share = neighbours(wanted, at)
    weight = share.reshape(-1, *[1] * (value.ndim - 1))
    return np.asarray(value[left] * (1 - weight) + value[right] * weight)


def _with_last(weight: Float, later: Float) -> Float:
    """Return a window's weights (k, 6, C) with those of the windows after it (6, C) added."""
    weight[-1] += later
    return weight
