"""Small compiled helpers of the ring kernels: binary search, medians and Cholesky solution."""

from __future__ import annotations

import numba
import numpy as np

# Sums may be reordered; NaN keeps its meaning.
FAST = {"reassoc", "contract", "arcp", "nsz"}
UNKNOWNS = 5
# In a narrower sector, px, some radii have no pixel: pixels are one apart, up to √2 along a diagonal.
_LEAST_ARC_PX = 1.2
# Blocks around the ring whose medians give its slow variation: thirty degrees, far wider than a glint, which
# then has no influence. A motion across the pipe, one wave around the ring, is followed to 3 % (the square of
# half a block, over 2).
_BLOCKS = 12


@numba.njit(cache=True, nogil=True)
def median(values):  # type: ignore[no-untyped-def]
    """Return the median of ``values`` (N,), not empty, and sort them; NumPy's takes long to compile.

    D. L. Shell, "A high-speed sorting procedure", 1959.
    """
    gap = values.size // 2
    while gap > 0:
        for k in range(gap, values.size):
            value, at = values[k], k
            while at >= gap and values[at - gap] > value:
                values[at] = values[at - gap]
                at -= gap
            values[at] = value
        gap //= 2
    return 0.5 * (values[(values.size - 1) // 2] + values[values.size // 2])


@numba.njit(cache=True, nogil=True)
def take_finite(values, out):  # type: ignore[no-untyped-def]
    """Write the finite ``values`` (N,) to ``out`` (N,) one after the other; return the filled part of it."""
    count = 0
    for x in values:
        if np.isfinite(x):
            out[count] = x
            count += 1
    return out[:count]


@numba.njit(cache=True, nogil=True)
def slow_around(values):  # type: ignore[no-untyped-def]
    """Return the slow variation of ``values`` (A,), of half a block or wider; 0 when none is finite.

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


@numba.njit(cache=True, nogil=True, error_model="numpy")
def first_at_least(values, low, high, limit):  # type: ignore[no-untyped-def]
    """Index of the first of the rising ``values[low:high]`` that is >= ``limit``."""
    while low < high:
        middle = (low + high) >> 1
        if values[middle] < limit:
            low = middle + 1
        else:
            high = middle
    return low


@numba.njit(cache=True, nogil=True, error_model="numpy")
def neighbours_joined(sectors, radius_px):  # type: ignore[no-untyped-def]
    """Return the number of sectors on either side that are joined to one, so that it is wide enough."""
    arc_px = 2 * np.pi / sectors * radius_px
    return int(np.ceil(0.5 * (_LEAST_ARC_PX / arc_px - 1))) if arc_px < _LEAST_ARC_PX else 0


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def bell(x):  # type: ignore[no-untyped-def]
    """Return exp(−x²/2) to 1e-8, in operations that work on several pixels at once.

    Its Taylor series at a 32nd of the exponent, squared five times; what is below 1e-8 stays there.
    """
    v = x * x * (0.5 / 32)
    v = v if v < 0.6 else 0.6  # exp(-32 * 0.6) is 5e-9
    p = 1 - v * (1 - v * (1 / 2 - v * (1 / 6 - v * (1 / 24 - v * (1 / 120 - v / 720)))))
    p *= p
    p *= p
    p *= p
    p *= p
    return p * p


@numba.njit(cache=True, nogil=True, error_model="numpy")
def factor(n):  # type: ignore[no-untyped-def]
    """Replace the lower triangle of ``n`` by its Cholesky factor, with 1 / Lᵢᵢ on the diagonal.

    False when it is not positive. The size is a constant, so that the compiler can unroll all loops.
    """
    for i in range(UNKNOWNS):
        for j in range(i):
            s = n[i, j]
            for k in range(j):
                s -= n[i, k] * n[j, k]
            n[i, j] = s * n[j, j]
        s = n[i, i]
        for k in range(i):
            s -= n[i, k] * n[i, k]
        if s <= 1e-12:
            return False
        n[i, i] = 1.0 / np.sqrt(s)
    return True


@numba.njit(cache=True, nogil=True, error_model="numpy")
def solve(n, v):  # type: ignore[no-untyped-def]
    """Solve L Lᵀ x = v in place."""
    for i in range(UNKNOWNS):
        s = v[i]
        for k in range(i):
            s -= n[i, k] * v[k]
        v[i] = s * n[i, i]
    for i in range(UNKNOWNS - 1, -1, -1):
        s = v[i]
        for k in range(i + 1, UNKNOWNS):
            s -= n[k, i] * v[k]
        v[i] = s * n[i, i]


@numba.njit(cache=True, nogil=True, error_model="numpy")
def inverse_diagonal(n, index, v):  # type: ignore[no-untyped-def]
    """Entry (index, index) of (L Lᵀ)⁻¹, with ``v`` as working space."""
    total = 0.0
    for i in range(index, UNKNOWNS):
        s = 1.0 if i == index else 0.0
        for k in range(index, i):
            s -= n[i, k] * v[k]
        v[i] = s * n[i, i]
        total += v[i] * v[i]
    return total
