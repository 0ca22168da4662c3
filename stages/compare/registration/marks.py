"""A run's wall as a picture of marks, by which another run of the same pipe is recognised."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import cv2
import numpy as np

from pipeline.adjustment.robust import robust_spread
from pipeline.arrays import Float, Float32
from pipeline.artefacts.measured import WallTexture
from pipeline.artefacts.wall_map import WallMap

COLUMNS = 640
# Cells are about square on the wall, whatever the bore.
CELLS_PER_RADIUS = 100
# Structures broader than this share of the radius are the pipe's shape, the lighting or the instrument.
_BROAD = 0.4
_BLUR_CELLS = 0.8
_CLIP = 3.0


@dataclass(frozen=True)
class Surface:
    """A wall and, where there is one, its photo; marks are made of both by stretches.

    Attributes
    ----------
    wall : WallMap
    texture : WallTexture or None
    """

    wall: WallMap
    texture: WallTexture | None

    @cached_property
    def radius_mm(self) -> float:
        """Median radius."""
        return float(np.nanmedian(self.wall.radius_mm[:: max(len(self.wall.distance_mm) // 500, 1)]))

    @property
    def from_mm(self) -> float:
        """Distance of the first row of marks."""
        return float(self.wall.distance_mm[0])

    @property
    def length_mm(self) -> float:
        """From the first to the last row of the wall."""
        return float(self.wall.distance_mm[-1] - self.wall.distance_mm[0])

    def marks(self, from_mm: float, rows: int, cell_mm: float) -> Float32:
        """Return the contrast (rows, `COLUMNS`) to the surroundings, 0 where nothing was seen.

        Relief and grey have equal weight, each divided by its spread. Features all round are left out: welds
        are matched by their own positions, and every pipe has them.
        """
        margin = round(_BROAD * self.radius_mm / cell_mm)
        s = np.asarray(from_mm + cell_mm * np.arange(-margin, rows + margin), float)
        parts = [_standing_out(part, margin) for part in self._layers(s)]
        return np.asarray(np.sum(parts, axis=0)[margin : margin + rows], np.float32)

    def _layers(self, s: Float) -> list[Float32]:
        radius = sampled(self.wall.radius_mm, self.from_mm, self.wall.step_mm, s, COLUMNS)
        if self.texture is None:
            return [radius]
        return [radius, _grey(self.texture, s)]


def sampled(values: Float32, from_mm: float, step_mm: float, s: Float, columns: int) -> Float32:
    """Return a wall's values (S, A), first column −π, at distances (R,) and ``columns`` azimuths from −π.

    Linear between cells; NaN beyond the ends and next to cells that were not seen.
    """
    first = int(np.clip(np.floor((s[0] - from_mm) / step_mm) - 1, 0, len(values) - 1))
    last = int(np.clip(np.ceil((s[-1] - from_mm) / step_mm) + 2, first + 1, len(values)))
    part = np.asarray(values[first:last], np.float32)
    wide = np.concatenate([part, part[:, :2]], 1)
    row = (s - from_mm) / step_mm - first
    column = np.arange(columns) * values.shape[1] / columns
    return _remapped(wide, row, column)


def _remapped(image: Float32, row: Float, column: Float) -> Float32:
    x, y = np.meshgrid(column.astype(np.float32), row.astype(np.float32))
    return np.asarray(
        cv2.remap(
            image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=(float("nan"),) * 4
        ),
        np.float32,
    )


def _grey(texture: WallTexture, s: Float) -> Float32:
    """Return the photo's grey (R, `COLUMNS`), averaged over cells of ``s``; NaN where not textured."""
    step, count = texture.mm_per_px, texture.bgra.shape[1]
    half = (s[1] - s[0]) / 2
    first = max(int(np.floor((s[0] - half - texture.distance_from_mm) / step)), 0)
    last = int(np.ceil((s[-1] + half - texture.distance_from_mm) / step)) + 1
    part = np.asarray(texture.bgra[first : max(last, 0)])
    if len(part) < 2:
        return np.full((len(s), COLUMNS), np.nan, np.float32)
    seen = (part[..., 3] > 0).astype(np.float32)
    cells = (max(round(count / COLUMNS), 1), max(round(2 * half / step), 1))
    weight = _around(seen, cells)
    grey = _around(part[..., :3].mean(-1, dtype=np.float32) * seen, cells)
    mean = np.where(weight > 0.5, grey / np.maximum(weight, 1e-6), np.nan)
    wide = np.concatenate([mean, mean[:, :2]], 1).astype(np.float32)
    turned = (-np.pi - texture.azimuth_from_rad) / texture.rad_per_px
    column = np.mod(turned + np.arange(COLUMNS) * count / COLUMNS, count)
    return _remapped(wide, (s - texture.distance_from_mm) / step - first, column)


def _standing_out(values: Float32, reach: int) -> Float32:
    """Return values minus their surroundings and their rings' means, over their spread; 0 where unknown."""
    known = np.isfinite(values).astype(np.float32)
    if not known.any():
        return np.zeros_like(values)
    filled = np.nan_to_num(values)
    size = (2 * reach + 1, 2 * reach + 1)
    away = np.asarray(
        (filled - _around(filled, size) / np.maximum(_around(known, size), 1e-6)) * known, np.float32
    )
    # the means of single rings, too: a probe that shakes moves whole rings
    along_ring = (size[0], 1)
    away -= _around(away, along_ring) / np.maximum(_around(known, along_ring), 1e-6) * known
    smooth = _periodic(away, lambda a: cv2.GaussianBlur(a, (0, 0), _BLUR_CELLS), 8)
    spread = robust_spread(smooth[known > 0])
    return np.asarray(np.clip(smooth / max(spread, 1e-9), -_CLIP, _CLIP) * known, np.float32)


def _around(values: Float32, size: tuple[int, int]) -> Float32:
    """Return means over ``size`` (columns, rows)."""
    return _periodic(values, lambda a: cv2.blur(a, size), size[0])


def _periodic(values: Float32, work: Callable[[Float32], Any], margin: int) -> Float32:
    """Return ``work`` applied to an image whose columns are periodic."""
    margin = min(margin, values.shape[1])
    wide = np.concatenate([values[:, -margin:], values, values[:, :margin]], 1)
    return np.asarray(work(wide)[:, margin:-margin], np.float32)
