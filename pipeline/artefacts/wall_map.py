"""A wall as its radius over distance and azimuth: the map that is measured on, compared and verified."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Bool, Float, Float32

# float32 in a run's own map, float64 in a reference.
Real = NDArray[Any]


@dataclass(frozen=True)
class WallMap:
    """Radius of the wall about the pipe's own axis.

    Attributes
    ----------
    distance_mm : (S,)
        Row centres, uniform, increasing.
    azimuth_rad : (A,)
        Column centres, uniform over the whole turn; −π first in a run's own map.
    radius_mm, sigma_mm, sigma_random_mm : (S, A)
        Radius; its total 1 σ; the random part of that. NaN where nothing is known; σ is 0 in a reference
        that states none.
    displaced_mm : (S,) or None
        The part of the total 1 σ that a place shares with its surroundings alone, such as the error behind
        water on the window. It has no mean around the pipe. None where there is none.
    """

    distance_mm: Float
    azimuth_rad: Float
    radius_mm: Real
    sigma_mm: Real
    sigma_random_mm: Real
    displaced_mm: Float | None = field(default=None, kw_only=True)

    def displaced_in(self, rows: slice | NDArray[np.int64] = slice(None)) -> Float:
        """Return the part of σ (n,), mm, that places share with their surroundings alone, in some rows."""
        of_rows = self.distance_mm[rows]
        return np.zeros(len(of_rows)) if self.displaced_mm is None else np.asarray(self.displaced_mm[rows])

    def common_variance(self, rows: slice = slice(None)) -> Float:
        """Return the variance of the radius (S, A), mm², from errors that all places share: calibration."""
        total, random = (np.asarray(v[rows], float) for v in (self.sigma_mm, self.sigma_random_mm))
        return np.asarray(np.maximum(total**2 - random**2 - self.displaced_in(rows)[:, None] ** 2, 0.0))

    @property
    def step_mm(self) -> float:
        """Distance between rows."""
        return float(self.distance_mm[1] - self.distance_mm[0])

    @property
    def step_rad(self) -> float:
        """Angle between columns."""
        return float(2 * np.pi / len(self.azimuth_rad))

    def rows(self, from_mm: float, to_mm: float) -> NDArray[np.int64]:
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


@dataclass(frozen=True)
class FixedPlace:
    """A place of the image at which the line departs from the ring while the wall goes by.

    Attributes
    ----------
    azimuth_rad, width_rad : float
        Where in the image it departs most, and how far it reaches around.
    departure_mm, departure_sd_mm : float
        The largest departure, positive into the wall, and its 1 σ: what clear places depart by over as long
        a way, and what a wide one loses because rings are fitted with a smooth shape.
    length_mm : float
        Length of pipe over which it stays.
    frame_from, frame_to : int
    on_probe : bool
        True where the probe rolled and the place did not follow the wall; false where a groove or ridge along
        the pipe would look alike.
    """

    azimuth_rad: float
    width_rad: float
    departure_mm: float
    departure_sd_mm: float
    length_mm: float
    frame_from: int
    frame_to: int
    on_probe: bool


@dataclass(frozen=True)
class FixedToProbe:
    """What stays at one place of the image, and so does not belong to the wall, or may not.

    Attributes
    ----------
    departure_mm : (S, A) float32
        By how much the line departs, without sign, on the cells of the radius map that were seen there; 0
        elsewhere.
    places : tuple of FixedPlace
    """

    departure_mm: Float32
    places: tuple[FixedPlace, ...]


def cells_within(polygon: Float, shape: tuple[int, int]) -> Bool:
    """Return which cells (rows, columns) a polygon (V, 2) of (column, row) covers; at least one."""
    mask = np.zeros(shape, np.uint8)
    shift = 6
    corner = np.round(polygon * (1 << shift)).astype(np.int32)
    cv2.fillPoly(mask, [corner], 1, shift=shift)
    return mask.astype(bool)
