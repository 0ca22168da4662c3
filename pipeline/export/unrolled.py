"""The wall's photo as a flat picture: unrolled.png and unrolled.json."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np

from pipeline.artefacts import Byte, WallTexture

_GAMMA = 2.2


def display_colours(bgra: Byte) -> Byte:
    """Return linear reflectance (..., 4) encoded for the screen (power 1 / 2.2); alpha is kept."""
    table = np.round(255 * (np.arange(256) / 255) ** (1 / _GAMMA)).astype(np.uint8)
    out = table[bgra]
    out[..., 3] = bgra[..., 3]
    return np.asarray(out)


def write_unrolled(texture: WallTexture, folder: Path) -> None:
    """Write ``unrolled.png`` (BGRA, display colours) and ``unrolled.json`` (where its pixels lie).

    Raises
    ------
    OSError
        When the picture cannot be encoded or a file cannot be written.
    """
    encoded, png = cv2.imencode(".png", display_colours(texture.bgra), [cv2.IMWRITE_PNG_COMPRESSION, 3])
    if not encoded:
        raise OSError("unrolled.png: the picture cannot be encoded")
    (folder / "unrolled.png").write_bytes(png.tobytes())
    place = {
        "distance_from_mm": texture.distance_from_mm,
        "mm_per_px": texture.mm_per_px,
        "azimuth_from_rad": texture.azimuth_from_rad,
        "rad_per_px": texture.rad_per_px,
        "encoding": "display, power 1 / 2.2",
    }
    (folder / "unrolled.json").write_text(json.dumps(place, indent=1) + "\n")
