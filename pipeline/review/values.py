"""The wall's values as coloured pictures between limits that are asked for."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from pipeline.arrays import Byte, Float, Float32
from pipeline.artefacts.measured import Wall
from pipeline.artefacts.model import Overlay, Overlays
from pipeline.errors import InputError
from pipeline.review.run_files import RunFiles

WALL_LOSS = "wall_loss"
# Of what in the radius map a layer is made.
_STORED = {
    "deviation": "radius_mm", WALL_LOSS: "radius_mm", "deviation_nominal": "radius_mm",
    "uncertainty": "sigma_mm", "misalignment": "misalignment_mm",
}  # fmt: skip
_LEVELS = 254
# Rows looked through at a time, for memory's sake.
_ROWS = 4096


@dataclass(frozen=True)
class Values:
    """A quantity of every cell of the wall, mm, worked out where it is asked for.

    Attributes
    ----------
    cells : (S, A)
    less : (A,)
        What is taken from every row.
    """

    cells: Float32
    less: Float

    def __len__(self) -> int:
        return len(self.cells)

    @property
    def shape(self) -> tuple[int, ...]:
        """Rows along distance, columns along azimuth."""
        return self.cells.shape

    def __getitem__(self, part: Any) -> Float32:
        columns = part[1] if isinstance(part, tuple) else slice(None)
        return np.asarray(self.cells[part] - self.less[columns].astype(np.float32), np.float32)

    def levels(self, limits: Limits) -> Byte:
        """Return the level (S, A) of every cell between limits."""
        return np.concatenate([limits.levels(self[a : a + _ROWS]) for a in range(0, len(self), _ROWS)])


@dataclass(frozen=True)
class Limits:
    """Values, mm, that get the first and the last colour."""

    low_mm: float
    high_mm: float

    def levels(self, value_mm: Float32) -> Byte:
        """Return the level of each value: 0 where it was not measured, else 1 to 255."""
        known = np.isfinite(value_mm)
        share = (np.where(known, value_mm, 0.0) - self.low_mm) / (self.high_mm - self.low_mm)
        return np.where(known, 1 + np.rint(np.clip(share, 0, 1) * _LEVELS), 0).astype(np.uint8)


def values_of(files: RunFiles, layer: str) -> Values:
    """Return what a layer shows.

    Raises
    ------
    InputError
        When there is none of that name.
    """
    if layer not in _STORED:
        raise InputError("layer", f"there is no {layer[:40]!r} between limits", expected=", ".join(_STORED))
    overlays = files.artefact(Overlays)
    less: dict[str, Float | float] = {
        "deviation": overlays.reference_radius_mm, WALL_LOSS: overlays.reference_radius_mm,
        "deviation_nominal": overlays.nominal_radius_mm,
    }  # fmt: skip
    taken = np.broadcast_to(less.get(layer, 0.0), overlays.azimuth_rad.shape)
    return Values(getattr(files.artefact(Wall).radius_map, _STORED[layer]), taken)


def overlay_of(overlays: Overlays, layer: str) -> Overlay:
    """Return the overlay whose colours a layer wears: wall loss those of what only grows."""
    return overlays.uncertainty if layer == WALL_LOSS else overlays.of_variant(layer)


def full_range_mm(files: RunFiles, layer: str) -> tuple[float, float]:
    """Return the smallest and the largest value of a layer; 0 where nothing was measured."""
    low, high = _column_ends(files, files.version, _STORED[layer])
    known, less = np.isfinite(low), values_of(files, layer).less
    if not known.any():
        return 0.0, 0.0
    return float((low - less)[known].min()), float((high - less)[known].max())


@lru_cache(maxsize=8)
def _column_ends(files: RunFiles, _version: str, stored: str) -> tuple[Float32, Float32]:
    """Return the smallest and the largest value (A,) of each azimuth; several layers are made of one."""
    cells: Float32 = getattr(files.artefact(Wall).radius_map, stored)
    parts = [cells[a : a + _ROWS] for a in range(0, len(cells), _ROWS)]
    low = np.fmin.reduce([np.fmin.reduce(p, axis=0) for p in parts], axis=0)
    return low, np.fmax.reduce([np.fmax.reduce(p, axis=0) for p in parts], axis=0)
