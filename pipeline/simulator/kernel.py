"""How the renderer's kernels are compiled, and two threads that run them over the rows of an image."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from numba import njit

Function = Callable[..., Any]
_OPTIONS: dict[str, Any] = {
    "cache": True, "nogil": True, "error_model": "numpy", "forceinline": True, "_nrt": False,
    "fastmath": {"contract"},
}  # fmt: skip


def kernel(function: Function) -> Function:
    """Compile a kernel that makes no arrays, inlined into its callers.

    Called as functions, kernels would spend most of their time on passing their many arrays. Reference
    counting of these is left out too: with it a frame takes three times as long. Numba has no public name for
    that, so the lock file pins the version with which this was tested.
    """
    compiled: Function = njit(**_OPTIONS)(function)
    return compiled


def summing_kernel(function: Function) -> Function:
    """Compile a kernel whose sums may be added in any order, so that several terms are computed at once."""
    compiled: Function = njit(**(_OPTIONS | {"fastmath": {"reassoc", "nsz", "contract"}}))(function)
    return compiled


# Threads: as many as the smallest machine that the program is made for has cores.
_THREADS = 2
# Rows that a thread takes at a time: about 19 bands of a 2 MP picture balance the times of the rows.
_BAND_ROWS = 64


def in_bands(work: Callable[[int, int], None], rows: int) -> None:
    """Call ``work(first, last)`` for bands of rows; each writes to its own rows, so order does not matter."""
    bands = [(first, min(first + _BAND_ROWS, rows)) for first in range(0, rows, _BAND_ROWS)]
    with ThreadPoolExecutor(_THREADS) as pool:
        for _ in pool.map(lambda band: work(*band), bands):
            pass
