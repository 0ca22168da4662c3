"""Texture tracks: landmarks on the wall followed from frame to frame in unrolled strips."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import cv2
import numpy as np

from pipeline.arrays import Bool, Float, Float32, Image, Int
from pipeline.geometry.rigid import from_parts, rotation_from_vector
from pipeline.instrument.probe import Probe
from pipeline.machine.scratch import Scratch
from stages.motion.parameters import MotionParameters
from stages.motion.tracking.landmarks import LandmarkMap
from stages.motion.tracking.observations import Tracks, TrackStore
from stages.motion.tracking.patches import cut, match
from stages.motion.tracking.prediction import Predictor
from stages.motion.tracking.strips import Strip, StripGrid, unroll

_FEWEST = 12
_FEWEST_ALIKE = 0.4
_ALIKE_PX = 1.5
_MOST_MISSES = 8
_BORDER_PX = 3


@dataclass(frozen=True)
class _Found:
    """Landmarks (N,) looked for; which were found (N,), at what strip position, offset (N, 2) and σ (N,)."""

    landmark: Int
    good: Bool
    at: Float
    offset: Float
    sigma: Float

    @property
    def alike(self) -> float:
        """Return the share of landmarks in view that were found and moved like the next one around.

        Noise is matched too, wherever it fits best by chance; but then no two landmarks move alike.
        """
        in_view = int(np.isfinite(self.at[:, 0]).sum())
        around = np.argsort(self.at[self.good, 1], kind="stable")
        apart = np.abs(np.diff(self.offset[self.good][around], axis=0)).max(1, initial=0.0)
        return float(np.sum(apart < _ALIKE_PX)) / max(in_view, 1)


@dataclass(frozen=True)
class Followed:
    """What following the wall's texture gave.

    Attributes
    ----------
    store : TrackStore
    grid : StripGrid
        Of the landmarks' strip positions.
    frames : (K,) int
        Frames that were tracked, as places in the list of all frames.
    T_pc : (K, 4, 4)
        First guess of their poses in the straightened pipe.
    lost : (K,) bool
        Frames in which too little texture was found to move the pose.
    """

    store: TrackStore
    grid: StripGrid
    frames: Int
    T_pc: Float
    lost: Bool

    def between(self, first: int, last: int) -> Tracks:
        """Return the tracks through frames ``first`` to ``last`` (exclusive), counted from ``first``."""
        seen = self.store.between(first, last)
        _, start, landmark = np.unique(seen["landmark"], return_index=True, return_inverse=True)
        at = seen["at"][start]
        near = (self.frames >= first) & (self.frames < last)
        return Tracks(
            landmark, seen["frame"] - first, seen["uv"], seen["sigma"], self.grid.wall(at[:, 0], at[:, 1]),
            self.frames[near] - first, self.T_pc[near], self.lost[near],
        )  # fmt: skip


class TextureTracker:
    """Follows the wall's texture; distance and roll follow from it, the rest of the pose from the rings.

    Each landmark keeps its own offset from where the cylinder puts it, so that a wrong pitch, yaw or radius
    bends the strips but never feeds back into the pose: those are left to the joint adjustment.
    """

    def __init__(
        self,
        probe: Probe,
        grid: StripGrid,
        parameters: MotionParameters,
        blocked_mm: tuple[float, float],
        scratch: Scratch | None = None,
    ) -> None:
        self._probe, self._grid, self._parameters, self._blocked = probe, grid, parameters, blocked_mm
        self._map = LandmarkMap(parameters.patch_half_px)
        self._store = TrackStore.on(scratch or Scratch(), parameters.most_observations)
        self._poses: list[tuple[int, Float, bool]] = []
        self._last: Strip | None = None

    def follow(self, frame: int, image: Image, T_pc: Float) -> Float:
        """Track one frame's softened picture from its predicted pose and return the better pose (4, 4)."""
        strip = unroll(image, self._probe, T_pc, self._grid, self._blocked)
        found = self._search(strip, frame)
        if found.alike < _FEWEST_ALIKE and self._last is not None:
            T_moved = self._shifted(T_pc, _displacement(self._last, strip))
            other = unroll(image, self._probe, T_moved, self._grid, self._blocked)
            found_there = self._search(other, frame)
            if found_there.alike > max(found.alike, _FEWEST_ALIKE):
                T_pc, strip, found = T_moved, other, found_there
        drift, lost = self._note(found, strip, frame)
        T_better = self._shifted(T_pc, drift)
        self._grow(strip, frame, drift)
        self._poses.append((frame, T_better, lost))
        self._last = strip
        if self._map.is_crowded:
            self._store.settle(self._map.drop(self._map.retired))
        return T_better

    def followed(self) -> Followed:
        """Return what was followed, all observations settled."""
        self._store.settle()
        return Followed(
            self._store, self._grid, np.array([p[0] for p in self._poses], np.int64),
            np.array([p[1] for p in self._poses]).reshape(-1, 4, 4),
            np.array([p[2] for p in self._poses], bool),
        )  # fmt: skip

    def _search(self, strip: Strip, frame: int) -> _Found:
        """Match every landmark that should be in the strip."""
        m = self._map
        guess = np.stack([m.row - strip.first_row, m.column], -1) + m.offset
        # Retired, they leave their places to new ones, should the probe come back.
        m.retired |= frame - m.born >= self._parameters.max_track_frames
        near = np.flatnonzero(self._in_view(strip, guess) & ~m.retired)
        found = match(strip.contrast, strip.usable, m.gather(near), guess[near, 0], guess[near, 1])
        at = guess[near] + found.offset + np.array([strip.first_row, 0])
        good = (found.correlation > self._parameters.min_correlation) & np.isfinite(at).all(1)
        good &= found.sigma < 3 * self._parameters.landmark_sigma_px
        return _Found(near, good, at, found.offset, found.sigma)

    def _in_view(self, strip: Strip, guess: Float) -> Bool:
        """Return whether patches at strip positions (L, 2) may err by some σ and still be seen whole.

        At a border only those would be found that err inward, and all of them together would pull.
        """
        margin = self._map.half + _BORDER_PX
        whole = cv2.erode(strip.usable.astype(np.uint8), np.ones((2 * margin + 1,) * 2)) > 0
        whole[:margin], whole[-margin - 1 :] = False, False
        row, column = np.rint(guess).astype(np.int64).T
        ahead = (row >= 0) & (row < len(whole))
        return np.asarray(ahead & whole[np.where(ahead, row, 0), np.mod(column, whole.shape[1])])

    def _note(self, found: _Found, strip: Strip, frame: int) -> tuple[Float, bool]:
        """Keep the pixels of matched landmarks; return the strip's common displacement (2,) and if lost."""
        m, good = self._map, found.good
        index = found.landmark[good]
        # A patch hidden under the laser line or outside the picture is not missing.
        missing = ~good & np.isfinite(found.at[:, 0])
        m.misses[found.landmark] = np.where(good, 0, m.misses[found.landmark] + missing)
        m.retired[found.landmark] |= m.misses[found.landmark] > _MOST_MISSES
        if len(index) < _FEWEST or found.alike < _FEWEST_ALIKE:
            return np.zeros(2), True
        at = found.at[good]
        sigma = np.maximum(found.sigma[good], 0.02) * self._px_per_strip(strip, at)
        start = np.stack([m.row, m.column], -1)[index]
        self._store.note(m.number[index], frame, strip.pixel(at[:, 0], at[:, 1]), sigma, start)
        drift = np.median(found.offset[good], 0)
        m.offset[index] += found.offset[good] - drift
        return drift, False

    def _px_per_strip(self, strip: Strip, at: Float) -> Float:
        du = strip.pixel(at[:, 0] + 1, at[:, 1]) - strip.pixel(at[:, 0], at[:, 1])
        dv = strip.pixel(at[:, 0], at[:, 1] + 1) - strip.pixel(at[:, 0], at[:, 1])
        return np.asarray(np.sqrt((np.sum(du * du, 1) + np.sum(dv * dv, 1)) / 2))

    def _grow(self, strip: Strip, frame: int, drift: Float) -> None:
        """Start a landmark at the most distinct spot of every free cell."""
        row, column = self._free_spots(strip)
        patches = cut(strip.contrast, row, column, self._map.half)
        variance = np.trace(np.linalg.inv(patches.information + 1e-9 * np.eye(2)), axis1=1, axis2=2) / 2
        sigma_strip = strip.noise[row] * np.sqrt(variance)
        good = sigma_strip < self._parameters.landmark_sigma_px
        at = np.stack([row[good] + strip.first_row, column[good]], -1).astype(float)
        # Where it starts is no observation: the patch's own noise fits itself there and nowhere else.
        self._map.add(at - drift, frame, patches.of(good))

    def _free_spots(self, strip: Strip) -> tuple[Int, Int]:
        """Return rows and columns (in the strip) of the best corner of each unoccupied cell."""
        cell, half = self._parameters.cell_px, self._map.half
        corner = np.asarray(cv2.cornerMinEigenVal(strip.contrast, 2 * half + 1), np.float32)
        corner[cv2.erode(strip.usable.astype(np.uint8), np.ones((2 * half + 3,) * 2)) == 0] = 0
        corner[: half + 2], corner[-half - 3 :] = 0, 0
        first_cell, last_cell = strip.first_row // cell, (strip.first_row + corner.shape[0]) // cell
        columns = corner.shape[1] // cell
        taken = np.zeros((last_cell - first_cell + 1, columns), bool)
        alive = ~self._map.retired
        i = (self._map.row[alive] // cell).astype(int) - first_cell
        j = np.minimum((self._map.column[alive] // cell).astype(int), columns - 1)
        ok = (i >= 0) & (i < len(taken))
        taken[i[ok], j[ok]] = True
        offset = first_cell * cell - strip.first_row
        return _best_of_cells(corner, taken, offset, cell)

    def _shifted(self, T_pc: Float, drift: Float) -> Float:
        """Move a pose so that the strip moves by ``drift`` (rows, columns)."""
        turn = drift[1] * 2 * np.pi / self._grid.columns
        step = from_parts(rotation_from_vector(np.array([0, 0, -turn])), np.zeros(3))
        out = step @ T_pc
        out[2, 3] = T_pc[2, 3] - drift[0] * self._grid.step_mm
        return np.asarray(out)


def _displacement(before: Strip, now: Strip) -> Float:
    """Return by how many rows and columns the wall in ``now`` lies off where ``before`` had it."""
    lag = now.first_row - before.first_row
    rows = before.contrast.shape[0] - abs(lag)
    if rows < 32:
        return np.zeros(2)
    a = before.contrast[max(lag, 0) : max(lag, 0) + rows]
    b = now.contrast[max(-lag, 0) : max(-lag, 0) + rows]
    size = (a.shape[1] // 2, a.shape[0] // 2)
    halves = [cv2.resize(np.clip(x, -1, 1), size, interpolation=cv2.INTER_AREA) for x in (a, b)]
    window = np.broadcast_to(np.hanning(halves[0].shape[0])[:, None], halves[0].shape)
    (dx, dy), response = cv2.phaseCorrelate(*(np.asarray(h * window, np.float32) for h in halves))
    return np.array([2 * dy, 2 * dx]) if response > 0.05 else np.zeros(2)


def _best_of_cells(corner: Float32, taken: Bool, offset: int, cell: int) -> tuple[Int, Int]:
    rows, columns = [], []
    for i, j in zip(*np.nonzero(~taken), strict=True):
        r0 = max(i * cell + offset, 0)
        block = corner[r0 : max((i + 1) * cell + offset, 0), j * cell : (j + 1) * cell]
        if block.size and block.max() > 0:
            r, c = np.unravel_index(np.argmax(block), block.shape)
            rows.append(r0 + r)
            columns.append(j * cell + c)
    return np.array(rows, np.int64), np.array(columns, np.int64)


def track_texture(
    images: Iterable[tuple[int, Image | None]],
    predict: Predictor,
    tracker: TextureTracker,
    progress: Callable[[int], None],
) -> Followed:
    """Follow the wall through all lit frames; undecodable ones are passed over.

    ``progress`` is told the number of frames done.
    """
    for done, (frame, image) in enumerate(images):
        if image is not None:
            predict.learn(frame, tracker.follow(frame, image, predict(frame)))
        progress(done + 1)
    return tracker.followed()
