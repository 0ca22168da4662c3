"""The gauge: stepped bore and fiducials, as points on its wall in P."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Float, Int
from pipeline.recording.base import Fiducials, PipeFacts

# Corners as ArUco numbers them, clockwise from the pattern's top left: (column, row) from -1 to 1.
_CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


@dataclass(frozen=True)
class Gauge:
    """A gauge of known bore with known fiducials.

    Attributes
    ----------
    start_mm : (S,)
        Where each bore section starts; the first reaches back, the last reaches on without end.
    radius_mm : (S,)
    radius_sigma_mm : float
        1 σ of each section's radius, from the tolerance of its diameter.
    fiducials : Fiducials
    """

    start_mm: Float
    radius_mm: Float
    radius_sigma_mm: float
    fiducials: Fiducials

    @property
    def ids(self) -> Int:
        """(M,) numbers of the fiducials, as listed."""
        return np.array([m.id for m in self.fiducials.markers], np.int64)

    def section(self, distance_mm: Float) -> Int:
        """Return the section (...) in which a distance lies."""
        return np.clip(np.searchsorted(self.start_mm, distance_mm, "right") - 1, 0, len(self.start_mm) - 1)

    def from_step_mm(self, distance_mm: Float) -> Float:
        """Return how far (...) a distance is from the nearest step; infinite for a plain bore."""
        if len(self.start_mm) < 2:
            return np.full(np.shape(distance_mm), np.inf)
        return np.asarray(np.abs(np.asarray(distance_mm)[..., None] - self.start_mm[1:]).min(-1))

    def on_wall(self, distance_mm: Float, azimuth_rad: Float) -> Float:
        """Return wall points (..., 3) in P."""
        radius = self.radius_mm[self.section(distance_mm)]
        return np.stack([radius * np.cos(azimuth_rad), radius * np.sin(azimuth_rad), distance_mm], -1)

    def on_marker(self, index: Int, local: Float) -> Float:
        """Return points (..., 3) in P of fiducials (...) at (column, row) (..., 2), edges at ±1."""
        half = self.fiducials.size_mm / 2
        marker = [self.fiducials.markers[int(i)] for i in np.ravel(index)]
        centre = np.array([m.distance_mm for m in marker]).reshape(np.shape(index))
        azimuth = np.radians([m.azimuth_deg for m in marker]).reshape(np.shape(index))
        across = 1.0 if self.fiducials.columns_along == "+azimuth" else -1.0
        along = 1.0 if self.fiducials.rows_along == "+distance" else -1.0
        radius = self.radius_mm[self.section(centre)]
        return self.on_wall(
            centre + along * half * local[..., 1], azimuth + across * half * local[..., 0] / radius
        )

    def corners(self, index: Int) -> Float:
        """Return the corners (M, 4, 3) in P of fiducials (M,)."""
        return self.on_marker(
            np.repeat(np.asarray(index)[:, None], 4, 1), np.tile(_CORNERS, (len(index), 1, 1))
        )

    def from_fiducial_edge_mm(self, distance_mm: Float, azimuth_rad: Float) -> Float:
        """Return how far (N,) wall points are from the nearest border of a fiducial, mm; inside counts as 0.

        Inside a fiducial its pattern is as near as its border.
        """
        half = self.fiducials.size_mm / 2
        nearest = np.full(len(distance_mm), np.inf)
        radius = self.radius_mm[self.section(distance_mm)]
        for marker in self.fiducials.markers:
            dz = np.abs(distance_mm - marker.distance_mm) - half
            turn = np.mod(azimuth_rad - np.radians(marker.azimuth_deg) + np.pi, 2 * np.pi) - np.pi
            da = np.abs(turn) * radius - half
            nearest = np.minimum(nearest, np.hypot(np.maximum(dz, 0), np.maximum(da, 0)))
        return nearest


def gauge_of(facts: PipeFacts, fiducials: Fiducials) -> Gauge:
    """Return the gauge that a recording's facts describe; the tolerance is taken as a uniform ± range."""
    length = np.array([b.length_mm for b in facts.bore])
    start = np.concatenate([[0.0], np.cumsum(length)[:-1]])
    radius = np.array([b.diameter_mm for b in facts.bore]) / 2
    return Gauge(start, radius, facts.bore_tolerance_mm / 2 / np.sqrt(3), fiducials)
