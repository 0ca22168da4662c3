"""Size of the errors of matches in σ, and the part of it that lasts from picture to picture."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Float, Int

_RAYLEIGH_MEDIAN = float(np.sqrt(2 * np.log(2)))
"""Median length of an error of two coordinates, of 1 σ each."""


def excess_of(in_sigma: Float) -> float:
    """Return the size of errors (M, 2), in σ, relative to the expected size."""
    size = np.linalg.norm(in_sigma, axis=1)
    return float(np.median(size)) / _RAYLEIGH_MEDIAN if size.size else 0.0


def lasting_excess(in_sigma: Float, landmark: Int) -> float:
    """Return the part of the errors (M, 2), in σ, that a landmark's neighbouring observations share.

    Noise is independent in every picture: the difference of two of them contains all of it, and it hardly
    affects distance. An error that lasts moves the poses.
    """
    step = np.diff(in_sigma, axis=0)[np.diff(landmark) == 0] / np.sqrt(2)
    return float(np.sqrt(max(excess_of(in_sigma) ** 2 - excess_of(step) ** 2, 0.0)))
