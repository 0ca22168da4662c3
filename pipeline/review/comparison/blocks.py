"""The close matching of two walls: blocks, a quarter of the turn each, looked for near where they must be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Bool, Float, Int
from pipeline.review.comparison.coarse import Course, best_place
from pipeline.review.comparison.surface import CELLS_PER_RADIUS, COLUMNS, Surface

_BLOCK_RADII = 0.5
_QUARTERS = 4
_MOST_STATIONS = 400
_LEAST_SEEN = 0.5
# Blocks agree when they lie within this of their neighbours' median, as a share of the room they had.
AGREE = 0.2


@dataclass(frozen=True)
class Matches:
    """Blocks of the earlier wall found on the later one.

    Attributes
    ----------
    at_mm : (N,)
        Middle of the block, distance of the earlier run.
    quarter : (N,) int
    shift_mm, roll_rad, correlation : (N,)
    agree : (N,) bool
        Whether it lies where its neighbours say.
    room_mm : float
        How far to each side it was looked for.
    overlapping : float
        Blocks that share a piece of wall: so many count for one.
    radius_mm : float
    """

    at_mm: Float
    quarter: Int
    shift_mm: Float
    roll_rad: Float
    correlation: Float
    agree: Bool
    room_mm: float
    overlapping: float
    radius_mm: float


def matched_blocks(earlier: Surface, now: Surface, course: Course) -> Matches:
    """Return blocks along all of the earlier wall that lies on the later one."""
    cell = now.radius_mm / CELLS_PER_RADIUS
    rows = round(_BLOCK_RADII * now.radius_mm / cell)
    starts = np.arange(earlier.from_mm, earlier.from_mm + earlier.length_mm - rows * cell, rows * cell / 2)
    overlapping = 2.0
    if len(starts) > _MOST_STATIONS:
        starts, overlapping = np.linspace(starts[0], starts[-1], _MOST_STATIONS), 1.0
    found = [row for s in starts for row in _at_station(earlier, now, course, float(s), rows, cell)]
    at, quarter, shift, roll, score = np.array(found).reshape(-1, 5).T
    agree = _agreeing(at, shift, roll * now.radius_mm, AGREE * course.room_mm)
    return Matches(
        at, quarter.astype(np.int64), shift, roll, score, agree, course.room_mm, overlapping, now.radius_mm
    )


def _at_station(
    earlier: Surface, now: Surface, course: Course, start_mm: float, rows: int, cell_mm: float
) -> list[tuple[float, float, float, float, float]]:
    """Return middle, quarter, shift, roll and correlation of the blocks at one distance."""
    shift, roll = course.at(start_mm + rows * cell_mm / 2)
    room = round(course.room_mm / cell_mm)
    first_mm = start_mm + shift - room * cell_mm
    if first_mm < now.from_mm or first_mm + (rows + 2 * room) * cell_mm > now.from_mm + now.length_mm:
        return []
    before = earlier.marks(start_mm, rows, cell_mm)
    after = now.marks(first_mm, rows + 2 * room, cell_mm)
    turn = round(roll * COLUMNS / (2 * np.pi))
    width = COLUMNS // _QUARTERS
    found: list[tuple[float, float, float, float, float]] = []
    for quarter in range(_QUARTERS):
        block = before[:, quarter * width : (quarter + 1) * width]
        columns = (quarter * width + turn - room + np.arange(width + 2 * room)) % COLUMNS
        if (block != 0).mean() < _LEAST_SEEN:
            continue
        r, c, score = best_place(block, np.ascontiguousarray(after[:, columns]))
        moved = first_mm + r * cell_mm - start_mm
        turned = (turn + c - room) * 2 * np.pi / COLUMNS
        found.append((start_mm + rows * cell_mm / 2, quarter, moved, turned, score))
    return found


def _agreeing(at: Float, shift: Float, around_mm: Float, tolerance_mm: float) -> Bool:
    """Return which blocks lie within a tolerance of the median of their surroundings."""
    agree = np.zeros(len(at), bool)
    for station in np.unique(at):
        nearest = np.argsort(np.abs(at - station), kind="stable")[: 5 * _QUARTERS]
        here = np.flatnonzero(at == station)
        agree[here] = (np.abs(shift[here] - np.median(shift[nearest])) < tolerance_mm) & (
            np.abs(around_mm[here] - np.median(around_mm[nearest])) < tolerance_mm
        )
    return agree
