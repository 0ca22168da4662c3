"""The brightness of a frame where it sees no wall, which is its black level, and beside the line."""

from __future__ import annotations

import cv2
import numpy as np

from pipeline.arrays import Bool, Byte, Float, Float32
from stages.twin.compare import BLOCK_PX
from stages.twin.render import Region, TwinFrame

_DARKEST, _ALIKE, _FEWEST = 0.05, 1.0, 256
"""Share of what no LED lights that must see no wall, as the corners of a round view do; grey levels by which
it may be brighter, as much as light that is named; fewest pixels. Chosen."""
_NO_LINE, _STANDS_OUT, _NEAR_SECTORS = 0.01, 3.0, 2
"""Share of the line's peak below which a pixel of its band is beside it; σ by which a pixel there stands out;
sectors on either side over which light beside the line is averaged: noise and rounding would otherwise add as
much to a faint line as they are. Chosen."""
_OF_MEDIAN, _ROUNDED = 1.483, 0.5
"""1 σ of normal numbers over the median of their sizes; grey levels within which rounding hides light."""


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


def level_beside_line(above: Float32, twin: TwinFrame, sector: Byte, sectors: int) -> Float:
    """Return the grey level (S,) beside the line in its band, by sectors (H, W); 0 within that of rounding.

    A line that lies beside its predicted place stands out from the other pixels, and is excluded.
    Neighbouring sectors are averaged.
    """
    row, column = np.nonzero((twin.region == Region.LINE_CORE) | (twin.region == Region.LINE_FLANK))
    level, grey, at = (a[row, column] for a in (twin.level, above, sector))
    beside = level < _NO_LINE * level.max(initial=0.0)
    total, count = np.zeros(sectors), np.zeros(sectors)
    for k in range(sectors):
        here = grey[beside & (at == k)]
        if len(here):
            away = np.abs(here - np.median(here))
            here = here[away <= _STANDS_OUT * max(_OF_MEDIAN * float(np.median(away)), _ROUNDED)]
            total[k], count[k] = here.sum(dtype=float), len(here)
    near = range(-_NEAR_SECTORS, _NEAR_SECTORS + 1)
    total, count = (np.sum([np.roll(a, k) for k in near], 0) for a in (total, count))
    level = total / np.maximum(count, 1)
    return np.asarray(level * np.clip(level / _ROUNDED - 1, 0.0, 1.0))
