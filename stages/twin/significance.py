"""Significance of an improvement over frames; consecutive ones see the same wall and are dependent."""

from __future__ import annotations

import numpy as np
from scipy.stats import t

from pipeline.adjustment.robust import left_out_sd
from pipeline.arrays import Float
from stages.twin.cells import sigmas

_MOST_ALIKE = 0.9
"""Largest correlation of neighbours that is used: a higher one cannot be estimated from so few frames."""


def significance_over_frames(fall: Float) -> tuple[float, float]:
    """Return by how many σ the mean of falls (F,), in order of time, is above 0, and the chance of that.

    Consecutive frames see the same wall: correlated falls count as fewer independent frames.
    """
    if len(fall) < 3:
        return 0.0, 1.0
    off = fall - fall.mean()
    alike = float(np.clip((off[1:] * off[:-1]).sum() / max(float((off**2).sum()), 1e-12), 0.0, _MOST_ALIKE))
    worth = (1 - alike) / (1 + alike)
    sigma = sigmas(fall) * float(np.sqrt(worth))
    return sigma, float(t.sf(sigma, len(fall) - 1))


def ratio_over_frames(sums: Float, parts: int) -> tuple[float, float]:
    """Return the ratio of two sums (F, 2) of frames in order of time, and its 1 σ.

    For σ each of so many parts of consecutive frames is left out once.
    """
    each = np.stack([part.sum(0) for part in np.array_split(sums, min(parts, len(sums)))])
    whole = each.sum(0)
    ratio, *without = (cross / max(own, 1e-12) for cross, own in (whole, *(whole - each)))
    return float(ratio), float(left_out_sd(np.array(without)))
