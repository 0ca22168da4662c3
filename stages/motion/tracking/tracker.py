"""The texture tracker: follows landmarks on the wall from frame to frame in unrolled strips."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Bool, Float, Image, Int
from pipeline.geometry.rigid import from_parts, rotation_from_vector
from pipeline.instrument.probe import Probe
from pipeline.machine.scratch import Scratch
from stages.motion.encoder import PosePredictor
from stages.motion.parameters import MotionParameters
from stages.motion.tracking.landmarks import LandmarkMap, ObservationStore, TrackedPoses, Tracks
from stages.motion.tracking.matched import FEWEST_AGREEING, Matched
from stages.motion.tracking.overlap import Rival, displacement, repeats, rival_of
from stages.motion.tracking.patches import best_of_cells, cornerness, cut, whole_patches
from stages.motion.tracking.strips import Hidden, Strip, StripGrid, unroll

_SURELY_AGREEING = 0.5
"""Share from which the motion is not compared with that of whole strips, unless the wall repeats: on a drawn
pattern with other marks of half its contrast, patches matched one period too far agreed to 0.4 at most."""
_LARGEST_SIGMA = 3.0
"""Matches whose σ is larger than so many times ``landmark_sigma_px`` are rejected. Not measured."""
_LEAST_SIGMA = 0.02
"""Smallest σ, strip samples, of a match: interpolation alone errs as much. Not measured."""
_MOST_MISSES = 8
"""Frames in a row without the landmark after which it is retired. Not measured."""
_BORDER_PX = 3
"""Rows and columns around a patch that must be usable too: ten times ``landmark_sigma_px``."""
_LOOKED_EVERY = 8
"""Lit frames after which it is checked again whether the wall repeats: fewer than pass through the view."""


@dataclass(frozen=True)
class TrackedTexture:
    """Result of tracking the wall's texture through a run.

    Attributes
    ----------
    store : ObservationStore
    grid : StripGrid
        Of the landmarks' strip positions.
    poses : TrackedPoses
    ambiguous : int
        Frames in which another step along a wall that repeats fits as well.
    """

    store: ObservationStore
    grid: StripGrid
    poses: TrackedPoses
    ambiguous: int = 0

    def between(self, first: int, last: int) -> Tracks:
        """Return the tracks through frames ``first`` to ``last`` (exclusive), counted from ``first``."""
        seen = self.store.between(first, last)
        _, start, landmark = np.unique(seen["landmark"], return_index=True, return_inverse=True)
        at = seen["at"][start]
        xyz, poses = self.grid.wall(at[:, 0], at[:, 1]), self.poses.between(first, last)
        return Tracks(landmark, seen["frame"] - first, seen["uv"], seen["sigma"], xyz, poses)


def track_texture(
    images: Iterable[tuple[int, Image | None]],
    predictor: PosePredictor,
    tracker: TextureTracker,
    progress: Callable[[int], None],
) -> TrackedTexture:
    """Track the wall's texture through all lit frames; those that cannot be decoded are passed over.

    ``progress`` is told the number of frames done.
    """
    with ThreadPoolExecutor(1) as aside:
        for done, (frame, image) in enumerate(images):
            if image is not None:
                predictor.learn(frame, tracker.follow(frame, image, predictor.predict(frame), aside))
            progress(done + 1)
        return tracker.result()


class TextureTracker:
    """Tracks the wall's texture; distance and roll follow from it, the rest of the pose from the rings.

    Each landmark keeps its own offset from where the cylinder puts it, so that a wrong pitch, yaw or radius
    bends the strips but is never fed back into the pose: those are left to the bundle adjustment.
    """

    def __init__(
        self,
        probe: Probe,
        grid: StripGrid,
        parameters: MotionParameters,
        hidden: Hidden,
        scratch: Scratch | None = None,
    ) -> None:
        self._probe, self._grid, self._parameters, self._hidden = probe, grid, parameters, hidden
        self._map = LandmarkMap(parameters.patch_half_px)
        self._store = ObservationStore.on(scratch or Scratch(), parameters.most_observations)
        self._poses: list[tuple[int, Float, bool]] = []
        self._last: Strip | None = None
        self._last_drift, self._repeating, self._ambiguous = np.zeros(2), False, 0
        self._renewal: Future[None] | None = None

    def follow(self, frame: int, image: Image, T_pc: Float, aside: Executor) -> Float:
        """Track one frame's softened picture from its predicted pose and return the better pose (4, 4).

        What was found is recorded and new landmarks are started ``aside``, while the next frame is unrolled.
        """
        T_pc, strip, found = self._located(frame, image, T_pc)
        T_better = self._shifted(T_pc, found.drift)
        self._renewal = aside.submit(self._renew, found, strip, frame)
        self._poses.append((frame, T_better, found.lost))
        self._last, self._last_drift = strip, found.drift
        return T_better

    def result(self) -> TrackedTexture:
        """Return what was tracked, all observations written."""
        self._await_renewal()
        self._store.write()
        frames = np.array([p[0] for p in self._poses], np.int64)
        T_pc = np.array([p[1] for p in self._poses]).reshape(-1, 4, 4)
        lost = np.array([p[2] for p in self._poses], bool)
        return TrackedTexture(self._store, self._grid, TrackedPoses(frames, T_pc, lost), self._ambiguous)

    def _located(self, frame: int, image: Image, T_pc: Float) -> tuple[Float, Strip, Matched]:
        """Return the pose from which landmarks were found, the strip and the matches there.

        Where few are found at the predicted pose, or another step fits much better, the last strip as a whole
        tells where to look instead.
        """
        strip = unroll(image, self._probe, T_pc, self._grid, self._hidden.at(frame))
        self._await_renewal()
        found = self._matched(strip, frame)
        moved = self._moved(strip, found)
        if moved is not None:
            T_moved = self._shifted(T_pc, moved)
            other = unroll(image, self._probe, T_moved, self._grid, self._hidden.at(frame))
            found_there = self._matched(other, frame)
            if found_there.agreeing > FEWEST_AGREEING:
                if self._repeating and found.agreeing < FEWEST_AGREEING:
                    self._rival(other, found_there)
                return T_moved, other, found_there
        return T_pc, strip, found

    def _moved(self, strip: Strip, found: Matched) -> Float | None:
        """Return the displacement (2,) of the strip as a whole; None if what was found is beyond doubt."""
        if self._last is None:
            return None
        if len(self._poses) % _LOOKED_EVERY == 1:
            self._repeating = repeats(self._last, self._map.half)
        if found.agreeing < FEWEST_AGREEING:
            return self._last_drift + displacement(self._last, strip)
        if not self._repeating and found.agreeing > _SURELY_AGREEING:
            return None
        rival = self._rival(strip, found)
        return np.array([rival.shift + self._last_drift[0], found.drift[1]]) if rival.fits_better else None

    def _rival(self, strip: Strip, found: Matched) -> Rival:
        """Return the step that fits best beside the one found; count it if nothing decides between the two.

        Behind a picture that was lost the last strip does not, since where it has the wall is not known.
        """
        assert self._last is not None
        rival = rival_of(found.drift[0] - self._last_drift[0], self._last, strip, self._map.half)
        behind_lost = len(self._poses) > 1 and self._poses[-1][2]
        self._ambiguous += rival.fits_as_well or (self._repeating and behind_lost)
        return rival

    def _matched(self, strip: Strip, frame: int) -> Matched:
        """Match every landmark that should be in the strip."""
        m = self._map
        guess = np.stack([m.row - strip.first_row, m.column], -1) + m.offset
        # Landmarks retire after some time, so that new ones take their places should the probe come back.
        m.retired |= frame - m.born >= self._parameters.max_track_frames
        near = np.flatnonzero(self._in_view(strip, guess) & ~m.retired)
        found = m.patches.match(strip.contrast, strip.usable, guess[near, 0], guess[near, 1], near)
        at = guess[near] + found.offset + np.array([strip.first_row, 0])
        good = (found.correlation > self._parameters.min_correlation) & np.isfinite(at).all(1)
        good &= found.sigma < _LARGEST_SIGMA * self._parameters.landmark_sigma_px
        return Matched(near, good, at, found.offset, found.sigma)

    def _in_view(self, strip: Strip, guess: Float) -> Bool:
        """Return whether patches at strip positions (L, 2) are seen whole, even if these err a little.

        Otherwise, at a border only patches that err inward would be found, and together they would bias
        poses.
        """
        margin = self._map.half + _BORDER_PX
        whole = whole_patches(strip.usable, margin)
        whole[:margin], whole[-margin - 1 :] = False, False
        row, column = np.rint(guess).astype(np.int64).T
        inside = (row >= 0) & (row < len(whole))
        return np.asarray(inside & whole[np.where(inside, row, 0), np.mod(column, whole.shape[1])])

    def _record(self, found: Matched, strip: Strip, frame: int) -> None:
        """Store the pixels of matched landmarks, and where they are beside their common displacement."""
        m, good = self._map, found.good
        index = found.landmark[good]
        # A patch hidden under the laser line or outside the picture does not count as missed.
        missing = ~good & np.isfinite(found.at[:, 0])
        m.misses[found.landmark] = np.where(good, 0, m.misses[found.landmark] + missing)
        m.retired[found.landmark] |= m.misses[found.landmark] > _MOST_MISSES
        if found.lost:
            # They were matched in wrong places. New landmarks are started, else later frames would fail too.
            m.retired[index] = True
            return
        at = found.at[good]
        sigma = np.maximum(found.sigma[good], _LEAST_SIGMA) * strip.px_per_sample(at)
        start = np.stack([m.row, m.column], -1)[index]
        self._store.add(m.number[index], frame, strip.pixel(at[:, 0], at[:, 1]), sigma, start)
        m.offset[index] += found.offset[good] - found.drift

    def _renew(self, found: Matched, strip: Strip, frame: int) -> None:
        """Record what was found, start landmarks in free cells, and put those no longer seen away."""
        self._record(found, strip, frame)
        self._start_landmarks(strip, frame, found.drift)
        if self._map.has_many_retired:
            self._store.write(self._map.drop_retired())

    def _await_renewal(self) -> None:
        """Wait until the landmarks of the last frame are there."""
        if self._renewal is not None:
            self._renewal.result()
            self._renewal = None

    def _start_landmarks(self, strip: Strip, frame: int, drift: Float) -> None:
        """Start a landmark at the best corner of every free cell."""
        row, column = self._free_corners(strip)
        patches = cut(strip.contrast, row, column, self._map.half)
        good = strip.noise[row] * patches.sigma_per_noise < self._parameters.landmark_sigma_px
        at = np.stack([row[good] + strip.first_row, column[good]], -1).astype(float)
        # The place where a landmark starts is no observation: the patch's own noise fits itself there alone.
        self._map.add(at - drift, frame, patches.of(good))

    def _free_corners(self, strip: Strip) -> tuple[Int, Int]:
        """Return rows and columns (in the strip) of the best corner of each unoccupied cell."""
        cell, half = self._parameters.cell_px, self._map.half
        first_cell, last_cell = strip.first_row // cell, (strip.first_row + len(strip.contrast)) // cell
        free = np.ones((last_cell - first_cell + 1, strip.contrast.shape[1] // cell), bool)
        active = ~self._map.retired
        i = (self._map.row[active] // cell).astype(int) - first_cell
        j = np.minimum((self._map.column[active] // cell).astype(int), free.shape[1] - 1)
        ok = (i >= 0) & (i < len(free))
        free[i[ok], j[ok]] = False
        rows, columns = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
        for k in np.flatnonzero(free.any(1)).tolist():
            first = (first_cell + k) * cell - strip.first_row
            top, end = max(first, 0), min(max(first + cell, 0), len(strip.contrast))
            corner = cornerness(strip.contrast, strip.usable, half, slice(top, end))
            row, column = best_of_cells(corner, free[k], cell)
            rows.append(top + row)
            columns.append(column)
        return np.concatenate(rows), np.concatenate(columns)

    def _shifted(self, T_pc: Float, drift: Float) -> Float:
        """Move a pose so that the strip moves by ``drift`` (rows, columns)."""
        turn = drift[1] * 2 * np.pi / self._grid.columns
        step = from_parts(rotation_from_vector(np.array([0, 0, -turn])), np.zeros(3))
        out = step @ T_pc
        out[2, 3] = T_pc[2, 3] - drift[0] * self._grid.step_mm
        return np.asarray(out)
