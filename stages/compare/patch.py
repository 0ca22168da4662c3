"""Cuts a place out of both walls: heights, the mask of the defect, and clean wall for comparison."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter, label

from pipeline.arrays import Bool, Float, Int
from pipeline.artefacts.wall_map import cells_within
from stages.compare.paired import PairedWalls, Stretch, ring_values

# Wall around a finding that is cut out with it, as wide as the reference for depths in the review.
_MARGIN_MM = 6.0
# 1 σ with which heights are smoothed: that of the run's own map, by default.
_SMOOTHING_MM = 0.3
# A piece of wall counts as clean when this share of it was seen and belongs to no finding. Chosen.
_LEAST_CLEAN = 0.9
# Pieces of clean wall, of the defect's own rings and then of its neighbours: 40 give a σ to 11 %, and with
# fewer than 4 Student's t says hardly anything.
_ENOUGH, _LEAST_PIECES = 40, 4
_LEAST_SEEN = 0.5
# The foot of a defect reaches beyond its outline, so wall this near to one is not called clean. Chosen.
_FOOT_MM = 2.0


@dataclass(frozen=True)
class Patch:
    """A piece of both walls around a defect.

    Attributes
    ----------
    now_mm, before_mm : (R, C)
        Height over the later rings' smooth shape, positive into the wall; 0 where not seen.
    seen_now, seen_before : (R, C) bool
    inside : (R, C) bool
        Within an outline.
    cell_mm : (float, float)
    noise_mm : (K, R, C)
        The walls' difference over clean wall elsewhere, which has not changed.
    own_pieces : int
        Number of these pieces, the first ones, that belong to the defect's own rings.
    """

    now_mm: Float
    before_mm: Float
    seen_now: Bool
    seen_before: Bool
    inside: Bool
    cell_mm: tuple[float, float]
    noise_mm: Float
    own_pieces: int

    @property
    def is_seen_in_both(self) -> bool:
        """Whether both runs saw enough of it."""
        return min(self.coverage) >= _LEAST_SEEN

    @property
    def coverage(self) -> tuple[float, float]:
        """Seen share of the defect, in the later run and in the earlier; NaN where it lies beyond both."""
        if not self.inside.any():
            return float("nan"), float("nan")
        return float(self.seen_now[self.inside].mean()), float(self.seen_before[self.inside].mean())

    @property
    def is_comparable(self) -> bool:
        """Whether both runs saw enough of it, and of clean wall of its size."""
        return self.is_seen_in_both and len(self.noise_mm) >= _LEAST_PIECES


@dataclass(frozen=True)
class Cutter:
    """Cuts patches out of paired walls.

    Attributes
    ----------
    pair : PairedWalls
    defective : (S, A) bool
        Wall of the later run's grid that any finding covers; the rest is clean.
    """

    pair: PairedWalls
    defective: Bool

    def patch(self, outlines: Sequence[Float], random: np.random.Generator) -> Patch:
        """Return the patch around outlines (V, 2) of the later run."""
        wall = self.pair.now
        radius = self.pair.radius_mm
        corner = np.concatenate(outlines)
        rows = self._rows(corner)
        columns, first = self._columns(corner, _MARGIN_MM / radius)
        inside = np.zeros((len(rows), len(columns)), bool)
        for outline in outlines:
            row = (outline[:, 0] - wall.distance_mm[rows[0]]) / wall.step_mm
            column = (outline[:, 1] - wall.azimuth_rad[0]) / wall.step_rad - first
            inside |= cells_within(np.stack([column, row], -1), inside.shape)
        stretch = self.pair.stretch(int(rows[0]), int(rows[-1]) + 1)
        shape = ring_values(stretch.now_mm, wall.azimuth_rad)
        heights = [(h - shape)[:, columns] for h in (stretch.now_mm, stretch.before_mm)]
        cell = (wall.step_mm, wall.step_rad * radius)
        now, before = (smoothed(np.nan_to_num(h), cell) for h in heights)
        seen_now, seen_before = (np.isfinite(h) for h in heights)
        noise, own_pieces = self._noise(stretch, rows, inside.shape, cell, random)
        return Patch(now, before, seen_now, seen_before, inside, cell, noise, own_pieces)

    def _rows(self, corner: Float) -> Int:
        wall = self.pair.now
        last = len(wall.distance_mm) - 1
        first, end = (
            round((s - wall.distance_mm[0]) / wall.step_mm)
            for s in (corner[:, 0].min() - _MARGIN_MM, corner[:, 0].max() + _MARGIN_MM)
        )
        return np.arange(int(np.clip(first, 0, last)), int(np.clip(end, 0, last)) + 1)

    def _columns(self, corner: Float, margin: float) -> tuple[Int, int]:
        wall, count = self.pair.now, len(self.pair.now.azimuth_rad)
        first = int(np.floor((corner[:, 1].min() - margin - wall.azimuth_rad[0]) / wall.step_rad))
        last = int(np.ceil((corner[:, 1].max() + margin - wall.azimuth_rad[0]) / wall.step_rad))
        return (first + np.arange(min(last - first + 1, count))) % count, first

    def _noise(
        self, own: Stretch, rows: Int, shape: tuple[int, int], cell: tuple[float, float],
        random: np.random.Generator,
    ) -> tuple[Float, int]:  # fmt: skip
        """Return differences (K, R, C) of clean pieces, first those of its own rings, and their number."""
        reach = len(rows)
        steps = (0, -1, 1, -2, 2, -3, 3, -4, 4, -6, 6, -8, 8)
        starts = [int(rows[0]) + k * reach for k in steps]
        found: list[Float] = []
        own_pieces = 0
        for start in (s for s in starts if 0 <= s <= len(self.defective) - reach):
            if len(found) >= _ENOUGH:
                break
            stretch = own if start == rows[0] else self.pair.stretch(start, start + reach)
            found += self._clean_pieces(stretch, start, shape[1], cell, random)
            own_pieces = len(found) if start == rows[0] else own_pieces
        return np.array(found).reshape(-1, *shape), own_pieces

    def _clean_pieces(
        self, stretch: Stretch, start: int, width: int, cell: tuple[float, float], random: np.random.Generator
    ) -> list[Float]:
        """Return pieces of the walls' difference all round some rings, half overlapping, where clean."""
        clean = ~self.defective[start : start + len(stretch.distance_mm)] & np.isfinite(stretch.difference_mm)
        surface = smoothed(np.where(clean, stretch.difference_mm, 0.0), cell)
        count = clean.shape[1]
        turns = int(random.integers(count)) + np.arange(0, count, max(width // 2, 1))
        pieces = [(turn + np.arange(width)) % count for turn in turns]
        return [surface[:, at] for at in pieces if clean[:, at].mean() >= _LEAST_CLEAN]


def smoothed(height_mm: Float, cell_mm: tuple[float, float], sigma_mm: float = _SMOOTHING_MM) -> Float:
    """Return heights smoothed by a Gaussian."""
    return np.asarray(gaussian_filter(height_mm, [sigma_mm / c for c in cell_mm]))


def at_its_peak(mask: Bool, peak: tuple[int, int]) -> Bool:
    """Return the connected part of a mask to which the cell ``peak`` belongs; empty if it is outside."""
    parts, _ = label(mask)
    return np.asarray(parts == parts[peak]) if parts[peak] else np.zeros_like(mask)


def outline_mask(outlines: list[Float], pair: PairedWalls) -> Bool:
    """Return the cells (S, A) of the later wall within `_FOOT_MM` of an outline or inside of one."""
    wall = pair.now
    mask = np.zeros((len(wall.distance_mm), len(wall.azimuth_rad)), np.uint8)
    for outline in outlines:
        row = (outline[:, 0] - wall.distance_mm[0]) / wall.step_mm
        column = (outline[:, 1] - wall.azimuth_rad[0]) / wall.step_rad
        for turn in (-1, 0, 1):
            point = np.stack([column + turn * mask.shape[1], row], -1)
            cv2.fillPoly(mask, [np.round(point).astype(np.int32)], 1)
    rows, columns = (int(_FOOT_MM / cell) for cell in (wall.step_mm, wall.step_rad * pair.radius_mm))
    around = cv2.copyMakeBorder(mask, 0, 0, columns, columns, cv2.BORDER_WRAP)
    wide = cv2.dilate(around, np.ones((2 * rows + 1, 2 * columns + 1), np.uint8))
    return np.asarray(wide[:, columns : columns + mask.shape[1]].astype(bool))
