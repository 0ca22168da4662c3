"""What varies slowly around the ring: medians of a few sectors, drawn through to all of them."""

from __future__ import annotations

import numba
import numpy as np

from stages.rings.kernels import median, take_finite

# Thirty degrees: far wider than a glint, so that it has no say; a move across the pipe, one wave around the
# ring, is followed to 3 % (the square of half a block, over 2).
_BLOCKS = 12


@numba.njit(cache=True, nogil=True)
def slow_around(values):  # type: ignore[no-untyped-def]
    """Return ``values`` (A,) without what is narrower than half a block; 0 when none is finite.

    Medians of twelve blocks of sectors, linear from the middle of one to the next around the circle; blocks
    of which less than a quarter is finite take the value of the block before.
    """
    sectors = values.size
    level, last, out = np.full(_BLOCKS, np.nan), np.nan, np.zeros(sectors)
    for b in range(_BLOCKS):
        block = values[b * sectors // _BLOCKS : (b + 1) * sectors // _BLOCKS]
        finite = take_finite(block, out)
        if finite.size > 0 and 4 * finite.size >= block.size:
            level[b] = last = median(finite)
    out[:] = 0.0
    if np.isnan(last):
        return out
    for b in range(_BLOCKS):
        last = level[b] if np.isfinite(level[b]) else last
        level[b] = last
    for a in range(sectors):
        place = (a + 0.5) * _BLOCKS / sectors - 0.5
        b = int(np.floor(place))
        part = place - b
        out[a] = (1 - part) * level[b % _BLOCKS] + part * level[(b + 1) % _BLOCKS]
    return out
