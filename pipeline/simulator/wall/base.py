"""The wall: radius, reflectance and gloss sampled on a grid of distance and azimuth about the pipe's axis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Float, Float32
from pipeline.artefacts.measured import PipeAxis


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
        Exponent of that lobe (Blinn-Phong, normalised).
    """

    axis: PipeAxis
    shape: WallGrid
    radius_mm: Float32
    texture: WallGrid
    albedo_bgr: Float32
    gloss: float = 0.0
    gloss_lobe: float = 40.0
