"""By how much the walls in photo and rings differ beyond noise, and in which stretches of a run.

The noise of two landmarks is independent. What two of them share is therefore an error of the picture, of the
lens, or of the sheet of laser light. Two kinds of pairs are compared, since each shows what the other does
not. Neighbours on the wall share whatever displaces the picture smoothly, for however short a time.
Landmarks far apart that pass the same place of the window share only what stays there, but are many more.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from itertools import pairwise

import numpy as np

from pipeline.arrays import Bool, Float, Int

_SURE = 5.0
"""Standard errors from which it is certain: chosen, far beyond chance."""
_MOST_EDGES = 200
"""Most places of a run at which a stretch may begin: a bound on time and memory alone."""

_ROUNDING = 1e-9
"""Share of a square of sums below which a difference from it is rounding: there are no such pairs."""


@dataclass(frozen=True)
class Shared:
    """Weighted sums over pairs of landmarks.

    Attributes
    ----------
    product_mm2, square_mm4, weight : float
        Sums of the products of their differences from the line, of these products squared, and of the
        weights.
    """

    product_mm2: float = 0.0
    square_mm4: float = 0.0
    weight: float = 0.0

    @property
    def in_errors(self) -> float:
        """Return the shared variance over its standard error; by chance it has any sign, and a size of 1."""
        return self.product_mm2 / float(np.sqrt(self.square_mm4)) if self.square_mm4 > 0 else 0.0

    @property
    def noise_mm(self) -> float:
        """Return the difference, 1 σ, whose square is the standard error of the shared variance."""
        return float(np.sqrt(np.sqrt(self.square_mm4) / self.weight)) if self.weight > 0 else np.inf

    @property
    def size_mm(self) -> float:
        """Return the difference, 1 σ, that the pairs share.

        Line and photo may both be displaced, or one alone, so that the line's own error may be all of it. The
        variance v with its standard error e is shrunk to v (1 − e² / v²), and to 0 below one standard error
        (the non-negative garrote of Breiman, 1995): noise alone adds less than the standard error would.
        """
        if self.in_errors <= 1:
            return 0.0
        return float(np.sqrt(self.product_mm2 / self.weight * (1 - self.in_errors**-2)))


@dataclass(frozen=True)
class WallTwice:
    """Differences of photo and line in K short parts of a run, in their order.

    Attributes
    ----------
    frame : (K,)
        Mean frame in which the laser passes a part's landmarks, counted from the run's first.
    neighbours : (K, 3)
        Sums over the neighbours on the wall, as in `Shared`.
    total, weight : (K, C)
        Sums over the landmarks that the laser passes in each sector of the image: weighted differences, mm⁻¹,
        and weights, mm⁻².
    """

    frame: Float
    neighbours: Float
    total: Float
    weight: Float

    @staticmethod
    def none() -> WallTwice:
        """Return a comparison without landmarks."""
        return WallTwice(np.zeros(0), np.zeros((0, 3)), np.zeros((0, 1)), np.zeros((0, 1)))

    @staticmethod
    def joined(parts: Sequence[WallTwice]) -> WallTwice:
        """Return the parts of successive windows of a run, those without landmarks left out."""
        known = [p for p in parts if len(p.frame)]
        if not known:
            return WallTwice.none()
        return WallTwice(*(np.concatenate([getattr(p, f.name) for p in known]) for f in fields(WallTwice)))

    def between(self, first: int, last: int) -> WallTwice:
        """Return the parts in frames from ``first`` to before ``last``, counted as ``frame`` is."""
        return self._some((self.frame >= first) & (self.frame < last))

    def _some(self, which: slice | Bool) -> WallTwice:
        return WallTwice(*(getattr(self, f.name)[which] for f in fields(self)))

    def later(self, frames: int) -> WallTwice:
        """Return the parts with frames counted from so many frames before."""
        return replace(self, frame=self.frame + frames)

    @property
    def on_wall(self) -> Shared:
        """Return what neighbours on the wall share."""
        return Shared(*self.neighbours.sum(0).tolist())

    @property
    def on_window(self) -> Shared:
        """Return what landmarks in the same sector of the image share that are not in neighbouring parts."""
        whole = np.array([0, len(self.frame)])
        return Shared(*(float(s[0, 1]) for s in self._apart(whole)))

    @property
    def size_mm(self) -> float:
        """Return the difference, 1 σ, as a mean over all parts: the larger of what both kinds share."""
        return max(self.on_wall.size_mm, self.on_window.size_mm)

    @property
    def noise_mm(self) -> float:
        """Return the smallest difference, 1 σ, that noise alone hides from neither kind of pairs."""
        return min(self.on_wall.noise_mm, self.on_window.noise_mm)

    @property
    def is_certain(self) -> bool:
        """Return whether pairs of either kind share a difference beyond doubt."""
        return max(self.on_wall.in_errors, self.on_window.in_errors) > _SURE

    def stretches(self) -> tuple[WallTwice, ...]:
        """Return the parts in stretches; there are several only if their differences certainly differ.

        Circular binary segmentation (A. B. Olshen et al., 2004): a stretch is cut where its shared variance,
        in standard errors squared, exceeds that of the whole by more than chance would: at the best of all
        places for each cut (Bonferroni).
        """
        count = len(self.frame)
        edges = np.unique(np.linspace(0, count, min(count, _MOST_EDGES) + 1).astype(int))
        if count < 2:
            return (self,)
        cuts = _cut(self._evidence(edges), 0, len(edges) - 1)
        return tuple(self._some(slice(edges[a], edges[b])) for a, b in cuts)

    def _evidence(self, edges: Int) -> Float:
        """Return the evidence (E, E) for a difference between each edge and each later one."""
        sums = _summed_to(self.neighbours)[edges]
        wall = np.moveaxis(sums[None] - sums[:, None], -1, 0)
        return _squared(*wall[:2]) + _squared(*self._apart(edges)[:2])

    def _apart(self, edges: Int) -> tuple[Float, Float, Float]:
        """Return `Shared` (E, E) of each interval, of pairs in one sector and not in neighbouring parts."""
        total, weight = self.total, self.weight
        return _products_apart(total, edges), _products_apart(total**2, edges), _products_apart(weight, edges)


def _products_apart(value: Float, edges: Int) -> Float:
    """Return the sums (E, E) of products of values (K, C) of one column that lie two rows apart or more."""
    own = np.sum(value**2, 1)
    next_to = np.zeros(len(value) + 1)
    next_to[1:-1] = 2 * np.sum(value[1:] * value[:-1], 1)
    total, near = (_summed_to(v)[edges] for v in (value, own + next_to[:-1]))
    whole = np.sum((total[None] - total[:, None]) ** 2, -1)
    pairs = (whole - (near[None] - near[:, None] - next_to[edges][:, None])) / 2
    return np.where(np.abs(pairs) > _ROUNDING * whole, pairs, 0.0)


def _summed_to(values: Float) -> Float:
    """Return the sums (K + 1, ...) of the values (K, ...) before each place."""
    return np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, 0)])


def _squared(product: Float, square: Float) -> Float:
    """Return the squares of products over their standard errors; 0 for negative products."""
    return np.where(square > 0, np.maximum(product, 0.0) ** 2 / np.where(square > 0, square, 1.0), 0.0)


def _cut(evidence: Float, first: int, last: int) -> list[tuple[int, int]]:
    """Return the limits of the stretches from one edge to another."""
    i, j = np.triu_indices(last - first + 1, 1)
    i, j = i + first, j + first
    gain = evidence[i, j] + evidence[first, i] + evidence[j, last] - evidence[first, last]
    cuts = (i > first).astype(int) + (j < last)
    gain -= _SURE**2 + 2 * cuts * np.log(last - first + 1)
    best = int(np.argmax(gain))
    if gain[best] <= 0 or not cuts[best]:
        return [(first, last)]
    limits = np.unique([first, i[best], j[best], last]).tolist()
    return [c for a, b in pairwise(limits) for c in _cut(evidence, a, b)]
