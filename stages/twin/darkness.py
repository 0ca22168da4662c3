"""The brightness of a frame where it sees no wall: the black level of that frame."""

from __future__ import annotations

import cv2
import numpy as np

from pipeline.arrays import Bool, Float32
from stages.twin.compare import BLOCK_PX

_DARKEST, _ALIKE, _FEWEST = 0.05, 1.0, 256
"""Share of what no LED lights that must see no wall, as the corners of a round view do; grey levels by which
it may be brighter, as much as light that is named; fewest pixels. Chosen."""


def level_of_no_wall(above: Float32, unlit: Bool) -> float:
    """Return the mean level of a frame (H, W) where it sees no wall; NaN if there is no such place.

    Places that no LED lights, ``unlit`` (H, W), may still be wall lit by something else while the LEDs are
    off: only the darkest of them count, and those equally dark.
    """
    if not unlit.any():
        return float("nan")
    smooth = cv2.blur(above, (BLOCK_PX, BLOCK_PX))
    dark = above[unlit & (smooth < float(np.quantile(smooth[unlit], _DARKEST)) + _ALIKE)]
    return float(dark.mean(dtype=float)) if dark.size >= _FEWEST else float("nan")
