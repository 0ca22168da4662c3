"""Harmonics of a pattern around the ring, and how it grows with the radius."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Float


def harmonic(azimuth_rad: Float, value: Float, order: int) -> complex:
    """Return c of Re(c e^{-imψ}) in least squares with all lower orders: amplitude |c|, crest arg(c)/m."""
    orders = range(max(order, 6) + 1)
    columns = [f(m * azimuth_rad) for m in orders for f in (np.cos, np.sin) if m or f is np.cos]
    known = np.isfinite(value)
    found = np.linalg.lstsq(np.stack(columns, -1)[known], value[known], rcond=None)[0]
    return complex(found[0]) if order == 0 else complex(found[2 * order - 1], found[2 * order])


def strongest(azimuth_rad: Float, value: Float) -> int:
    """Return the harmonic, 0 to 6, of the largest amplitude."""
    return int(np.argmax([abs(harmonic(azimuth_rad, value, m)) for m in range(7)]))


def exponent(radii_mm: Float, sizes: Float) -> float:
    """Return d ln |size| / d ln radius between the first and the last radius."""
    return float(np.log(abs(sizes[-1] / sizes[0])) / np.log(radii_mm[-1] / radii_mm[0]))
