"""The texture landmarks known so far, grown while the wall is followed."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from stages.motion.matching import Patches

Float = NDArray[np.float64]
Int = NDArray[np.int64]


@dataclass
class LandmarkMap:
    """Strip positions, offsets, patches and history of all landmarks (L,).

    Attributes
    ----------
    half : int
        Half size of a patch, strip px.
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
        Appearance, in the batches in which they were added.
    """

    half: int
    row: Float = field(default_factory=lambda: np.zeros(0))
    column: Float = field(default_factory=lambda: np.zeros(0))
    offset: Float = field(default_factory=lambda: np.zeros((0, 2)))
    born: Int = field(default_factory=lambda: np.zeros(0, np.int64))
    retired: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, bool))
    misses: Int = field(default_factory=lambda: np.zeros(0, np.int64))
    patches: list[Patches] = field(default_factory=list)

    def gather(self, index: Int) -> Patches:
        """Return the patches of landmarks (N,) as one batch."""
        starts = np.cumsum([0] + [len(p.value) for p in self.patches])
        batch = np.searchsorted(starts, index, side="right") - 1
        if not index.size:
            return Patches.none(2 * self.half + 1)
        parts = [(self.patches[b], index[batch == b] - starts[b]) for b in np.unique(batch)]
        return Patches.joined([p.of(i) for p, i in parts])

    def add(self, at: Float, born: int, patches: Patches) -> None:
        """Add landmarks at strip positions (N, 2)."""
        n = len(at)
        self.row, self.column = np.append(self.row, at[:, 0]), np.append(self.column, at[:, 1])
        self.offset = np.concatenate([self.offset, np.zeros((n, 2))])
        self.born = np.append(self.born, np.full(n, born))
        self.retired = np.append(self.retired, np.zeros(n, bool))
        self.misses = np.append(self.misses, np.zeros(n, np.int64))
        self.patches.append(patches)
