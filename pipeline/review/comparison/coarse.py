"""The first, rough laying of two walls on each other: every stretch is looked for all over the other wall."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from pipeline.arrays import Bool, Float, Float32, Int
from pipeline.review.comparison.surface import CELLS_PER_RADIUS, COLUMNS, Surface

_COARSER = 2
_STRETCH_RADII = 0.8
# Stretches that are looked for everywhere, and all that are then looked for near where those lie.
_ANCHORS = 12
_MOST_STRETCHES = 96
_ROOM_CELLS = 3.0
_CHUNK_ROWS = 1024
# Encoders and calibrations agree on distance at least so well.
LARGEST_STRAIN = 0.03


@dataclass(frozen=True)
class Course:
    """Roughly how the earlier run's distances move and turn; linear between stretches that agree.

    Attributes
    ----------
    at_mm, shift_mm, roll_rad : (K,)
    room_mm : float
        By how much it may be wrong along the pipe, and in arc around it.
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
    agree = _agreeing(anchors, found, now.radius_mm / cell)
    if len(at) > len(anchors):
        windows = [_window(i, anchors[agree], found[agree, 0], rows, len(after)) for i in at]
        found = np.array(
            [_place(before[i : i + rows], after[w], w.start) for i, w in zip(at, windows, strict=True)]
        )
        agree = _agreeing(at, found, now.radius_mm / cell)
    roll = found[agree, 1] * 2 * np.pi / before.shape[1]
    shift = now.from_mm - earlier.from_mm + (found[agree, 0] - at[agree]) * cell
    middle = np.asarray(earlier.from_mm + (at[agree] + rows / 2) * cell, float)
    return Course(middle, shift, roll[0] + _wrapped(roll - roll[0]), _ROOM_CELLS * cell)


def _starts(last: int, count: int) -> Int:
    return np.unique(np.linspace(0, last, max(count, 1)).astype(np.int64))


def _window(start: int, anchors: Int, places: Float, rows: int, end: int) -> slice:
    """Return the rows among which a stretch must lie, given where the anchors do."""
    expected = float(np.interp(start, anchors, places - anchors)) + start
    room = 2 * rows + int(LARGEST_STRAIN * np.abs(anchors - start).min())
    first = int(np.clip(expected - room, 0, max(end - rows, 0)))
    return slice(first, int(np.clip(expected + rows + room, first + rows, end)))


def best_place(template: Float32, image: Float32) -> tuple[float, float, float]:
    """Return the row and column, to a part of a cell, at which a template fits best, and its correlation."""
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
    """Return where a stretch lies on a wall whose rows begin with ``first``, its turn, the correlation."""
    row, column, score = best_place(stretch, np.concatenate([wall, wall[:, :-1]], 1))
    return first + row, column, score


def _agreeing(starts: Int, found: Float, radius_cells: float) -> Bool:
    """Return which stretches agree with one of them, taking the one that most and best agree with.

    All in cells; ``found`` (N, 3) are the rows at which they lie, columns by which they turn, correlations.
    """
    strain = LARGEST_STRAIN * np.abs(starts[:, None] - starts[None])
    moved, turn = found[:, 0] - starts, found[:, 1] * 2 * np.pi / (COLUMNS // _COARSER)
    near = np.abs(moved[:, None] - moved[None]) < _ROOM_CELLS + strain
    turned = np.abs(_wrapped(turn[:, None] - turn[None])) * radius_cells < 2 * _ROOM_CELLS + strain
    agree = near & turned
    return np.asarray(agree[int(np.argmax(agree @ np.maximum(found[:, 2], 0.0)))])


def _wrapped(angle: Float) -> Float:
    return np.asarray((angle + np.pi) % (2 * np.pi) - np.pi)


def _vertex(three: Any) -> float:
    """Return where the parabola through three equidistant values has its vertex, from the middle one."""
    bend = float(three[0] - 2 * three[1] + three[2])
    return 0.5 * float(three[0] - three[2]) / bend if bend < 0 else 0.0
