"""Finds revisits: places where the probe passes wall again, and frames that see the same wall twice."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from pipeline.adjustment.robust import robust_spread
from pipeline.arrays import Bool, Float, Int

_BESIDE = 15
"""Rings on either side whose median radius is that of the pipe: longer than a weld, shorter than a pipe's
length at usual ring spacings. Not measured."""
_BAND_SIGMA = 6.0
_LEAST_BAND_MM = 0.15
"""Rings stand out, as welds do, if their radius deviates by so many spreads and mm: far beyond the noise of a
mean radius. Not measured."""
_SAME_WALL = 0.25
"""Largest distance, as a share of the view, between frames that see the same wall. Not measured."""
_STRIDE = 0.35
"""Spacing of compared earlier frames as a share of the view, so that any place within reach overlaps one of
them by more than four fifths."""
_MOST_STRIDES = 4
"""Largest number of frames on either side of a place that are compared, to limit the time."""


@dataclass(frozen=True)
class Passage:
    """Frames that see the wall, and their passes along it.

    Attributes
    ----------
    frame : (K,) int
        Indices in the list of all frames, ascending.
    distance_mm : (K,)
        Distance of the camera along the pipe.
    near_mm, far_mm : float
        Range of wall ahead of the camera that a frame shows.
    number : (K,) int
        Number of each frame's pass: a new one begins where the probe turns back by more than a frame shows.
    """

    frame: Int
    distance_mm: Float
    near_mm: float
    far_mm: float
    number: Int

    @staticmethod
    def of(frame: Int, distance_mm: Float, near_mm: float, far_mm: float) -> Passage:
        """Return the frames with their passes numbered."""
        return Passage(frame, distance_mm, near_mm, far_mm, _passes(distance_mm, far_mm - near_mm))

    @property
    def view_mm(self) -> float:
        """Length of wall that a frame shows."""
        return self.far_mm - self.near_mm

    def seen_again(self, apart: int) -> Int:
        """Return pairs (M, 2) of indices here: (earlier, later) frames that see the same wall.

        The earlier one is of the last pass before that saw it. Pairs fewer than ``apart`` frames apart share
        landmarks and are left out.
        """
        last = int(self.number[-1]) if self.number.size else 0
        pairs = [pair for later in range(1, last + 1) for pair in self._seen_on(later, apart)]
        return np.array(pairs, np.int64).reshape(-1, 2)

    def along(self, index: int, away_mm: Float) -> Int:
        """Return the frames (n,) of one frame's pass nearest to distances ``away_mm`` from it."""
        same = np.flatnonzero(self.number == self.number[index])
        off = np.abs(self.distance_mm[same] - (self.distance_mm[index] + away_mm)[:, None])
        return np.asarray(self.frame[same[np.argmin(off, 1)]])

    def _seen_on(self, later: int, apart: int) -> Iterator[tuple[int, int]]:
        left = np.flatnonzero(self.number == later)
        for before in range(later - 1, -1, -1):
            partner = _nearest(self.distance_mm, np.flatnonzero(self.number == before), left)
            off = np.abs(self.distance_mm[partner] - self.distance_mm[left])
            ok = (off < _SAME_WALL * self.view_mm) & (self.frame[left] - self.frame[partner] > apart)
            yield from zip(partner[ok].tolist(), left[ok].tolist(), strict=True)
            left = left[~ok]


@dataclass(frozen=True)
class WallFeatures:
    """Features by which wall is recognised.

    Attributes
    ----------
    texture : (K,)
        Information of the texture followed in each frame of a passage, 1/px².
    bands_mm : (B,)
        Distances of bands all round the wall, such as welds, ascending.
    """

    texture: Float
    bands_mm: Float


@dataclass(frozen=True)
class Revisit:
    """A stretch of wall seen again.

    Attributes
    ----------
    earlier : tuple of int
        Frames of an earlier pass, the one that should see the same wall first.
    later : int
        Frame of the later pass.
    at_weld : bool
        Whether a band all round the wall is in view.
    """

    earlier: tuple[int, ...]
    later: int
    at_weld: bool


