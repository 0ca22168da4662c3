"""Round places of the image at which nothing is measured: dirt and drops on the window."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Bool, Float, Float32

ImagePlaces = tuple[tuple[float, float, float], ...]
"""u, v and radius, px, of each."""


def clear_of(places: ImagePlaces, uv: Float | Float32) -> Bool:
    """Return whether pixels (..., 2) lie outside all places of the image."""
    out = np.ones(uv.shape[:-1], bool)
    for u, v, radius in places:
        out &= (uv[..., 0] - u) ** 2 + (uv[..., 1] - v) ** 2 > radius**2
    return out
