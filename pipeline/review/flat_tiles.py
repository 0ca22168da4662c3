"""The unrolled wall as tiles: photo and error colours, rows along azimuth, columns along distance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from pipeline.arrays import Byte, Float32
from pipeline.artefacts.measured import WallTexture
from pipeline.artefacts.model import Overlay, Overlays
from pipeline.errors import InputError
from pipeline.review.run_files import RunFiles
from pipeline.review.values import Limits, Values, overlay_of, values_of

TILE_PX = 512
PHOTO = "photo"
# A shrunk pixel is the mean of this many samples each way, so that an overview need not read everything.
_SAMPLES = 4


@dataclass(frozen=True)
class FlatPicture:
    """One layer of the flat view, distance to the right, azimuth downward.

    Attributes
    ----------
    stored : (S, A) or (S, A, 4)
        Rows along distance, possibly still on disk, or values that are worked out when asked for.
    colours : callable
        Gives BGRA of a part of it.
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
        When there is none of that name, or the run does not hold it any more.
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
