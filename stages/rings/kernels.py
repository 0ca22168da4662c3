"""Small compiled helpers of the ring kernels: binary search and Cholesky solution."""

from __future__ import annotations

import numba
import numpy as np

# Sums may be reordered; NaN keeps its meaning.
FAST = {"reassoc", "contract", "arcp", "nsz"}


@numba.njit(cache=True, nogil=True)
def first_at_least(values, low, high, limit):  # type: ignore[no-untyped-def]
    """Index of the first of the rising ``values[low:high]`` that is >= ``limit``."""
    while low < high:
        middle = (low + high) >> 1
        if values[middle] < limit:
            low = middle + 1
        else:
            high = middle
    return low


@numba.njit(cache=True, nogil=True)
def factor(n):  # type: ignore[no-untyped-def]
    """Replace the lower triangle of ``n`` by its Cholesky factor; False when it is not positive."""
    for i in range(n.shape[0]):
        for j in range(i + 1):
            s = n[i, j]
            for k in range(j):
                s -= n[i, k] * n[j, k]
            if i != j:
                n[i, j] = s / n[j, j]
            elif s <= 1e-12:
                return False
            else:
                n[i, i] = np.sqrt(s)
    return True


@numba.njit(cache=True, nogil=True)
def solve(n, v):  # type: ignore[no-untyped-def]
    """Solve L Lᵀ x = v in place."""
    for i in range(v.size):
        for k in range(i):
            v[i] -= n[i, k] * v[k]
        v[i] /= n[i, i]
    for i in range(v.size - 1, -1, -1):
        for k in range(i + 1, v.size):
            v[i] -= n[k, i] * v[k]
        v[i] /= n[i, i]


@numba.njit(cache=True, nogil=True)
def inverse_diagonal(n, index, v):  # type: ignore[no-untyped-def]
    """Entry (index, index) of (L Lᵀ)⁻¹, with ``v`` as working space."""
    s = 0.0
    for i in range(index, v.size):
        v[i] = 1.0 if i == index else 0.0
        for k in range(index, i):
            v[i] -= n[i, k] * v[k]
        v[i] /= n[i, i]
        s += v[i] * v[i]
    return s
