"""The points of a wall's cloud by where along the pipe they lie."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.artefacts import PointCloud

Float = NDArray[np.float64]
Float32 = NDArray[np.float32]
Int = NDArray[np.int64]

_AT_ONCE = 1 << 16


@dataclass(frozen=True)
class WallPoints:
    """Some points (M,) of a cloud."""

    distance_mm: Float32
    azimuth_rad: Float32
    radius_mm: Float32
    frame: Int


@dataclass(frozen=True)
class CloudAlong:
    """A cloud in chunks, of each of which it is known where along the pipe it lies.

    Attributes
    ----------
    cloud : PointCloud
        In order of rings, so that what lies near each other is in few chunks.
    nearest_mm, farthest_mm : (n,)
        Of every chunk.
    spacing_mm : float
        Median distance between neighbouring rings.
    """

    cloud: PointCloud
    nearest_mm: Float
    farthest_mm: Float
    spacing_mm: float

    def between(self, first_mm: float, last_mm: float) -> WallPoints:
        """Return the points from one distance to another."""
        chunks = np.flatnonzero((self.farthest_mm >= first_mm) & (self.nearest_mm <= last_mm))
        parts = [self._part(int(k), first_mm, last_mm) for k in chunks]
        columns = zip(*parts, strict=True) if parts else ([np.empty(0)] for _ in range(4))
        return WallPoints(*(np.concatenate(c) for c in columns))

    def _part(self, chunk: int, first_mm: float, last_mm: float) -> tuple[NDArray[np.generic], ...]:
        rows = slice(chunk * _AT_ONCE, (chunk + 1) * _AT_ONCE)
        distance = self.cloud.distance_mm[rows]
        near = (distance >= first_mm) & (distance <= last_mm)
        others = (self.cloud.azimuth_rad, self.cloud.radius_mm, self.cloud.frame)
        return (distance[near], *(values[rows][near] for values in others))


def cloud_along(cloud: PointCloud) -> CloudAlong:
    """Go through a cloud once and note where its chunks lie."""
    chunks = [slice(k, k + _AT_ONCE) for k in range(0, len(cloud.frame), _AT_ONCE)]
    nearest = np.array([cloud.distance_mm[c].min() for c in chunks], float)
    farthest = np.array([cloud.distance_mm[c].max() for c in chunks], float)
    return CloudAlong(cloud, nearest, farthest, _ring_spacing(cloud, chunks))


def _ring_spacing(cloud: PointCloud, chunks: list[slice]) -> float:
    """Return the median distance between neighbouring rings, mm."""
    frames = int(cloud.frame.max(initial=-1)) + 1
    count, total = np.zeros(frames), np.zeros(frames)
    for chunk in chunks:
        count += np.bincount(cloud.frame[chunk], minlength=frames)
        total += np.bincount(cloud.frame[chunk], cloud.distance_mm[chunk], minlength=frames)
    middle = np.sort(total[count > 0] / count[count > 0])
    return float(np.median(np.diff(middle))) if len(middle) > 1 else 0.0
