"""The unrolled wall as tiles: photo, or values coloured between limits; rows azimuth, columns distance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import cv2
import numpy as np

from pipeline.arrays import Byte, Float, Float32
from pipeline.artefacts.measured import Wall, WallTexture
from pipeline.artefacts.model import Overlay, Overlays
from pipeline.errors import InputError
from pipeline.review.run_files import RunFiles

WALL_LOSS = "wall_loss"
PHOTO = "photo"
TILE_PX = 512
# A shrunk pixel is the mean of this many samples each way, so that an overview need not read everything.
_SAMPLES = 4
# The array of the radius map that each layer shows.
_STORED = {
    "deviation": "radius_mm", WALL_LOSS: "radius_mm", "deviation_nominal": "radius_mm",
    "uncertainty": "sigma_mm", "misalignment": "misalignment_mm",
}  # fmt: skip
_LEVELS = 254
# Rows processed at a time, to limit memory.
_ROWS = 4096


@dataclass(frozen=True)
class Values:
    """A quantity of every cell of the wall, mm, computed on demand.

    Attributes
    ----------
    cells : (S, A)
    less : (A,)
        What is subtracted from every row, mm.
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
    """Return the values of a layer.

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
    """Return the overlay whose colours a layer uses; wall loss uses those of quantities from 0 up."""
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


@dataclass(frozen=True)
class FlatPicture:
    """One layer of the flat view, distance to the right, azimuth downward.

    Attributes
    ----------
    stored : (S, A) or (S, A, 4)
        Rows along distance, possibly still on disk, or values that are computed on demand.
    colours : callable
        Returns BGRA of a part of it.
    distance_from_mm, distance_to_mm, azimuth_from_rad : float
        Edges of the picture, not centres of its pixels; it covers the whole turn.
    """

    stored: Byte | Values
    colours: Callable[[Any], Byte]
    distance_from_mm: float
    distance_to_mm: float
    azimuth_from_rad: float

    @property
    def width(self) -> int:
        """Pixels along the pipe."""
        return len(self.stored)

    @property
    def height(self) -> int:
        """Pixels around it."""
        return int(self.stored.shape[1])

    @property
    def levels(self) -> int:
        """Number of levels; each is half the size of the one before, the last fits one tile."""
        return max(int(np.ceil(np.log2(max(self.width, self.height) / TILE_PX))), 0) + 1

    def columns(self, first: int, last: int) -> Byte:
        """Return a stretch (A, last - first, 4) in full size."""
        return self._bgra(self.stored[first:last])

    def tile(self, level: int, column: int, row: int) -> bytes:
        """Return a tile as PNG.

        Raises
        ------
        InputError
            When there is no such tile.
        """
        if not 0 <= level < self.levels or column < 0 or row < 0:
            raise InputError("tile", f"there is no tile {level}/{column}/{row}")
        size, step = TILE_PX << level, max((1 << level) // _SAMPLES, 1)
        across, down = (slice(k * size, (k + 1) * size) for k in (column, row))
        part = self.stored[across, down]
        if not part.size:
            raise InputError("tile", f"there is no tile {level}/{column}/{row}")
        small = tuple(max(length >> level, 1) for length in part.shape[:2])
        bgra = self._bgra(part[::step, ::step])
        shrunk = cv2.resize(bgra, small, interpolation=cv2.INTER_AREA) if level else bgra
        encoded, png = cv2.imencode(".png", shrunk, [cv2.IMWRITE_PNG_COMPRESSION, 3])
        if not encoded:
            raise InputError("tile", f"tile {level}/{column}/{row} cannot be encoded")
        return png.tobytes()

    def _bgra(self, part: Byte | Float32) -> Byte:
        return np.ascontiguousarray(self.colours(np.asarray(part)).transpose(1, 0, 2))


def picture_of(files: RunFiles, layer: str, limits: Limits | None = None) -> FlatPicture:
    """Return a layer of the flat view: the photo, or an overlay by its name.

    Without limits an overlay is coloured as in the run's own pictures.

    Raises
    ------
    InputError
        When there is none of that name, or the run no longer holds it.
    """
    if layer == PHOTO:
        return photo_picture(files.artefact(WallTexture))
    overlays = files.artefact(Overlays)
    if limits is not None:
        return value_picture(overlays, overlay_of(overlays, layer), values_of(files, layer), limits)
    found = {o.name: o for o in overlays.pictures}
    if layer not in found:
        raise InputError("layer", f"there is no {layer[:40]!r}", expected=", ".join([PHOTO, *found]))
    return overlay_picture(overlays, found[layer])


def layers_of(files: RunFiles) -> tuple[str, ...]:
    """Return the names of all layers."""
    return (PHOTO, *(o.name for o in files.artefact(Overlays).pictures))


def overlay_picture(overlays: Overlays, overlay: Overlay) -> FlatPicture:
    """Return an overlay's colours, clear where nothing was measured."""
    return _on_the_map(overlays, overlay.level, _palette(overlay).__getitem__)


def value_picture(overlays: Overlays, overlay: Overlay, values: Values, limits: Limits) -> FlatPicture:
    """Return values in an overlay's colours between limits, clear where nothing was measured."""
    palette = _palette(overlay)
    return _on_the_map(overlays, values, lambda part: palette[limits.levels(part)])


def _palette(overlay: Overlay) -> Byte:
    clear = np.append([0], np.full(255, 255)).astype(np.uint8)
    return np.column_stack([overlay.palette_bgr, clear])


def _on_the_map(overlays: Overlays, stored: Byte | Values, colours: Callable[[Any], Byte]) -> FlatPicture:
    s, psi = overlays.distance_mm, overlays.azimuth_rad
    half_mm, half_rad = float(s[1] - s[0]) / 2, float(psi[1] - psi[0]) / 2
    return FlatPicture(
        stored, colours, float(s[0]) - half_mm, float(s[-1]) + half_mm, float(psi[0]) - half_rad
    )


def photo_picture(texture: WallTexture) -> FlatPicture:
    """Return the wall's photo as it was recorded."""
    start = texture.distance_from_mm - texture.mm_per_px / 2
    end = start + texture.mm_per_px * len(texture.bgra)
    top = texture.azimuth_from_rad - texture.rad_per_px / 2
    return FlatPicture(texture.bgra, np.asarray, start, end, top)
