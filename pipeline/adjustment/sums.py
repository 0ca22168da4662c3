"""What the equations of a `pipeline.adjustment.bordered.BorderedSystem` add up to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Float

BLOCK = 7


@dataclass(frozen=True)
class Sums:
    """Normal equations of N frames and B numbers that all share.

    Attributes
    ----------
    band : (N, R, 7, 7)
        Rows of frame f and columns of frame f - l in ``band[f, l]``; of l = 0 the lower triangle.
    border : (7 N, B)
    corner : (B, B)
    right : (7 N,)
    right_border : (B,)
    """

    band: Float
    border: Float
    corner: Float
    right: Float
    right_border: Float

    @staticmethod
    def empty(frames: int, border: int, lags: int, block: int = BLOCK) -> Sums:
        """Return sums of nothing, of frames with ``block`` unknowns each."""
        size = block * frames
        shapes = (frames, lags, block, block), (size, border), (border, border), (size,), (border,)
        return Sums(*(np.zeros(shape) for shape in shapes))

    def like(self) -> Sums:
        """Return sums of nothing, of the same sizes."""
        return Sums(*(np.zeros_like(a) for a in self.arrays))

    @property
    def arrays(self) -> tuple[Float, ...]:
        """All of them, in the order of the fields."""
        return self.band, self.border, self.corner, self.right, self.right_border

    def add(self, other: Sums) -> None:
        """Add other sums to these."""
        for mine, more in zip(self.arrays, other.arrays, strict=True):
            mine += more
