"""The size of an outline: extent, and depth against the wall around it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from pipeline.adjustment.robust import robust_spread
from pipeline.arrays import Bool, Float, Float32, Int
from pipeline.artefacts.findings import clock_of_azimuth
from pipeline.artefacts.wall_map import WallMap, cells_within
from pipeline.review.decisions.replay import Measured, Outline

_AROUND_MM = 6.0
_LEAST_AROUND = 20
# Depth is the extreme of the mean over this length, so that one noisy cell is no depth.
_MEAN_MM = 1.0


@dataclass(frozen=True)
class OutlineGauge:
    """Measures outlines on a wall."""

    wall: WallMap

    def measure(self, outline: Outline) -> Measured:
        """Return the outline's extent and its extreme depth against the wall within 6 mm around it."""
        point = np.asarray(outline, float)
        rows, columns, inside, around = self._cells(point)
        radius = np.where(inside | around, self.wall.radius_mm[np.ix_(rows, columns)], np.nan)
        depth, sigma = self._depth(radius, self.wall.sigma_random_mm[np.ix_(rows, columns)], inside, around)
        (first, last), (a0, a1) = np.sort(point[:, 0])[[0, -1]], np.sort(point[:, 1])[[0, -1]]
        middle = float(np.nanmedian(self.wall.radius_mm[rows]))
        clock = clock_of_azimuth(np.array([a0, a1]))
        return Measured(
            float(first), float(last), float(clock[0]), float(clock[1]),
            float(last - first), float(min(a1 - a0, 2 * np.pi) * middle), depth, sigma,
        )  # fmt: skip

    def _cells(self, point: Float) -> tuple[Int, Int, Bool, Bool]:
        """Return rows and columns about the outline, and which of their cells are in it or around it."""
        wall = self.wall
        rows = wall.rows(point[:, 0].min() - _AROUND_MM, point[:, 0].max() + _AROUND_MM)
        radius = float(np.nanmedian(wall.radius_mm[rows]))
        margin = _AROUND_MM / radius
        first = int(np.floor((point[:, 1].min() - margin - wall.azimuth_rad[0]) / wall.step_rad))
        last = int(np.ceil((point[:, 1].max() + margin - wall.azimuth_rad[0]) / wall.step_rad))
        count = min(last - first + 1, len(wall.azimuth_rad))
        at_row = (point[:, 0] - wall.distance_mm[rows[0]]) / wall.step_mm
        at_column = (point[:, 1] - wall.azimuth_rad[0]) / wall.step_rad - first
        inside = cells_within(np.stack([at_column, at_row], -1), (len(rows), count))
        reach = np.array([count and _AROUND_MM / (radius * wall.step_rad), _AROUND_MM / wall.step_mm])
        size = tuple(int(2 * np.ceil(r) + 1) for r in reach)
        grown = cv2.dilate(inside.astype(np.uint8), cv2.getStructuringElement(cv2.MORPH_ELLIPSE, size))
        columns = (first + np.arange(count)) % len(wall.azimuth_rad)
        return rows, columns, inside, grown.astype(bool) & ~inside

    def _depth(self, radius: Float, sigma: Float32, inside: Bool, around: Bool) -> tuple[float, float]:
        """Return the extreme of the smoothed radius within, less the median around, and its 1 σ."""
        known = around & np.isfinite(radius)
        seen = inside & np.isfinite(radius)
        if known.sum() < _LEAST_AROUND or not seen.any():
            return float("nan"), float("nan")
        away = np.where(np.isfinite(radius), radius - float(np.median(radius[known])), 0.0)
        weight = np.isfinite(radius).astype(float)
        step = np.array([self.wall.step_mm, self.wall.step_rad * float(np.median(radius[known]))])
        cells = tuple(int(max(round(_MEAN_MM / s), 1)) for s in step[::-1])
        mean = cv2.blur(away, cells) / np.maximum(cv2.blur(weight, cells), 1e-9)
        extreme = float(mean[seen][np.argmax(np.abs(mean[seen]))])
        noise = float(np.median(sigma[seen & np.isfinite(sigma)])) / np.sqrt(cells[0] * cells[1])
        spread = robust_spread(away[known])
        return extreme, float(np.hypot(noise, spread / np.sqrt(cells[0] * cells[1])))
