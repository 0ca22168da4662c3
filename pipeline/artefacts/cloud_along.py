"""The points of a wall's cloud by where along the pipe they lie."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Float
from pipeline.artefacts.measured import PointCloud

# Points in a chunk: some MB, for memory's sake.
_AT_ONCE = 1 << 16


@dataclass(frozen=True)
class CloudAlong:
    """A cloud in chunks, of each of which it is known where along the pipe it lies.

    Attributes
    ----------
    cloud : PointCloud
        In order of rings, so that what lies near each other is in few chunks.
    nearest_mm, farthest_mm : (n,)
        Of every chunk.
    """

    cloud: PointCloud
    nearest_mm: Float
    farthest_mm: Float

    def between(self, first_mm: float, last_mm: float) -> PointCloud:
        """Return the points from one distance to another."""
        chunks = np.flatnonzero((self.farthest_mm >= first_mm) & (self.nearest_mm <= last_mm))
        parts = [_near(self.cloud, int(k), first_mm, last_mm) for k in chunks] or [
            _rows(self.cloud, slice(0))
        ]
        return PointCloud(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))

    def ring_spacing_mm(self) -> float:
        """Return the median distance between neighbouring rings."""
        frames = int(self.cloud.frame.max(initial=-1)) + 1
        count, total = np.zeros(frames), np.zeros(frames)
        for first in range(0, len(self.cloud.frame), _AT_ONCE):
            rows = slice(first, first + _AT_ONCE)
            frame = self.cloud.frame[rows]
            count += np.bincount(frame, minlength=frames)
            total += np.bincount(frame, self.cloud.distance_mm[rows], minlength=frames)
        middle = np.sort(total[count > 0] / count[count > 0])
        return float(np.median(np.diff(middle))) if len(middle) > 1 else 0.0


def cloud_along(cloud: PointCloud) -> CloudAlong:
    """Go through a cloud once and note where its chunks lie."""
    parts = [cloud.distance_mm[k : k + _AT_ONCE] for k in range(0, len(cloud.frame), _AT_ONCE)]
    nearest, farthest = ([float(f(p)) for p in parts] for f in (np.min, np.max))
    return CloudAlong(cloud, np.array(nearest), np.array(farthest))


def _near(cloud: PointCloud, chunk: int, first_mm: float, last_mm: float) -> list[NDArray[np.generic]]:
    part = _rows(cloud, slice(chunk * _AT_ONCE, (chunk + 1) * _AT_ONCE))
    distance = cloud.distance_mm[chunk * _AT_ONCE : (chunk + 1) * _AT_ONCE]
    near = (distance >= first_mm) & (distance <= last_mm)
    return [column[near] for column in part]


def _rows(cloud: PointCloud, rows: slice) -> list[NDArray[np.generic]]:
    return [getattr(cloud, field.name)[rows] for field in fields(cloud)]
