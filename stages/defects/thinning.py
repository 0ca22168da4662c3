"""Thins areas of a picture to lines one pixel wide.

T. Y. Zhang, C. Y. Suen, "A fast parallel algorithm for thinning digital patterns", CACM 1984: round after
round, pixels of the edge are removed whose removal neither breaks a line nor shortens it. Only pixels that
are left are visited: OpenCV's `thinning` goes through the whole picture in every round, which takes ten times
as long where few pixels are set.
"""

from __future__ import annotations

import numba
import numpy as np

from pipeline.arrays import Bool


def thinned(area: Bool) -> Bool:
    """Return an area (H, W) thinned to lines; pixels on the border of the picture are kept."""
    left = np.array(area, np.uint8, order="C")
    inner = np.zeros(area.shape, bool)
    inner[1:-1, 1:-1] = area[1:-1, 1:-1]
    _thin(left.ravel(), np.flatnonzero(inner), area.shape[1])
    return left > 0


@numba.njit(cache=True, nogil=True)
def _thin(left, place, width):  # type: ignore[no-untyped-def]
    """Remove pixels from ``left`` (H W,) until nothing changes; ``place`` (N,) are those that may go."""
    goes = np.zeros(len(place), np.bool_)
    count, removed = len(place), True
    while removed:
        removed = False
        for north_east in (True, False):
            for k in range(count):
                goes[k] = _may_go(left, place[k], width, north_east)
            kept = 0
            for k in range(count):
                if goes[k]:
                    left[place[k]] = 0
                else:
                    place[kept] = place[k]
                    kept += 1
            removed = removed or kept < count
            count = kept


@numba.njit(cache=True, nogil=True, forceinline=True)
def _may_go(left, k, width, north_east):  # type: ignore[no-untyped-def]
    """Whether a pixel of the edge may be removed, in the first half of a round or in the second."""
    n, e, s, w = left[k - width], left[k + 1], left[k + width], left[k - 1]
    ne, se, sw, nw = left[k - width + 1], left[k + width + 1], left[k + width - 1], left[k - width - 1]
    around = n + ne + e + se + s + sw + w + nw
    if around < 2 or around > 6:
        return False
    begins = (n < ne) + (ne < e) + (e < se) + (se < s) + (s < sw) + (sw < w) + (w < nw) + (nw < n)
    if begins != 1:
        return False
    if north_east:
        return n * e * s == 0 and e * s * w == 0
    return n * e * w == 0 and n * s * w == 0
