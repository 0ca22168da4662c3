"""The points of a wall's cloud, indexed by their distance along the pipe."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Float, Int
from pipeline.artefacts.measured import PointCloud

# Points in a chunk: some MB, to limit memory.
_AT_ONCE = 1 << 16
# Rings closer than this part of the usual step belong to a probe that stands; the same part as in premises
# (chosen).
_MOVES = 0.25


@dataclass(frozen=True)
class CloudAlong:
    """A cloud in chunks, with the stretch of pipe in which each chunk lies.

    Attributes
    ----------
    cloud : PointCloud
        Points in the order of rings, so that neighbouring points are in few chunks.
    nearest_mm, farthest_mm : (n,)
        Range of distance of every chunk.
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
        """Return the median distance of neighbouring rings, mm; if the probe mostly stood, where it moved."""
        _, middle = self.rings()
        gone, apart = np.abs(np.diff(middle)), np.diff(np.sort(middle))
        moves = _MOVES * usual_way(gone)
        if 2 * np.sum(gone <= moves) > len(gone) and (apart > moves).any():
            apart = apart[apart > moves]
        return float(np.median(apart)) if len(apart) else 0.0

    def ways_mm(self) -> Float:
        """Return the distance travelled to each frame's ring (F,), mm, since the ring before in time.

        It is 0 for frames without a ring, and for the first ring after missing ones.
        """
        frame, middle = self.rings()
        ways = np.zeros(int(frame.max(initial=-1)) + 1)
        apart = np.diff(frame)
        follows = apart <= np.median(apart) if len(apart) else apart > 0
        ways[frame[1:][follows]] = np.abs(np.diff(middle))[follows]
        return ways

    def rings(self) -> tuple[Int, Float]:
        """Return the frames (R,) that show a ring, and the distance of each ring's middle along the pipe."""
        frames = int(self.cloud.frame.max(initial=-1)) + 1
        count, total = np.zeros(frames), np.zeros(frames)
        for first in range(0, len(self.cloud.frame), _AT_ONCE):
            rows = slice(first, first + _AT_ONCE)
            frame = self.cloud.frame[rows]
            count += np.bincount(frame, minlength=frames)
            total += np.bincount(frame, self.cloud.distance_mm[rows], minlength=frames)
        seen = np.flatnonzero(count)
        return seen, total[seen] / count[seen]


def usual_way(ways: Float) -> float:
    """Return the step such that half of the distance was travelled in steps (n,) at least as long, or 0.

    A probe that stands adds pictures without distance, so that these do not count.
    """
    ways = np.sort(ways)
    gone = np.cumsum(ways)
    return float(ways[np.searchsorted(gone, gone[-1] / 2)]) if gone.size else 0.0


def cloud_along(cloud: PointCloud) -> CloudAlong:
    """Return a cloud with the range of each chunk, in one pass."""
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
