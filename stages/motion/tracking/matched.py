"""Landmarks matched in one frame, and whether they move alike."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pipeline.arrays import Bool, Float, Int

_FEWEST = 12
"""Fewest landmarks whose median gives a frame's displacement. Not measured."""
FEWEST_AGREEING = 0.25
"""Share of the landmarks in view that must move like their neighbour. On noise without texture up to 0.12 do
by chance (`test_no_roll_is_found_on_a_plain_wall`), in HEVC at crf 32 0.3 to 0.6, else nearly all."""
_AGREEING_PX = 1.5
"""Difference, strip samples, up to which neighbours move together: five times ``landmark_sigma_px``."""


@dataclass(frozen=True)
class Matched:
    """Landmarks (N,) looked for: which were found (N,), strip position, offset (N, 2) and 1 σ (N,)."""

    landmark: Int
    good: Bool
    at: Float
    offset: Float
    sigma: Float

    @cached_property
    def agreeing(self) -> float:
        """Return the share of landmarks in view that were found and moved like the next one around the pipe.

        Noise is matched too, wherever it fits best by chance, but then no two landmarks move alike.
        """
        in_view = int(np.isfinite(self.at[:, 0]).sum())
        around = np.argsort(self.at[self.good, 1], kind="stable")
        apart = np.abs(np.diff(self.offset[self.good][around], axis=0)).max(1, initial=0.0)
        return float(np.sum(apart < _AGREEING_PX)) / max(in_view, 1)

    @cached_property
    def lost(self) -> bool:
        """Whether too few were found, or too few of them move alike, to tell how the camera moved."""
        return bool(self.good.sum() < _FEWEST or self.agreeing < FEWEST_AGREEING)

    @cached_property
    def drift(self) -> Float:
        """Common displacement (2,), rows and columns; 0 where they are lost."""
        return np.zeros(2) if self.lost else np.median(self.offset[self.good], 0)
