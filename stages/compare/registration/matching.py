"""Finds pieces of an earlier wall on a later one: first roughly and anywhere, then exactly near there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from pipeline.arrays import Bool, Float, Float32, Int
from stages.compare.registration.marks import CELLS_PER_RADIUS, COLUMNS, Surface

# Lengths of stretches (rough search) and blocks (exact search), in radii, and size of the rough search's
# cells in those of the exact one: chosen so that a 4 inch pipe is searched in a second. Stretches of 0.4 and
# 1.6 radii are found as well (4 pairs of a made pipe); how certain blocks of other lengths are is a debt:
# data/debts.md.
_STRETCH_RADII, _BLOCK_RADII, _COARSER = 0.8, 0.5, 2
# Stretches searched everywhere, stretches then searched near those, distances at which blocks are searched,
# and rows of marks made at a time: bounds on time and memory alone.
_ANCHORS, _MOST_STRETCHES, _MOST_STATIONS, _CHUNK_ROWS = 12, 96, 400, 1024
# Largest error of a rough match, in its cells: half and twice as many change no fate of 48 made pits.
_ROOM_CELLS = 3.0
# Largest relative difference of distances between two runs: ten times the 0.2 to 0.3 % that probes state.
_LARGEST_STRAIN = 0.03
_QUARTERS = 4
# A block of which less was seen is left out.
_LEAST_SEEN = 0.5
# Blocks agree when they lie within this of their neighbours' median, as a share of the room they had; the
# chance of that enters the test of whether the walls are the same (`by_marks`). Half and twice of it change
# no fate of 48 made pits.
AGREE = 0.2


@dataclass(frozen=True)
class Course:
    """Rough shift and roll of the earlier run on the later one; linear between stretches that agree.

    Attributes
    ----------
    at_mm, shift_mm, roll_rad : (K,)
    room_mm : float
        Largest error of the shift, and of the arc of the roll.
    """

    at_mm: Float
    shift_mm: Float
    roll_rad: Float
    room_mm: float

    def at(self, distance_mm: float) -> tuple[float, float]:
        """Return shift and roll at a distance of the earlier run."""
        shift, roll = (np.interp(distance_mm, self.at_mm, v) for v in (self.shift_mm, self.roll_rad))
        return float(shift), float(roll)


def coarse_course(earlier: Surface, now: Surface) -> Course:
    """Return the course that most stretches of the earlier wall agree on."""
    cell = _COARSER * now.radius_mm / CELLS_PER_RADIUS
    before, after = _coarse(earlier, cell), _coarse(now, cell)
    rows = min(round(_STRETCH_RADII * now.radius_mm / cell), len(before) // 2, len(after) - 1)
    count = 2 * len(before) // rows
    at = _starts(len(before) - rows, min(count, _MOST_STRETCHES))
    anchors = _starts(len(before) - rows, min(count, _ANCHORS))
    found = np.array([_place(before[i : i + rows], after, 0) for i in anchors])
    agree = _agreeing_stretches(anchors, found, now.radius_mm / cell)
    if len(at) > len(anchors):
        windows = [_window(i, anchors[agree], found[agree, 0], rows, len(after)) for i in at]
        found = np.array(
            [_place(before[i : i + rows], after[w], w.start) for i, w in zip(at, windows, strict=True)]
        )
        agree = _agreeing_stretches(at, found, now.radius_mm / cell)
    roll = found[agree, 1] * 2 * np.pi / before.shape[1]
    shift = now.from_mm - earlier.from_mm + (found[agree, 0] - at[agree]) * cell
    middle = np.asarray(earlier.from_mm + (at[agree] + rows / 2) * cell, float)
    return Course(middle, shift, roll[0] + _wrapped(roll - roll[0]), _ROOM_CELLS * cell)


def _starts(last: int, count: int) -> Int:
    return np.unique(np.linspace(0, last, max(count, 1)).astype(np.int64))


def _window(start: int, anchors: Int, places: Float, rows: int, end: int) -> slice:
    """Return the rows within which a stretch must lie, given the places of the anchors."""
    expected = float(np.interp(start, anchors, places - anchors)) + start
    room = 2 * rows + int(_LARGEST_STRAIN * np.abs(anchors - start).min())
    first = int(np.clip(expected - room, 0, max(end - rows, 0)))
    return slice(first, int(np.clip(expected + rows + room, first + rows, end)))


def best_place(template: Float32, image: Float32) -> tuple[float, float, float]:
    """Return the sub-cell row and column at which a template fits best, and its correlation."""
    score = cv2.matchTemplate(image, template, cv2.TM_CCOEFF_NORMED)
    score = np.where(np.isfinite(score), score, -1.0)
    r, c = np.unravel_index(int(np.argmax(score)), score.shape)
    row = r + _vertex(score[max(r - 1, 0) : r + 2, c]) if 0 < r < score.shape[0] - 1 else r
    column = c + _vertex(score[r, max(c - 1, 0) : c + 2]) if 0 < c < score.shape[1] - 1 else c
    return float(row), float(column), float(score[r, c])


def _coarse(surface: Surface, cell_mm: float) -> Float32:
    """Return a whole wall's marks on coarse cells, made by stretches."""
    fine = cell_mm / _COARSER
    rows = int(surface.length_mm / fine) // _COARSER * _COARSER
    chunks = [
        surface.marks(surface.from_mm + i * fine, min(_CHUNK_ROWS, rows - i), fine)
        for i in range(0, rows, _CHUNK_ROWS)
    ]
    marks = np.concatenate(chunks)
    return np.asarray(
        marks.reshape(len(marks) // _COARSER, _COARSER, COLUMNS // _COARSER, _COARSER).mean((1, 3)),
        np.float32,
    )


def _place(stretch: Float32, wall: Float32, first: int) -> tuple[float, float, float]:
    """Return a stretch's row on a wall whose rows begin with ``first``, its roll, and the correlation."""
    row, column, score = best_place(stretch, np.concatenate([wall, wall[:, :-1]], 1))
    return first + row, column, score


def _agreeing_stretches(starts: Int, found: Float, radius_cells: float) -> Bool:
    """Return the stretches (N,) that agree with the best supported one.

    That is the stretch with which others of the largest sum of correlations agree. ``found`` (N, 3) holds the
    row at which each stretch lies, the columns by which it is turned, both in cells, and its correlation.
    """
    strain = _LARGEST_STRAIN * np.abs(starts[:, None] - starts[None])
    moved, turn = found[:, 0] - starts, found[:, 1] * 2 * np.pi / (COLUMNS // _COARSER)
    near = np.abs(moved[:, None] - moved[None]) < _ROOM_CELLS + strain
    turned = np.abs(_wrapped(turn[:, None] - turn[None])) * radius_cells < 2 * _ROOM_CELLS + strain
    agree = near & turned
    return np.asarray(agree[int(np.argmax(agree @ np.maximum(found[:, 2], 0.0)))])


def _wrapped(angle: Float) -> Float:
    return np.asarray((angle + np.pi) % (2 * np.pi) - np.pi)


def _vertex(three: Any) -> float:
    """Return the vertex of the parabola through three equidistant values, relative to the middle one."""
    bend = float(three[0] - 2 * three[1] + three[2])
    return 0.5 * float(three[0] - three[2]) / bend if bend < 0 else 0.0


@dataclass(frozen=True)
class Matches:
    """Blocks of the earlier wall found on the later one.

    Attributes
    ----------
    at_mm : (N,)
        Middle of the block, distance of the earlier run.
    shift_mm, roll_rad, correlation : (N,)
    agree : (N,) bool
        Whether the block agrees with its neighbours.
    overlapping : float
        Number of blocks that share a piece of wall and therefore count as one.
    """

    at_mm: Float
    shift_mm: Float
    roll_rad: Float
    correlation: Float
    agree: Bool
    overlapping: float


def matched_blocks(earlier: Surface, now: Surface, course: Course) -> Matches:
    """Return blocks along the whole part of the earlier wall that the later one contains."""
    cell = now.radius_mm / CELLS_PER_RADIUS
    rows = round(_BLOCK_RADII * now.radius_mm / cell)
    starts = np.arange(earlier.from_mm, earlier.from_mm + earlier.length_mm - rows * cell, rows * cell / 2)
    overlapping = 2.0
    if len(starts) > _MOST_STATIONS:
        starts, overlapping = np.linspace(starts[0], starts[-1], _MOST_STATIONS), 1.0
    found = [row for s in starts for row in _at_station(earlier, now, course, float(s), rows, cell)]
    at, shift, roll, score = np.array(found).reshape(-1, 4).T
    agree = _agreeing_blocks(at, shift, roll * now.radius_mm, AGREE * course.room_mm)
    return Matches(at, shift, roll, score, agree, overlapping)


def _at_station(
    earlier: Surface, now: Surface, course: Course, start_mm: float, rows: int, cell_mm: float
) -> list[tuple[float, float, float, float]]:
    """Return middle, shift, roll and correlation of the blocks at one distance."""
    shift, roll = course.at(start_mm + rows * cell_mm / 2)
    room = round(course.room_mm / cell_mm)
    first_mm = start_mm + shift - room * cell_mm
    if first_mm < now.from_mm or first_mm + (rows + 2 * room) * cell_mm > now.from_mm + now.length_mm:
        return []
    before = earlier.marks(start_mm, rows, cell_mm)
    after = now.marks(first_mm, rows + 2 * room, cell_mm)
    turn = round(roll * COLUMNS / (2 * np.pi))
    width = COLUMNS // _QUARTERS
    found: list[tuple[float, float, float, float]] = []
    for quarter in range(_QUARTERS):
        block = before[:, quarter * width : (quarter + 1) * width]
        columns = (quarter * width + turn - room + np.arange(width + 2 * room)) % COLUMNS
        if (block != 0).mean() < _LEAST_SEEN:
            continue
        r, c, score = best_place(block, np.ascontiguousarray(after[:, columns]))
        moved = first_mm + r * cell_mm - start_mm
        turned = (turn + c - room) * 2 * np.pi / COLUMNS
        found.append((start_mm + rows * cell_mm / 2, moved, turned, score))
    return found


def _agreeing_blocks(at: Float, shift: Float, around_mm: Float, tolerance_mm: float) -> Bool:
    """Return which blocks lie within a tolerance of the median of their surroundings."""
    agree = np.zeros(len(at), bool)
    for station in np.unique(at):
        nearest = np.argsort(np.abs(at - station), kind="stable")[: 5 * _QUARTERS]
        here = np.flatnonzero(at == station)
        agree[here] = (np.abs(shift[here] - np.median(shift[nearest])) < tolerance_mm) & (
            np.abs(around_mm[here] - np.median(around_mm[nearest])) < tolerance_mm
        )
    return agree
