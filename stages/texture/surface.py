"""The wall as a surface without gaps: points and normals for any distance and azimuth."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates

from pipeline.arrays import Float, Float32
from pipeline.artefacts.measured import RadiusMap, Wall
from pipeline.errors import UnusableError
from pipeline.geometry.axis import PipeAxis, frames_at
from pipeline.machine.scratch import Scratch

_SEEN_ROW = 0.2
_BLOCK_ROWS, _MORE_ROWS = 2000, 200


@dataclass(frozen=True)
class SurfacePatch:
    """Wall points ``xyz_p`` and inward unit normals ``normal_p``, both (n, m, 3) in P."""

    xyz_p: Float
    normal_p: Float


@dataclass(frozen=True)
class WallSurface:
    """Smoothed radii r(s, ψ) with gaps filled, about the pipe's axis.

    Attributes
    ----------
    axis : PipeAxis
    distance_mm : (S,)
        Uniform.
    radius_mm : (S, A) float32
        First column at −π, columns uniform.
    along, around : (S, A) float32
        ∂r/∂s and ∂r/∂ψ / r: slopes of the wall along and around.
    seen_mm : (float, float)
        First and last distance at which the ring saw the wall.
    """

    axis: PipeAxis
    distance_mm: Float
    radius_mm: Float32
    along: Float32
    around: Float32
    seen_mm: tuple[float, float]

    @property
    def mean_radius_mm(self) -> float:
        """Mean radius of the wall."""
        return float(self.radius_mm.mean(dtype=np.float64))

    def patch(self, distance_mm: Float, azimuth_rad: Float) -> SurfacePatch:
        """Return the points and normals on the grid of distances (n,) and azimuths (m,).

        Beyond its ends the wall has the radii of its last row.
        """
        where = self._indices(distance_mm, azimuth_rad)
        r, along, around = (self._sample(a, where) for a in (self.radius_mm, self.along, self.around))
        origin, frame = frames_at(self.axis, distance_mm)
        x, y, z = (frame[:, None, :, i] for i in range(3))
        c, s = np.cos(azimuth_rad)[None, :, None], np.sin(azimuth_rad)[None, :, None]
        outward, turning = c * x + s * y, c * y - s * x
        normal = around[..., None] * turning + along[..., None] * z - outward
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
        return SurfacePatch(origin[:, None] + r[..., None] * outward, normal)

    def _indices(self, distance_mm: Float, azimuth_rad: Float) -> Float:
        """Return (2, n, m) row and column indices into the radius map."""
        row = (distance_mm - self.distance_mm[0]) / (self.distance_mm[1] - self.distance_mm[0])
        column = np.mod((azimuth_rad + np.pi) / (2 * np.pi), 1.0) * self.radius_mm.shape[1]
        last = len(self.distance_mm) - 1
        return np.stack(np.meshgrid(np.clip(row, 0, last), column, indexing="ij"))

    @staticmethod
    def _sample(values: Float32, where: Float) -> Float:
        return np.asarray(map_coordinates(values, where, np.float64, order=1, mode="grid-wrap"))


def wall_surface(
    wall: Wall, smoothing_mm: float, shading_mm: float, scratch: Scratch | None = None
) -> WallSurface:
    """Return the surface of a measured wall.

    Parameters
    ----------
    wall
        Measured radii; NaN where nothing was seen.
    smoothing_mm
        1 σ of the smoothing of the radii, against their noise.
    shading_mm
        1 σ of the smoothing of the slopes, which are noisier.
    scratch
        Storage for long walls.

    Raises
    ------
    UnusableError
        When fewer than two rows of the radius map hold radii.
    """
    scratch = scratch or Scratch()
    seen = np.flatnonzero(np.isfinite(wall.radius_map.radius_mm).mean(1) >= _SEEN_ROW)
    if len(seen) < 2:
        raise UnusableError(
            "texture", f"{len(seen)} rows of the radius map hold radii", limit="two rows",
            hint="check the counts of valid samples of the stages rings and accumulate in the report",
        )  # fmt: skip
    rows = slice(seen[0], seen[-1] + 1)
    distance = wall.radius_map.distance_mm[rows]
    step = _steps(wall.radius_map)
    measured = wall.radius_map.radius_mm[rows]
    radius, along, around = (scratch.zeros(measured.shape, np.float32) for _ in range(3))
    for part, wide, inner in _blocks(measured):
        smooth = smoothed(measured[wide], tuple(smoothing_mm / s for s in step))
        shape = smoothed(smooth, tuple(shading_mm / s for s in step))
        radius[part], along[part] = smooth[inner], np.gradient(shape, step[0], axis=0)[inner]
        around[part] = ((np.roll(shape, -1, 1) - np.roll(shape, 1, 1)) / (2 * step[1]))[inner]
    return WallSurface(wall.axis, distance, radius, along, around, (float(distance[0]), float(distance[-1])))


def _blocks(radius_mm: Float32) -> Iterator[tuple[slice, slice, slice]]:
    """Yield blocks as three slices: rows, the same widened on both sides, and the rows within the widened.

    Blocks are widened until some radius in them is known.
    """
    rows = len(radius_mm)
    for first in range(0, rows, _BLOCK_ROWS):
        last, more = min(first + _BLOCK_ROWS, rows), _MORE_ROWS
        while True:
            wide = slice(max(first - more, 0), min(last + more, rows))
            if np.isfinite(radius_mm[wide]).any():
                break
            more *= 2
        yield slice(first, last), wide, slice(first - wide.start, last - wide.start)


def smoothed(radius_mm: Float32, sigma_px: tuple[float, ...]) -> Float32:
    """Return radii (S, A) smoothed by a Gaussian, with NaN filled from increasingly distant neighbours.

    Normalised convolution (H. Knutsson, C.-F. Westin, CVPR 1993), wrapped around the pipe.
    """
    known = np.isfinite(radius_mm)
    out = np.full(radius_mm.shape, np.nan)
    value, weight = np.where(known, radius_mm, 0.0), known.astype(float)
    sigma = np.maximum(sigma_px, 0.3)
    while np.isnan(out).any():
        total = _gaussian(weight, sigma)
        mean = _gaussian(value, sigma) / np.maximum(total, 1e-12)
        # Below a thousandth of the weight, neighbours lie beyond 3.7 σ: the next, wider pass reaches them.
        out = np.where(np.isnan(out) & (total > 1e-3), mean, out)
        sigma = 2 * sigma
    return out.astype(np.float32)


def _gaussian(values: Float, sigma_px: Float) -> Float:
    return np.asarray(gaussian_filter(values, sigma_px, mode=("nearest", "wrap")))


def _steps(radius_map: RadiusMap) -> tuple[float, float]:
    """Return the map's cell size along and around, mm."""
    radius = float(np.nanmean(radius_map.radius_mm))
    around = float(radius_map.azimuth_rad[1] - radius_map.azimuth_rad[0]) * radius
    return float(radius_map.distance_mm[1] - radius_map.distance_mm[0]), around