def choose_revisits(
    passage: Passage, pairs: Int, features: WallFeatures, spacing_mm: float, most: int
) -> list[Revisit]:
    """Return one revisit for each stretch of the pipe: where a band is in view, else where most texture is.

    Parameters
    ----------
    passage
    pairs : (M, 2) int
        Result of `Passage.seen_again`.
    features
    spacing_mm : float
        Length of a stretch.
    most : int
        Largest number of revisits, which are spread evenly.
    """
    earlier, later = pairs.T
    has_band = _in_view(passage, later, features.bands_mm)
    stretch = np.floor(passage.distance_mm[later] / spacing_mm).astype(np.int64)
    order = np.lexsort((-features.texture[earlier], ~has_band, stretch, passage.number[later]))
    stretches = np.stack([passage.number[later], stretch])[:, order]
    _, first = np.unique(stretches, axis=1, return_index=True)
    chosen = _apart(np.sort(order[first]), passage.distance_mm[later], has_band, spacing_mm / 2)
    if len(chosen) > most:
        chosen = chosen[np.linspace(0, len(chosen), most, endpoint=False).astype(int)]
    frame = passage.frame
    return [Revisit((int(frame[earlier[k]]),), int(frame[later[k]]), bool(has_band[k])) for k in chosen]


def widened(place: Revisit, passage: Passage, reach_mm: float) -> Revisit:
    """Return a revisit with frames beside the earlier one too, up to ``reach_mm`` away on the same pass."""
    stride = _STRIDE * passage.view_mm
    count = min(int(np.ceil(max(reach_mm - stride, 0.0) / stride)), _MOST_STRIDES)
    steps = np.array(sorted(range(-count, count + 1), key=abs))
    index = int(np.searchsorted(passage.frame, place.earlier[0]))
    return replace(place, earlier=tuple(dict.fromkeys(passage.along(index, stride * steps).tolist())))


def bands_in_rings(distance_mm: Float, radius_mm: Float) -> Float:
    """Return distances, ascending, of rings whose radius differs from their neighbours: welds, joints.

    The radius (F,) is that of the circle through a ring, so that only features all round are found.
    """
    ok = np.isfinite(radius_mm)
    if ok.sum() <= 2 * _BESIDE:
        return np.zeros(0)
    off = radius_mm[ok] - median_filter(radius_mm[ok], 2 * _BESIDE + 1, mode="nearest")
    usual = robust_spread(off)
    return np.sort(distance_mm[ok][np.abs(off) > max(_BAND_SIGMA * usual, _LEAST_BAND_MM)])


def texture_at(frame: Int, observations: Iterable[NDArray[np.void]]) -> Float:
    """Return the information, 1/px², of all texture observations in frames (K,) that are ascending."""
    total = np.zeros(len(frame))
    for seen in observations:
        at = np.searchsorted(frame, seen["frame"])
        total += np.bincount(at, seen["sigma"] ** -2.0, minlength=len(frame))
    return total


def _passes(distance_mm: Float, view_mm: float) -> Int:
    """Return the pass of each frame (K,); a new one begins where the probe turns back by ``view_mm``."""
    turns: list[int] = []
    heading, farthest = 0.0, 0
    for k, distance in enumerate(distance_mm.tolist()):
        ahead = distance - float(distance_mm[farthest])
        if heading == 0.0 and abs(ahead) > view_mm:
            heading, farthest = float(np.sign(ahead)), k
        elif heading * ahead > 0:
            farthest = k
        elif heading * ahead < -view_mm:
            turns.append(farthest + 1)
            heading, farthest = -heading, k
    return np.asarray(np.searchsorted(turns, np.arange(len(distance_mm)), side="right"))


def _nearest(distance_mm: Float, among: Int, of: Int) -> Int:
    """Return for each of ``of`` the one of ``among`` that is nearest in distance."""
    order = among[np.argsort(distance_mm[among], kind="stable")]
    right = np.clip(np.searchsorted(distance_mm[order], distance_mm[of]), 0, len(order) - 1)
    left = np.maximum(right - 1, 0)
    off = np.abs(distance_mm[order[np.stack([left, right])]] - distance_mm[of])
    return np.asarray(np.where(off[0] <= off[1], order[left], order[right]))


def _in_view(passage: Passage, index: Int, bands_mm: Float) -> Bool:
    """Return whether a band lies in the middle half of the view of frames (n,)."""
    first = passage.distance_mm[index] + passage.near_mm + passage.view_mm / 4
    low, high = (np.searchsorted(bands_mm, first + x) for x in (0.0, passage.view_mm / 2))
    return np.asarray(high > low)


def _apart(chosen: Int, distance_mm: Float, has_band: Bool, least_mm: float) -> Int:
    """Return the pairs without those nearer than ``least_mm`` to the one before; bands are preferred."""
    kept: list[int] = []
    for k in chosen.tolist():
        if kept and abs(distance_mm[k] - distance_mm[kept[-1]]) < least_mm:
            if has_band[kept[-1]] or not has_band[k]:
                continue
            kept.pop()
        kept.append(k)
    return np.array(kept, np.int64)
