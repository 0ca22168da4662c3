"""Errors of ordinary image formation in the measurements: smooth patterns of a hundredth of a pixel.

Compression, clipped peaks and line width over texture move rings and edges by about that much (shared notes
on the recordings). They are unknowns of the recording, so that no effect is seen in what is only baseline.
"""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Float
from stages.diagnose.effects.base import ImagePoints

SIGMA_PX = 0.01
_RING_HARMONICS = (0, 1, 2, 3, 4)
_EDGE_HARMONICS = (0, 1, 2)
_MIDDLE_THETA = 1.1
BASELINE_SIZE = 2 * (2 * len(_RING_HARMONICS) - 1) + 4 * (2 * len(_EDGE_HARMONICS) - 1)


def ring_baseline(points: ImagePoints) -> Float:
    """Return (M, 18) outward shifts in px: harmonics of azimuth, constant and linear in polar angle."""
    return _patterns(points, _RING_HARMONICS)


def edge_baseline(points: ImagePoints, normal: Float) -> Float:
    """Return (M, 20) shifts along the edges' normals (M, 2) in px, of outward and of across patterns."""
    patterns = _patterns(points, _EDGE_HARMONICS)
    outward = points.outward
    around = np.stack([-outward[:, 1], outward[:, 0]], -1)
    parts = [patterns * np.sum(normal * way, 1)[:, None] for way in (outward, around)]
    return np.concatenate(parts, 1)


def _patterns(points: ImagePoints, harmonics: tuple[int, ...]) -> Float:
    psi, tilt = points.azimuth_rad, points.theta - _MIDDLE_THETA
    waves = [np.ones_like(psi)]
    waves += [f(m * psi) for m in harmonics if m for f in (np.cos, np.sin)]
    return np.stack([w * g for g in (np.ones_like(psi), 2 * tilt) for w in waves], -1)
