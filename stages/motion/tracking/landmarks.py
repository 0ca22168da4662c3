"""The texture landmarks known so far, grown while the wall is followed; those given up are put aside."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pipeline.arrays import Bool, Float, Int
from stages.motion.tracking.patches import Patches

_FEWEST_DROPPED = 256


@dataclass
class LandmarkMap:
    """Strip positions, offsets, patches and history of the landmarks (L,) that may still be looked for.

    Attributes
    ----------
    half : int
        Half size of a patch, strip px.
    number : (L,) int
        Landmarks are numbered in the order in which they were found.
    row, column : (L,)
        Strip position where the landmark was found first.
    offset : (L, 2)
        How far it lies now from there beside the motion of the whole strip, strip px.
    born : (L,) int
        First frame.
    retired : (L,) bool
        No longer looked for.
    misses : (L,) int
        Times in a row that it was not found.
    patches : list of Patches
        Appearance, in batches.
    found : int
        Landmarks found so far, dropped ones included.
    """

    half: int
    number: Int = field(default_factory=lambda: np.zeros(0, np.int64))
    row: Float = field(default_factory=lambda: np.zeros(0))
    column: Float = field(default_factory=lambda: np.zeros(0))
    offset: Float = field(default_factory=lambda: np.zeros((0, 2)))
    born: Int = field(default_factory=lambda: np.zeros(0, np.int64))
    retired: Bool = field(default_factory=lambda: np.zeros(0, bool))
    misses: Int = field(default_factory=lambda: np.zeros(0, np.int64))
    patches: list[Patches] = field(default_factory=list)
    found: int = 0

    def gather(self, index: Int) -> Patches:
        """Return the patches of landmarks at places (N,) as one batch."""
        starts = self._starts()
        batch = np.searchsorted(starts, index, side="right") - 1
        if not index.size:
            return Patches.none(2 * self.half + 1)
        parts = [(self.patches[b], index[batch == b] - starts[b]) for b in np.unique(batch)]
        return Patches.joined([p.of(i) for p, i in parts])

    def add(self, at: Float, born: int, patches: Patches) -> None:
        """Add landmarks at strip positions (N, 2)."""
        n = len(at)
        self.number = np.append(self.number, self.found + np.arange(n))
        self.row, self.column = np.append(self.row, at[:, 0]), np.append(self.column, at[:, 1])
        self.offset = np.concatenate([self.offset, np.zeros((n, 2))])
        self.born = np.append(self.born, np.full(n, born))
        self.retired = np.append(self.retired, np.zeros(n, bool))
        self.misses = np.append(self.misses, np.zeros(n, np.int64))
        self.patches.append(patches)
        self.found += n

    @property
    def is_crowded(self) -> bool:
        """Whether so many landmarks are retired that it pays to drop them."""
        return int(self.retired.sum()) > max(len(self.retired) // 2, _FEWEST_DROPPED)

    def drop(self, gone: Bool) -> Int:
        """Forget landmarks (L,), so that the work of a frame does not grow; return their numbers."""
        dropped, keep, starts = self.number[gone], ~gone, self._starts()
        kept = [p.of(keep[a:b]) for p, a, b in zip(self.patches, starts[:-1], starts[1:], strict=True)]
        self.patches = [p for p in kept if len(p.value)]
        for name in ("number", "row", "column", "offset", "born", "retired", "misses"):
            setattr(self, name, getattr(self, name)[keep])
        return np.asarray(dropped)

    def _starts(self) -> Int:
        return np.cumsum([0] + [len(p.value) for p in self.patches])
