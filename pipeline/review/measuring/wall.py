"""The wall that is measured on: its radius over distance and azimuth, and points on it in space."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Float, Float32, Int
from pipeline.artefacts.measured import RadiusMap


@dataclass(frozen=True)
class MeasuredWall:
    """Radius of the wall about the pipe's own axis.

    Attributes
    ----------
    distance_mm : (S,)
        Uniform.
    azimuth_rad : (A,)
        Uniform over the turn, first −π.
    radius_mm, sigma_mm, sigma_random_mm : (S, A)
        NaN where nothing was seen; σ in all, and its random part.
    """

    distance_mm: Float
    azimuth_rad: Float
    radius_mm: Float32
    sigma_mm: Float32
    sigma_random_mm: Float32

    @property
    def step_mm(self) -> float:
        """Distance between rows."""
        return float(self.distance_mm[1] - self.distance_mm[0])

    @property
    def step_rad(self) -> float:
        """Angle between columns."""
        return float(2 * np.pi / len(self.azimuth_rad))

    def rows(self, from_mm: float, to_mm: float) -> Int:
        """Return the rows from one distance to another; at least the nearest."""
        inside = np.flatnonzero((self.distance_mm >= from_mm) & (self.distance_mm <= to_mm))
        return inside if len(inside) else np.array([self.row(from_mm)])

    def row(self, distance_mm: float) -> int:
        """Return the row nearest to a distance."""
        return int(
            np.clip(round((distance_mm - self.distance_mm[0]) / self.step_mm), 0, len(self.distance_mm) - 1)
        )

    def column(self, azimuth_rad: float) -> int:
        """Return the column nearest to an azimuth."""
        steps = round(float(azimuth_rad - self.azimuth_rad[0]) / self.step_rad)
        return steps % len(self.azimuth_rad)

    def radius_at(self, distance_mm: float, azimuth_rad: float) -> tuple[float, float, float]:
        """Return radius, its σ, and its random σ at a point; NaN where nothing was seen."""
        at = self.row(distance_mm), self.column(azimuth_rad)
        return float(self.radius_mm[at]), float(self.sigma_mm[at]), float(self.sigma_random_mm[at])


def measured_wall(radius_map: RadiusMap) -> MeasuredWall:
    """Return the wall of a radius map; large arrays stay where they are, on disk."""
    return MeasuredWall(**{name: getattr(radius_map, name) for name in MeasuredWall.__dataclass_fields__})
