"""Flat pictures of the wall: the unrolled photo, and error colours with axes and colour bars."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np

from pipeline.arrays import Byte
from pipeline.artefacts.measured import WallTexture
from pipeline.artefacts.model import Overlays
from pipeline.export.overlay_figure import overlay_figure

# Common viewers and graphics cards refuse pictures with a side of more than 16384 px.
_MOST_ROWS = 16384
# PNG level of figures: a higher one hardly reduces their size.
_FIGURE = (cv2.IMWRITE_PNG_COMPRESSION, 3)
# PNG strategy of photos, which are noisy: run lengths alone take 0.6 of level 3's time and 5 % less room.
_PHOTO = (cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_RLE)


def write_unrolled(texture: WallTexture, folder: Path) -> None:
    """Write ``unrolled.png`` (BGRA, as recorded) and ``unrolled.json`` (scale and place of its pixels).

    A picture too long for other programs is written reduced along the pipe, and at full resolution in sheets,
    listed in ``unrolled.json``: ``unrolled-001.png`` and so on.

    Raises
    ------
    OSError
        When a picture cannot be encoded or a file cannot be written.
    """
    rows = len(texture.bgra)
    step = -(-rows // _MOST_ROWS)
    _write_png(folder / "unrolled.png", _shrunk_along(texture.bgra, step), _PHOTO)
    sheets = [range(a, min(a + _MOST_ROWS, rows)) for a in range(0, rows, _MOST_ROWS)] if step > 1 else []
    names = [f"unrolled-{k:03d}.png" for k in range(1, len(sheets) + 1)]
    for name, sheet in zip(names, sheets, strict=True):
        _write_png(folder / name, texture.bgra[sheet.start : sheet.stop], _PHOTO)
    place: dict[str, object] = {
        "distance_from_mm": texture.distance_from_mm + (step - 1) / 2 * texture.mm_per_px,
        "mm_per_px": texture.mm_per_px * step,
        "azimuth_from_rad": texture.azimuth_from_rad,
        "rad_per_px": texture.rad_per_px,
        "encoding": "grey levels of the recorded frames",
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


def _write_png(path: Path, picture: Byte, options: tuple[int, int]) -> None:
    encoded, png = cv2.imencode(".png", picture, options)
    if not encoded:
        raise OSError(f"{path.name}: the picture cannot be encoded")
    path.write_bytes(png.tobytes())


def write_overlays(overlays: Overlays, folder: Path) -> None:
    """Write one picture for each overlay: distance to the right, clock hours upward, 12 in the middle.

    Raises
    ------
    OSError
        When a picture cannot be encoded or a file cannot be written.
    """
    for overlay in overlays.pictures:
        _write_png(folder / f"{overlay.name}.png", overlay_figure(overlays, overlay), _FIGURE)
