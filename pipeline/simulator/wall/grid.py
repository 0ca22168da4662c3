"""The grid of distance and azimuth on which a wall is laid out, and windows in it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.fft import next_fast_len

from pipeline.arrays import Float, Int
from pipeline.simulator.wall.base import WallGrid


@dataclass(frozen=True)
class Grid:
    """Cells of a wall with the radius by which azimuths become arc lengths.

    Attributes
    ----------
    cells : WallGrid
    radius_mm : float
        Nominal radius.
    """

    cells: WallGrid
    radius_mm: float

    @cached_property
    def distance_mm(self) -> Float:
        """(S,) distances of the rows."""
        return self.cells.distance_mm

    @cached_property
    def azimuth_rad(self) -> Float:
        """(A,) azimuths of the columns, from −π to π."""
        return self.cells.azimuth_rad

    @property
    def shape(self) -> tuple[int, int]:
        """(S, A)."""
        return self.cells.rows, self.cells.columns

    @property
    def step_mm(self) -> float:
        """Spacing of the rows."""
        return self.cells.step_mm

    @property
    def arc_step_mm(self) -> float:
        """Spacing of the columns along the nominal wall."""
        return 2 * np.pi * self.radius_mm / self.cells.columns


@dataclass(frozen=True)
class Window:
    """A part of a grid around a place.

    Attributes
    ----------
    rows, columns : (n,), (m,)
        Indices into the grid.
    along_mm, around_mm : (n, 1), (1, m)
        Offsets from the place: along the distance and along the nominal wall.
    """

    rows: Int
    columns: Int
    along_mm: Float
    around_mm: Float

    @property
    def place(self) -> tuple[Int, ...]:
        """Indices that select the window of a map (S, A)."""
        return np.ix_(self.rows, self.columns)


def grid_over(distance_mm: tuple[float, float], radius_mm: float, cell_mm: float) -> Grid:
    """Return the grid between two distances with cells of about ``cell_mm``.

    The number of columns has small prime factors only, so that it transforms quickly.
    """
    rows = max(round((distance_mm[1] - distance_mm[0]) / cell_mm) + 1, 2)
    columns = next_fast_len(max(round(2 * np.pi * radius_mm / cell_mm), 16))
    return Grid(WallGrid(distance_mm[0], cell_mm, rows, columns), radius_mm)


def window(
    grid: Grid, distance_mm: float, azimuth_rad: float, half_length_mm: float, half_width_mm: float
) -> Window:
    """Return the part of a grid within half a length and half a width of a place; empty outside the grid."""
    along = grid.distance_mm - distance_mm
    around = wrapped(grid.azimuth_rad - azimuth_rad) * grid.radius_mm
    rows = np.flatnonzero(np.abs(along) <= half_length_mm)
    columns = np.flatnonzero(np.abs(around) <= half_width_mm)
    return Window(rows, columns, along[rows, None], around[None, columns])


def wrapped(angle_rad: Float) -> Float:
    """Return angles (...) brought to −π … π."""
    return np.asarray((np.asarray(angle_rad) + np.pi) % (2 * np.pi) - np.pi)
