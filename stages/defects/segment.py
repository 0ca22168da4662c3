"""Split the detected cells into instances, each with its own outline."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import find_objects, label
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from pipeline.arrays import Bool, Float, Int
from pipeline.machine.scratch import Scratch
from stages.defects.along import stretches
from stages.defects.grow import Grown, joined
from stages.defects.relief import WallRelief

Labels = NDArray[np.int32]

_EIGHT = np.ones((3, 3), int)
_LONGEST_ROWS = 2000  # a longer defect is given in parts of this length, to bound memory


@dataclass(frozen=True)
class Region:
    """Cells of one defect in a window of the map; the window may cross the seam of the azimuth.

    Attributes
    ----------
    row, column : int
        First cell of the window in the map. Columns are modulo the map's width, and ``column`` may be
        negative.
    mask : (H, W) bool
    sign : float
        +1 into the wall, −1 inward.
    all_round : bool
        Whether it goes all round the pipe, as a weld does.
    """

    row: int
    column: int
    mask: Bool
    sign: float
    all_round: bool = False

    def counted_from(self, row: int) -> Region:
        """Return the region with its rows counted from another row of the map."""
        return replace(self, row=self.row - row)

    def turned(self, columns: int) -> Region:
        """Return the region moved by ``columns`` columns around the pipe."""
        return replace(self, column=self.column + columns)

    def cut(self, image: Float) -> Float:
        """Return the window (H, W) of a map (S, A)."""
        columns = np.arange(self.column, self.column + self.mask.shape[1]) % image.shape[1]
        return image[self.row : self.row + self.mask.shape[0]][:, columns]


def regions_of(relief: WallRelief, cells: Grown, gap_mm: float, scratch: Scratch) -> tuple[Region, ...]:
    """Return all defects and welds, sorted by distance.

    Cells of one sign with a gap of less than ``gap_mm`` are one defect. What is longer than 2000 rows, for
    example a groove along the whole pipe, is returned in parts of that length.
    """
    regions = [_weld(relief, band) for band in relief.welds]
    for sign, mask in ((1.0, cells.into), (-1.0, cells.inward)):
        regions += instances(mask, sign, relief.cell_mm, gap_mm, scratch)
    return tuple(sorted(regions, key=lambda r: (r.row, r.column, r.sign)))


def _weld(relief: WallRelief, band: slice) -> Region:
    rows = relief.rows(band).all_mm
    return Region(band.start, 0, np.isfinite(rows), float(np.sign(np.nanmedian(rows))), True)


def instances(
    mask: Bool, sign: float, cell_mm: tuple[float, float], gap_mm: float, scratch: Scratch
) -> list[Region]:
    """Return the connected regions of cells (S, A) of one sign; the result does not depend on stretches."""
    patches = _patches(mask, cell_mm, gap_mm, scratch)
    out: list[Region] = []
    for number, extent in enumerate(patches.extent):
        for first in range(extent.start, extent.stop, _LONGEST_ROWS):
            rows = slice(first, min(first + _LONGEST_ROWS, extent.stop))
            out += _region(mask[rows] & (patches.of(rows) == number), first, sign)
    return out


def _region(cells: Bool, first_row: int, sign: float) -> Iterator[Region]:
    """Yield the region of ``cells`` (rows, A), or nothing where there is no cell."""
    if cells.any():
        first = _widest_gap_end(np.asarray(cells.any(0)))
        rolled = np.roll(cells, -first, 1)
        rows, columns = (np.flatnonzero(rolled.any(axis)) for axis in (1, 0))
        window = rolled[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
        yield Region(first_row + int(rows[0]), first + int(columns[0]), window, sign)


def _widest_gap_end(columns: Bool) -> int:
    """Return the column after the widest empty stretch of a periodic row, 0 when none is empty."""
    filled = np.flatnonzero(columns)
    gaps = np.diff(np.concatenate([filled, filled[:1] + len(columns)]))
    return int(filled[(int(np.argmax(gaps)) + 1) % len(filled)]) if gaps.max() > 1 else 0


@dataclass(frozen=True)
class Patches:
    """Connected cells of a long map, periodic in azimuth.

    Attributes
    ----------
    label : (S, A) int32
        0 where there is nothing, else the number of a piece that is connected within one stretch.
    patch : (L + 1,) int
        The patch that each label belongs to, −1 for label 0.
    extent : tuple of slice
        Rows of every patch.
    """

    label: Labels
    patch: Int
    extent: tuple[slice, ...]

    def of(self, rows: slice) -> Int:
        """Return the patch numbers (rows, A) of some rows, −1 where there is none."""
        return self.patch[self.label[rows]]


def _patches(mask: Bool, cell_mm: tuple[float, float], gap_mm: float, scratch: Scratch) -> Patches:
    """Label connected cells stretch by stretch; join labels that meet at cuts and across the seam."""
    labels = scratch.zeros(mask.shape, np.int32)
    rows_of: list[slice] = []
    meeting: list[Int] = [np.empty((0, 2), np.int64)]
    for part in stretches(len(mask), int(np.ceil(gap_mm / cell_mm[0])) + 1):
        here = np.zeros((part.own.stop - part.own.start, mask.shape[1]), np.int32)
        label(joined(mask[part.wide], cell_mm, gap_mm)[part.inner], _EIGHT, output=here)
        extents = [rows for rows, _ in find_objects(here)]
        here[here > 0] += len(rows_of)
        rows_of += [slice(part.own.start + r.start, part.own.start + r.stop) for r in extents]
        labels[part.own] = here
        meeting += _over_the_seam(here)
        if part.own.start > 0:
            meeting += _touching(labels[part.own.start - 1], here[0])
    count = len(rows_of) + 1
    pairs = np.concatenate(meeting)
    graph = coo_array((np.ones(len(pairs), bool), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    _, component = connected_components(graph, directed=False)
    _, patch = np.unique(component[1:], return_inverse=True)
    return Patches(labels, np.append(-1, patch), _extents(patch, rows_of))


def _touching(above: Labels, below: Labels) -> list[Int]:
    """Return pairs (n, 2) of labels that touch between two neighbouring rows (A,), periodic in azimuth."""
    pairs = [np.stack([above, np.roll(below, shift)], -1) for shift in (-1, 0, 1)]
    return [np.unique(p[(p > 0).all(1)], axis=0) for p in pairs]


def _over_the_seam(labels: Labels) -> list[Int]:
    """Return pairs (n, 2) of labels (rows, A) that touch across the last and the first column."""
    last, first = labels[:, -1], labels[:, 0]
    ends = ((last, first), (last[1:], first[:-1]), (last[:-1], first[1:]))
    pairs = [np.stack(pair, -1) for pair in ends]
    return [np.unique(p[(p > 0).all(1)], axis=0) for p in pairs]


def _extents(patch: Int, rows_of: list[slice]) -> tuple[slice, ...]:
    """Return the rows of every patch from the rows of its labels."""
    count = int(patch.max(initial=-1)) + 1
    first, last = np.full(count, np.iinfo(np.int64).max), np.zeros(count, np.int64)
    np.minimum.at(first, patch, np.array([r.start for r in rows_of], np.int64))
    np.maximum.at(last, patch, np.array([r.stop for r in rows_of], np.int64))
    return tuple(slice(int(a), int(b)) for a, b in zip(first, last, strict=True))
