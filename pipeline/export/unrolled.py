"""The wall's photo as a flat picture: unrolled.png and unrolled.json."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np

from pipeline.arrays import Byte
from pipeline.artefacts.measured import WallTexture

_GAMMA = 2.2
_MOST_ROWS = 16384


def display_colours(bgra: Byte) -> Byte:
    """Return linear reflectance (..., 4) encoded for the screen (power 1 / 2.2); alpha is kept."""
    table = np.round(255 * (np.arange(256) / 255) ** (1 / _GAMMA)).astype(np.uint8)
    out = table[bgra]
    out[..., 3] = bgra[..., 3]
    return np.asarray(out)


def write_unrolled(texture: WallTexture, folder: Path) -> None:
    """Write ``unrolled.png`` (BGRA, display colours) and ``unrolled.json`` (where its pixels lie).

    A picture too long for other programs is written shrunk along the pipe, and in full in sheets, listed in
    ``unrolled.json``: ``unrolled-001.png`` and so on.

    Raises
    ------
    OSError
        When a picture cannot be encoded or a file cannot be written.
    """
    rows = len(texture.bgra)
    step = -(-rows // _MOST_ROWS)
    _write_png(folder / "unrolled.png", _shrunk_along(texture.bgra, step))
    sheets = [range(a, min(a + _MOST_ROWS, rows)) for a in range(0, rows, _MOST_ROWS)] if step > 1 else []
    names = [f"unrolled-{k:03d}.png" for k in range(1, len(sheets) + 1)]
    for name, sheet in zip(names, sheets, strict=True):
        _write_png(folder / name, texture.bgra[sheet.start : sheet.stop])
    place: dict[str, object] = {
        "distance_from_mm": texture.distance_from_mm + (step - 1) / 2 * texture.mm_per_px,
        "mm_per_px": texture.mm_per_px * step,
        "azimuth_from_rad": texture.azimuth_from_rad,
        "rad_per_px": texture.rad_per_px,
        "encoding": "display, power 1 / 2.2",
    }
    if sheets:
        place["sheets"] = [
            {
                "file": name,
                "distance_from_mm": texture.distance_from_mm + sheet.start * texture.mm_per_px,
                "mm_per_px": texture.mm_per_px,
            }
            for name, sheet in zip(names, sheets, strict=True)
        ]
    (folder / "unrolled.json").write_text(json.dumps(place, indent=1) + "\n")


def _shrunk_along(bgra: Byte, step: int) -> Byte:
    """Return a picture with the mean of every ``step`` rows; transparent where most of them are."""
    if step == 1:
        return bgra
    out = np.zeros((-(-len(bgra) // step), *bgra.shape[1:]), np.uint8)
    for k in range(len(out)):
        block = bgra[k * step : (k + 1) * step].astype(np.float32)
        seen = block[..., 3:] > 0
        colour = (block[..., :3] * seen).sum(0) / np.maximum(seen.sum(0), 1)
        alpha = np.where(2 * seen.sum(0) > len(block), 255, 0)
        out[k] = np.concatenate([np.rint(colour), alpha], -1)
    return out


def _write_png(path: Path, bgra: Byte) -> None:
    encoded, png = cv2.imencode(".png", display_colours(bgra), [cv2.IMWRITE_PNG_COMPRESSION, 3])
    if not encoded:
        raise OSError(f"{path.name}: the picture cannot be encoded")
    path.write_bytes(png.tobytes())
