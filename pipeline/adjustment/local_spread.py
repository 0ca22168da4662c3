"""Local medians and robust spreads of a wall: behind some parts of the window there is more noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from pipeline.adjustment.robust import robust_spread
from pipeline.arrays import Float, Float32

# Length of a place along the pipe, and sectors around it: each is 13 mm wide in a pipe of 100 mm. A place
# holds some 300 independent cells, which give its spread to 6 %; 10 mm of defect fill less than half of it.
_PLACE_MM, _SECTORS = 32.0, 24
# With fewer cells, the median spread of all places is used instead of a place's own.
_FEWEST_CELLS = 100


@dataclass(frozen=True)
class LocalSpread:
    """Spreads of places (B, 24) about the distances ``at_mm`` (B,) of a wall with so many ``columns``."""

    at_mm: Float
    spread: Float
    columns: int

    def at(self, distance_mm: Float) -> Float:
        """Return the spread (S, A) at each distance (S,) and column, without steps between places."""
        middle = [float(c.mean()) for c in _sectors(self.columns)]
        columns = np.arange(self.columns)
        around = np.array([np.interp(columns, middle, row, period=self.columns) for row in self.spread])
        place = np.clip(np.searchsorted(self.at_mm, distance_mm) - 1, 0, max(len(self.at_mm) - 2, 0))
        after = np.minimum(place + 1, len(self.at_mm) - 1)
        step = np.maximum(self.at_mm[after] - self.at_mm[place], 1e-9)
        part = np.clip((distance_mm - self.at_mm[place]) / step, 0, 1)[:, None]
        return np.asarray((1 - part) * around[place] + part * around[after])


def local_spread(values: Callable[[slice], Float | Float32], distance_mm: Float, columns: int) -> LocalSpread:
    """Return the robust spreads of the values (rows, A) that are given for some rows; NaN do not count."""
    place = np.floor(distance_mm / _PLACE_MM).astype(np.int64)
    starts = np.flatnonzero(np.diff(place, prepend=place[0] - 1))
    rows = [slice(int(a), int(b)) for a, b in zip(starts, [*starts[1:], len(place)], strict=True)]
    spread = np.array([[_spread_of(v[:, c]) for c in _sectors(columns)] for v in map(values, rows)])
    known = spread[np.isfinite(spread)]
    overall = float(np.median(known)) if known.size else 1.0
    at = np.array([float(distance_mm[r].mean()) for r in rows])
    return LocalSpread(at, np.where(np.isfinite(spread), spread, overall), columns)


def _sectors(columns: int) -> list[Float]:
    return np.array_split(np.arange(columns), _SECTORS)


def _spread_of(values: Float | Float32) -> float:
    """Return the robust spread of the known values, NaN if there are too few."""
    known = values[np.isfinite(values)]
    return robust_spread(known) if known.size >= _FEWEST_CELLS else float("nan")


def running_median(value: Float32) -> Float32:
    """Return the median (S, A) of 25 cells around each of finite values (S, A): every other of 9 by 9.

    OpenCV sorts 25 cells at once, a hundred times faster than a sliding window of 81 goes.
    """
    out = np.empty_like(value)
    for i, j in np.ndindex(2, 2):
        part = np.ascontiguousarray(value[i::2, j::2])
        if part.size:
            out[i::2, j::2] = cv2.medianBlur(part, 5)
    return out
