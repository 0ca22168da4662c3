"""By how much frames fit better, and the chance of that: frames that follow each other see the same wall."""

from __future__ import annotations

import numpy as np
from scipy.stats import t

from pipeline.arrays import Float
from stages.twin.cells import sigmas

_MOST_ALIKE = 0.9
"""Correlation of neighbours that counts at most: of so few frames it is not told better."""


def over_frames(fall: Float) -> tuple[float, float]:
    """Return by how many σ falls (F,) in the order of time are above 0, and the chance of that.

    Frames that follow each other see the same wall: as far as their falls are alike they count as fewer.
    """
    if len(fall) < 3:
        return 0.0, 1.0
    off = fall - fall.mean()
    alike = float(np.clip((off[1:] * off[:-1]).sum() / max(float((off**2).sum()), 1e-12), 0.0, _MOST_ALIKE))
    worth = (1 - alike) / (1 + alike)
    told = sigmas(fall) * float(np.sqrt(worth))
    return told, float(t.sf(told, len(fall) - 1))
