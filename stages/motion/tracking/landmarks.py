"""Texture landmarks: the active ones, and the observations of all of them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Bool, Float, Int
from pipeline.instrument.camera import Camera
from pipeline.machine.scratch import Scratch, Spool
from stages.motion.tracking.patches import Patches

_FEWEST_DROPPED = 256
"""Retired landmarks are removed in batches of at least so many, since the arrays are copied each time."""
_FEWEST_SEEN = 3
"""A landmark with fewer observations is left out: two of them determine it without a check."""
OBSERVATION = np.dtype(
    [("landmark", "i8"), ("frame", "i8"), ("uv", "f8", 2), ("sigma", "f8"), ("at", "f8", 2)]
)
"""One observation: number of the landmark, place of the frame in the list of all, pixel and its 1 σ, px, and
the row and column of the strip where the landmark was found first."""


_MOSTLY = 0.5
"""Share of the frames without texture from which texture is no evidence for the whole run. Chosen."""
_MUCH = 0.25
"""If a larger share of the lit pictures shows no texture, the others must not contradict encoder or probe
(chosen; in good recordings every picture shows some). In VP9 at .5 Mbit/s half of the pictures had none. The
texture in the others made the distance 4.8 % too short, and the encoder, which was right, was discarded."""


@dataclass
class LandmarkMap:
    """Strip positions, offsets, patches and history of the landmarks (L,) that may still be searched.

    Attributes
    ----------
    half : int
        Half size of a patch, strip samples.
    number : (L,) int
        Landmarks are numbered in the order in which they were found.
    row, column : (L,)
        Strip position where the landmark was found first.
    offset : (L, 2)
        Its current displacement from there, without the common motion of all landmarks; rows and columns.
    born : (L,) int
        First frame.
    retired : (L,) bool
        Whether it is no longer searched.
    misses : (L,) int
        Number of times in a row that it was not found.
    patches : Patches
        Appearance of the first L; the arrays may have room for more.
    found : int
        Landmarks found so far, dropped ones included.
    """

    half: int
    number: Int = field(default_factory=lambda: np.zeros(0, np.int64))
    row: Float = field(default_factory=lambda: np.zeros(0))
    column: Float = field(default_factory=lambda: np.zeros(0))
    offset: Float = field(default_factory=lambda: np.zeros((0, 2)))
    born: Int = field(default_factory=lambda: np.zeros(0, np.int64))
    retired: Bool = field(default_factory=lambda: np.zeros(0, bool))
    misses: Int = field(default_factory=lambda: np.zeros(0, np.int64))
    patches: Patches = field(init=False)
    found: int = 0

    def __post_init__(self) -> None:
        self.patches = Patches.none(2 * self.half + 1)

    def add(self, at: Float, born: int, patches: Patches) -> None:
        """Add landmarks at strip positions (N, 2)."""
        n = len(at)
        self.patches = self.patches.followed_by(len(self.number), patches)
        self.number = np.append(self.number, self.found + np.arange(n))
        self.row, self.column = np.append(self.row, at[:, 0]), np.append(self.column, at[:, 1])
        self.offset = np.concatenate([self.offset, np.zeros((n, 2))])
        self.born = np.append(self.born, np.full(n, born))
        self.retired = np.append(self.retired, np.zeros(n, bool))
        self.misses = np.append(self.misses, np.zeros(n, np.int64))
        self.found += n

    @property
    def has_many_retired(self) -> bool:
        """Whether so many landmarks are retired that it pays to drop them."""
        return int(self.retired.sum()) > max(len(self.retired) // 2, _FEWEST_DROPPED)

    def drop_retired(self) -> Int:
        """Remove retired landmarks, so that the work for a frame does not grow; return their numbers."""
        dropped, keep = self.number[self.retired], ~self.retired
        self.patches = self.patches.of(np.flatnonzero(keep))
        for name in ("number", "row", "column", "offset", "born", "retired", "misses"):
            setattr(self, name, getattr(self, name)[keep])
        return np.asarray(dropped)


@dataclass(frozen=True)
class TrackedPoses:
    """Poses of the probe from texture.

    Attributes
    ----------
    frames : (K,) int
        Tracked frames, as indices in the list of all frames.
    T_pc : (K, 4, 4)
        First guess of their poses in the straightened pipe.
    lost : (K,) bool
        Frames in which too little texture was found to move the pose.
    """

    frames: Int
    T_pc: Float
    lost: Bool

    @property
    def known(self) -> Int:
        """Return the frames (k,) whose poses texture gives: the first one, and all that are not lost."""
        return np.asarray(self.frames[~self.lost | (np.arange(len(self.lost)) == 0)])

    @property
    def mostly_lost(self) -> bool:
        """Whether most frames show too little texture: then it is no evidence of the camera's motion."""
        return bool(len(self.lost) > 1 and self.lost[1:].mean() > _MOSTLY)

    @property
    def much_lost(self) -> bool:
        """Whether so many frames show too little texture that the evidence of the others is in doubt."""
        return bool(np.sum(self.lost[1:]) > _MUCH * len(self.lost[1:]))

    def between(self, first: int, last: int) -> TrackedPoses:
        """Return those of frames ``first`` to ``last`` (exclusive), counted from ``first``."""
        inside = (self.frames >= first) & (self.frames < last)
        return TrackedPoses(self.frames[inside] - first, self.T_pc[inside], self.lost[inside])


