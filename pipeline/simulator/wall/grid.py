"""The wall of a simulated pipe, the grid on which it is sampled, and windows of that grid."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.fft import next_fast_len

from pipeline.arrays import Float, Float32, Int
from pipeline.geometry.axis import PipeAxis


@dataclass(frozen=True)
class WallGrid:
    """Where samples lie: rows at distance_from + i · step, columns at azimuth −π + (j + ½) 2π / columns."""

    distance_from_mm: float
    step_mm: float
    rows: int
    columns: int

    @property
    def distance_mm(self) -> Float:
        """(rows,) distances of the rows."""
        return np.asarray(self.distance_from_mm + self.step_mm * np.arange(self.rows))

    @property
    def azimuth_rad(self) -> Float:
        """(columns,) azimuths of the columns."""
        return -np.pi + (np.arange(self.columns) + 0.5) * 2 * np.pi / self.columns


@dataclass(frozen=True)
class Wall:
    """The true wall.

    Between samples radius and reflectance are linear in distance and azimuth; beyond the first and last row
    they continue as they are there.

    Attributes
    ----------
    axis : PipeAxis
        Axis in P. A straight pipe has two points; a bent one a polyline fine enough for linear interpolation
        (sagitta step²·curvature/8 below 0.1 µm).
    shape : WallGrid
        Grid of ``radius_mm``; 0.1 to 0.25 mm a step is fine enough for chamfers and beads.
    radius_mm : (rows, columns) float32
    texture : WallGrid
        Grid of ``albedo_bgr`` and ``gloss``.
    albedo_bgr : (rows, columns, 3) float32
        Diffuse reflectance, 0 to 1, of each colour channel.
    gloss : float
        Share of the reflectance that is a glossy lobe.
    gloss_lobe : float
        Exponent of that lobe (Blinn-Phong, normalised), an even number up to 254: it is rounded to one.
    interreflection : float
        Share that is rendered of the light bounced once inside the bore; 1 is that of a dull wall.
    """

    axis: PipeAxis
    shape: WallGrid
    radius_mm: Float32
    texture: WallGrid
    albedo_bgr: Float32
    gloss: float = 0.0
    gloss_lobe: float = 40.0
    interreflection: float = 0.0


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
