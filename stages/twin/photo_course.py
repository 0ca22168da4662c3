"""From which frames the wall's photo was made, as far as each frame shows it.

The photo is a mean of measured frames. What changes between them, for example an LED that fails, is therefore
in the photo of the wall that was photographed before or after it: frames differ from the photo by the change
minus its mean over the frames that the photo was made from.
"""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Float, Int
from stages.twin.reference import BlockSamples
from stages.twin.scene import Ring

_REACH_RADII, _NEAREST_RAD = 0.5, 0.2
"""Wall used for the photo on either side of the laser sheet: the default of the stage texture. Least polar
angle at which wall is seen: nearer to the axis no block is all wall."""


def share_of_frames(samples: BlockSamples | None, ring: Ring, frame: Int) -> Float:
    """Return which share of the photo that each of the frames (F,) shows was made from each of them, (F, F).

    Compared frames stand for the measured ones between them. The weights are those of the stage texture: the
    square of what a parabola leaves at a distance from the laser sheet, times the brightness. 0 where nothing
    is known.
    """
    share = np.zeros((len(frame), len(frame)))
    if samples is None:
        return share
    seen = np.flatnonzero(np.isin(frame, samples.number))
    theta = np.maximum(samples.away * np.arctan2(ring.radius_mm, ring.ahead_mm), _NEAREST_RAD)
    from_sheet = 1 / np.tan(theta) - ring.ahead_mm / ring.radius_mm
    bright = np.exp(samples.log_level)
    made = np.maximum(1 - (from_sheet / _REACH_RADII) ** 2, 0.0) ** 2 * bright
    by_frame, whole = _of_cells(samples, made)
    of_cell = np.divide(by_frame, whole, out=np.zeros_like(by_frame), where=whole > 0)
    shown, _ = _of_cells(samples, samples.weight * bright**2 * (whole[samples.orders["wall"], 0] > 0))
    shown /= np.maximum(shown.sum(0), 1e-12)
    order = np.searchsorted(samples.number, frame[seen])
    share[np.ix_(seen, seen)] = (shown.T @ of_cell)[np.ix_(order, order)]
    return share


def _of_cells(samples: BlockSamples, value: Float) -> tuple[Float, Float]:
    """Return sums (C, F) of values (N,) over the blocks of cells of the wall, and over all frames (C, 1)."""
    wall, frames = samples.orders["wall"], len(samples.number)
    sums = np.bincount(wall * frames + samples.frame, value, (int(wall.max()) + 1) * frames)
    by_frame = np.asarray(sums.reshape(-1, frames), float)
    return by_frame, by_frame.sum(1, keepdims=True)