@dataclass(frozen=True)
class Tracks:
    """Observations of landmarks, sorted by landmark, then frame.

    Attributes
    ----------
    landmark, frame : (M,) int
        Index into ``xyz`` and index into the list of frames.
    uv : (M, 2)
        Observed pixels.
    sigma_px : (M,)
        1 σ, px, of each coordinate.
    xyz : (L, 3)
        First guess of the landmarks in the straightened pipe.
    poses : TrackedPoses
    """

    landmark: Int
    frame: Int
    uv: Float
    sigma_px: Float
    xyz: Float
    poses: TrackedPoses

    def some(self, keep: Bool) -> tuple[Tracks, Bool]:
        """Return some observations (M,), and which landmarks (L,) are left: those seen often enough."""
        often = np.bincount(self.landmark[keep], minlength=len(self.xyz)) >= _FEWEST_SEEN
        keep = keep & often[self.landmark]
        landmark = (np.cumsum(often) - 1)[self.landmark[keep]]
        parts = self.frame[keep], self.uv[keep], self.sigma_px[keep], self.xyz[often], self.poses
        return Tracks(landmark, *parts), often

    def polar_angle(self, camera: Camera) -> Float:
        """Return the angles (M,), rad, between the rays of the observations and the optical axis."""
        return np.asarray(np.arccos(np.clip(camera.unproject(self.uv).ray[:, 2], -1, 1)))

    def reduced(self, times: Float, centre_px: Float) -> Tracks:
        """Return the tracks corrected for pictures that were too large by the factor ``times`` (N,)."""
        return replace(self, uv=centre_px + (self.uv - centre_px) / times[self.frame, None])


@dataclass(frozen=True)
class _Batch:
    """Records ``first`` to ``last`` (exclusive), all of frames ``from_frame`` to ``to_frame``."""

    first: int
    last: int
    from_frame: int
    to_frame: int


@dataclass
class ObservationStore:
    """Observations of a whole run; memory holds only those of active landmarks.

    Attributes
    ----------
    most : int
        Largest number of observations kept of one landmark, spread evenly: those of neighbouring frames have
        nearly the same error, so that more would need space without adding information.
    spool : Spool
        Spool of `OBSERVATION` on the disk.
    open : list of arrays
        Observations of landmarks that may be seen again.
    batches : list
    landmarks : int
        Landmarks on the disk.
    """

    most: int
    spool: Spool
    open: list[NDArray[np.void]] = field(default_factory=list)
    batches: list[_Batch] = field(default_factory=list)
    landmarks: int = 0

    @staticmethod
    def on(scratch: Scratch, most: int) -> ObservationStore:
        """Return an empty store."""
        return ObservationStore(most, scratch.spool(OBSERVATION))

    def add(self, landmark: Int, frame: int, uv: Float, sigma: Float, at: Float) -> None:
        """Store the observations (N,) of one frame; ``at`` (N, 2) are the landmarks' places in the strip."""
        seen = np.zeros(len(landmark), OBSERVATION)
        seen["landmark"], seen["frame"], seen["uv"], seen["sigma"] = landmark, frame, uv, sigma
        seen["at"] = at
        self.open.append(seen)

    def write(self, retired: Int | None = None) -> None:
        """Write the observations of retired landmarks to the disk; None means all landmarks."""
        seen = np.concatenate(self.open) if self.open else np.zeros(0, OBSERVATION)
        complete = np.ones(len(seen), bool) if retired is None else np.isin(seen["landmark"], retired)
        self.open = [seen[~complete]]
        kept = _thinned(seen[complete], self.most)
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
        seen = np.concatenate(parts) if parts else np.zeros(0, OBSERVATION)
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
