"""Observations of landmarks: gathered frame by frame, thinned and put on the disk, read back by stretches."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Bool, Float, Int
from pipeline.machine.scratch import Scratch, Spool

_FEWEST_SEEN = 3
_SEEN = np.dtype([("landmark", "i8"), ("frame", "i8"), ("uv", "f8", 2), ("sigma", "f8"), ("at", "f8", 2)])


@dataclass(frozen=True)
class Tracks:
    """Observations of landmarks, sorted by landmark, then frame.

    Attributes
    ----------
    landmark, frame : (M,) int
        Index into ``xyz`` and index into the list of all frames.
    uv : (M, 2)
        Observed pixels.
    sigma_px : (M,)
        1 σ, px, of each coordinate.
    xyz : (L, 3)
        First guess of the landmarks in the straightened pipe.
    frames : (K,) int
        Frames that were tracked.
    T_pc : (K, 4, 4)
        First guess of their poses in the straightened pipe.
    lost : (K,) bool
        Frames in which too little texture was found to move the pose.
    """

    landmark: Int
    frame: Int
    uv: Float
    sigma_px: Float
    xyz: Float
    frames: Int
    T_pc: Float
    lost: Bool


class Course(Protocol):
    """Where texture took the probe: what `Tracks` and a whole run's tracking have in common."""

    @property
    def frames(self) -> Int:
        """(K,) frames that were tracked."""

    @property
    def T_pc(self) -> Float:  # noqa: N802  a frame's name
        """(K, 4, 4) first guess of their poses in the straightened pipe."""

    @property
    def lost(self) -> Bool:
        """(K,) frames in which too little texture was found to move the pose."""


@dataclass(frozen=True)
class _Batch:
    """Records ``first`` to ``last`` (exclusive), all of frames ``from_frame`` to ``to_frame``."""

    first: int
    last: int
    from_frame: int
    to_frame: int


@dataclass
class TrackStore:
    """Observations of a whole run; in memory are only those of landmarks that are still followed.

    Attributes
    ----------
    most : int
        Observations of one landmark that are kept, spread evenly: neighbouring ones err alike, so the rest
        would cost room and tell nothing.
    landmarks : int
        Landmarks on the disk.
    """

    most: int
    spool: Spool
    open: list[NDArray[np.void]] = field(default_factory=list)
    batches: list[_Batch] = field(default_factory=list)
    landmarks: int = 0

    @staticmethod
    def on(scratch: Scratch, most: int) -> TrackStore:
        """Return an empty store."""
        return TrackStore(most, scratch.spool(_SEEN))

    def note(self, landmark: Int, frame: int, uv: Float, sigma: Float, at: Float) -> None:
        """Keep the observations (N,) of one frame; ``at`` (N, 2) is where landmarks lie in the strip."""
        seen = np.zeros(len(landmark), _SEEN)
        seen["landmark"], seen["frame"], seen["uv"], seen["sigma"] = landmark, frame, uv, sigma
        seen["at"] = at
        self.open.append(seen)

    def settle(self, gone: Int | None = None) -> None:
        """Put the observations of landmarks that are no longer followed on the disk; None for all."""
        seen = np.concatenate(self.open) if self.open else np.zeros(0, _SEEN)
        settled = np.ones(len(seen), bool) if gone is None else np.isin(seen["landmark"], gone)
        self.open = [seen[~settled]]
        kept = _thinned(seen[settled], self.most)
        if len(kept):
            frame, first = kept["frame"], self.spool.count
            self.spool.append(kept)
            self.landmarks += len(np.unique(kept["landmark"]))
            self.batches.append(_Batch(first, self.spool.count, int(frame.min()), int(frame.max()) + 1))

    def between(self, first: int, last: int) -> NDArray[np.void]:
        """Return the records of frames ``first`` to ``last`` (exclusive), sorted by landmark, then frame.

        Landmarks seen less than three times in them are left out.
        """
        near = [b for b in self.batches if b.from_frame < last and b.to_frame > first]
        parts = [self.spool.part(b.first, b.last) for b in near]
        seen = np.concatenate(parts) if parts else np.zeros(0, _SEEN)
        seen = seen[(seen["frame"] >= first) & (seen["frame"] < last)]
        seen = seen[np.lexsort((seen["frame"], seen["landmark"]))]
        _, place, count = np.unique(seen["landmark"], return_inverse=True, return_counts=True)
        often: NDArray[np.void] = seen[count[place] >= _FEWEST_SEEN]
        return often


def _thinned(seen: NDArray[np.void], most: int) -> NDArray[np.void]:
    """Return at most ``most`` observations of each landmark, and none of those seen less than three times."""
    seen = seen[np.lexsort((seen["frame"], seen["landmark"]))]
    _, place, count = np.unique(seen["landmark"], return_inverse=True, return_counts=True)
    first = np.cumsum(count) - count
    rank = np.arange(len(seen)) - first[place]
    share = np.minimum(most / np.maximum(count[place], 1), 1.0)
    keep = np.floor((rank + 1) * share) > np.floor(rank * share)
    kept: NDArray[np.void] = seen[keep & (count[place] >= _FEWEST_SEEN)]
    return kept
