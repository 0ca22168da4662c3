"""The unrolled wall as tiles: photo and error colours, rows along azimuth, columns along distance."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.model import Overlays
from pipeline.yaml_file import read_yaml

Byte = NDArray[np.uint8]
TILE_PX = 512
PHOTO = "photo"


@dataclass(frozen=True)
class FlatPicture:
    """One layer of the flat view, distance to the right, azimuth downward from −π.

    Attributes
    ----------
    bgra : (A, S, 4)
    distance_from_mm, distance_to_mm : float
        Edges of the picture, not centres of its pixels.
    """

    bgra: Byte
    distance_from_mm: float
    distance_to_mm: float

    @property
    def levels(self) -> int:
        """Number of levels; each is half the size of the one before, the last fits one tile."""
        return max(int(np.ceil(np.log2(max(self.bgra.shape[:2]) / TILE_PX))), 0) + 1

    def tile(self, level: int, column: int, row: int) -> bytes:
        """Return a tile as PNG.

        Raises
        ------
        InputError
            When there is no such tile.
        """
        size = TILE_PX << level
        if not 0 <= level < self.levels or column < 0 or row < 0:
            raise InputError("tile", f"there is no tile {level}/{column}/{row}")
        part = self.bgra[row * size : (row + 1) * size, column * size : (column + 1) * size]
        if not part.size:
            raise InputError("tile", f"there is no tile {level}/{column}/{row}")
        small = (max(part.shape[1] >> level, 1), max(part.shape[0] >> level, 1))
        shrunk = cv2.resize(part, small, interpolation=cv2.INTER_AREA) if level else part
        encoded, png = cv2.imencode(".png", shrunk, [cv2.IMWRITE_PNG_COMPRESSION, 3])
        if not encoded:
            raise InputError("tile", f"tile {level}/{column}/{row} cannot be encoded")
        return png.tobytes()


def overlay_picture(overlays: Overlays, name: str) -> FlatPicture:
    """Return an overlay's colours.

    Raises
    ------
    InputError
        When there is no such overlay.
    """
    found = {o.name: o for o in overlays.pictures}
    if name not in found:
        raise InputError("overlay", f"there is no overlay {name!r}", expected=", ".join([PHOTO, *found]))
    s = overlays.distance_mm
    half = float(s[1] - s[0]) / 2
    bgra = np.ascontiguousarray(found[name].bgra.transpose(1, 0, 2))
    return FlatPicture(bgra, float(s[0]) - half, float(s[-1]) + half)


def photo_picture(run: Path) -> FlatPicture:
    """Return the wall's photo from unrolled.png and unrolled.json.

    Raises
    ------
    InputError
        When they are missing or broken.
    """
    file = run / "unrolled.png"
    if not file.is_file():
        raise InputError(file, "is missing", hint="finish the run: boresight run")
    return _photo(run, file.stat().st_mtime_ns)


@lru_cache(maxsize=2)
def _photo(run: Path, _changed: int) -> FlatPicture:
    file = run / "unrolled.png"
    bgra = cv2.imread(str(file), cv2.IMREAD_UNCHANGED)
    if bgra is None or bgra.ndim != 3 or bgra.shape[2] != 4:
        raise InputError(file, "is not a picture with transparency")
    place = read_yaml(run / "unrolled.json")
    step = float(str(place.values["mm_per_px"]))
    start = float(str(place.values["distance_from_mm"])) - step / 2
    turned = np.ascontiguousarray(bgra.transpose(1, 0, 2)).astype(np.uint8, copy=False)
    return FlatPicture(turned, start, start + step * turned.shape[1])
