"""Two threads over the rows of an image; kernels leave the interpreter's lock, so both run at once."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

_THREADS = 2
_BAND_ROWS = 64


def in_bands(work: Callable[[int, int], None], rows: int) -> None:
    """Call ``work(first, last)`` for bands of rows; each writes to its own rows, so order does not matter."""
    bands = [(first, min(first + _BAND_ROWS, rows)) for first in range(0, rows, _BAND_ROWS)]
    with ThreadPoolExecutor(_THREADS) as pool:
        for _ in pool.map(lambda band: work(*band), bands):
            pass
