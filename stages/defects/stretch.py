"""A long map some rows at a time: in stretches one after the other, or a sample of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Bool

_ROWS = 1000
_SAMPLED_ROWS, _BLOCKS = 2048, 16


@dataclass(frozen=True)
class Stretch:
    """Some rows of a map: its ``own``, and the ``wide`` rows that have a say in them."""

    own: slice
    wide: slice

    @property
    def inner(self) -> slice:
        """Its own rows, counted from the first of the wide ones."""
        return slice(self.own.start - self.wide.start, self.own.stop - self.wide.start)


def stretches(rows: int, overlap: int = 0) -> list[Stretch]:
    """Return stretches that cover a map of so many rows, each seeing ``overlap`` rows of its neighbours."""
    return [widened(slice(k, min(k + _ROWS, rows)), rows, overlap) for k in range(0, rows, _ROWS)]


def widened(own: slice, rows: int, overlap: int) -> Stretch:
    """Return some of a map's ``rows`` with so many of their neighbours."""
    return Stretch(own, slice(max(0, own.start - overlap), min(rows, own.stop + overlap)))


def sample(usable: Bool) -> tuple[slice, ...]:
    """Return what medians are taken of: a short map, or blocks spread over its ``usable`` rows (S,)."""
    rows, at = len(usable), np.flatnonzero(usable)
    size = _SAMPLED_ROWS // _BLOCKS
    if rows <= _SAMPLED_ROWS or not at.size:
        return (slice(0, rows),)
    spread = at[np.rint(np.linspace(0, len(at) - 1, _BLOCKS)).astype(int)]
    starts = np.unique(np.clip(spread - size // 2, 0, rows - size))
    return tuple(slice(int(first), int(first) + size) for first in starts)
