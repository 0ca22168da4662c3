"""Flat pictures of the wall: the unrolled photo, and error colours with axes and colour bars."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from PIL import Image, ImageDraw, ImageFont
from PIL.PngImagePlugin import PngInfo

from pipeline.arrays import Byte, Int
from pipeline.artefacts.measured import WallTexture
from pipeline.artefacts.model import Overlay, Overlays
from pipeline.export.report.page import round_ticks
from pipeline.pages import notation

# Common viewers and graphics cards refuse pictures with a side of more than 16384 px.
_MOST_ROWS = 16384
# Of overlays: of PNG's 9 levels the one above which they hardly shrink any more.
_COMPRESSION = 3
# Of photos, which are noisy: looking for runs of one byte alone takes .6 of level 3's time and 5 % less room.
_PHOTO = (cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_RLE)
# Of an overlay's picture, px: scale and width of the wall (viewers still open 12000 px), its height.
_PX_PER_MM, _LEAST_PX, _MOST_PX, _HIGH = 4, 720, 12000, 480
# Room about the wall; between it and the colour bar; the bar's width; length of a tick; size of the texts.
_LEFT, _RIGHT, _TOP, _BOTTOM, _GAP, _BAR, _TICK, _TEXT_PX, _TITLE_PX = 90, 150, 48, 72, 18, 24, 5, 16, 20


def write_unrolled(texture: WallTexture, folder: Path) -> None:
    """Write ``unrolled.png`` (BGRA, as recorded) and ``unrolled.json`` (where its pixels lie).

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


def _write_png(path: Path, bgra: Byte) -> None:
    encoded, png = cv2.imencode(".png", bgra, _PHOTO)
    if not encoded:
        raise OSError(f"{path.name}: the picture cannot be encoded")
    path.write_bytes(png.tobytes())


def write_overlays(overlays: Overlays, folder: Path) -> None:
    """Write one picture for each overlay: distance to the right, clock hours upward, 12 in the middle.

    Raises
    ------
    OSError
        When a file cannot be written.
    """
    made_by = PngInfo()
    made_by.add_text("Software", "boresight")
    for overlay in overlays.pictures:
        picture = overlay_picture(overlays, overlay)
        picture.save(folder / f"{overlay.name}.png", compress_level=_COMPRESSION, pnginfo=made_by)


def overlay_picture(overlays: Overlays, overlay: Overlay) -> Image.Image:
    """Return the picture of one overlay with its axes and its colour bar.

    Drawn by Pillow: a figure of matplotlib took four times as long.
    """
    distance = overlays.distance_mm
    width = int(np.clip(np.ptp(distance) * _PX_PER_MM, _LEAST_PX, _MOST_PX))
    half = np.ptp(distance) / max(len(distance) - 1, 1) / 2 or 0.5
    ends = float(distance[0] - half), float(distance[-1] + half)
    page = Image.new("RGB", (_LEFT + width + _RIGHT, _TOP + _HIGH + _BOTTOM), "white")
    along = np.arange(width) * len(distance) // width
    around = _from_six_to_six(overlays)[np.arange(_HIGH)[::-1] * len(overlays.azimuth_rad) // _HIGH]
    page.paste(_coloured(overlay, overlay.level[np.ix_(along, around)].T), (_LEFT, _TOP))
    draw = ImageDraw.Draw(page)
    draw.rectangle((_LEFT, _TOP, _LEFT + width - 1, _TOP + _HIGH - 1), outline="black")
    draw.text((_LEFT + width / 2, _TOP / 2), overlay.title, "black", _font(_TITLE_PX), "mm")
    _draw_axes(page, ends, width)
    _draw_colour_bar(page, overlay, _LEFT + width + _GAP)
    return page


def _from_six_to_six(overlays: Overlays) -> Int:
    """Return the order of columns (A,) from 6 o'clock over 12 (azimuth −90°) to 6 o'clock."""
    clock = (overlays.azimuth_rad + np.pi / 2 + np.pi) % (2 * np.pi)
    return np.argsort(clock, kind="stable")


def _coloured(overlay: Overlay, level: Byte) -> Image.Image:
    return Image.fromarray(np.ascontiguousarray(overlay.palette_bgr[level, ::-1]))


def _draw_axes(page: Image.Image, ends: tuple[float, float], width: int) -> None:
    """Draw distances, mm, between two ends below the wall, and clock hours beside it."""
    draw, low = ImageDraw.Draw(page), _TOP + _HIGH
    for value in round_ticks(*ends, max(width // 100, 2)):
        x = _LEFT + width * (value - ends[0]) / (ends[1] - ends[0])
        draw.line((x, low, x, low + _TICK), "black")
        draw.text((x, low + 2 * _TICK), f"{value:g}", "black", _font(), "mt")
    for hours in np.arange(-6, 7, 3):
        y = _TOP + (_HIGH - 1) * (6 - hours) / 12
        draw.line((_LEFT - _TICK, y, _LEFT, y), "black")
        draw.text((_LEFT - 2 * _TICK, y), notation.clock(float(hours) % 12), "black", _font(), "rm")
    draw.text((_LEFT + width / 2, page.height - 2 * _TICK), "distance (mm)", "black", _font(), "ms")
    _draw_upward(page, "clock position, looking forward", 2 * _TICK)


def _draw_colour_bar(page: Image.Image, overlay: Overlay, x: int) -> None:
    """Draw the colours of an overlay, with arrows at the ends beyond which values lie."""
    draw, low, high = ImageDraw.Draw(page), overlay.low_mm, overlay.high_mm
    last, top, bottom = x + _BAR, _TOP + _BAR, _TOP + _HIGH - (_BAR if low < 0 else 0)
    steps = np.arange(bottom - top)[::-1, None] * 255 // (bottom - top)
    page.paste(_coloured(overlay, np.broadcast_to(1 + steps, (len(steps), _BAR))), (x, top))
    first, final = (tuple(overlay.palette_bgr[k, ::-1].tolist()) for k in (1, 255))
    draw.polygon(((x, top), (x + _BAR / 2, _TOP), (last, top)), final, "black")
    if low < 0:
        draw.polygon(((x, bottom), (x + _BAR / 2, bottom + _BAR), (last, bottom)), first, "black")
    draw.rectangle((x, top, last, bottom), outline="black")
    for value in round_ticks(low, high, 5):
        y = bottom - (bottom - top) * (value - low) / (high - low)
        draw.line((last, y, last + _TICK, y), "black")
        draw.text((last + 2 * _TICK, y), f"{value:g}".replace("-", "−"), "black", _font(), "lm")
    beyond = f"mm  (grey: not measured; {100 * overlay.beyond:.1f} % beyond the ends)"
    _draw_upward(page, beyond, page.width - _TEXT_PX - 2 * _TICK)


def _draw_upward(page: Image.Image, text: str, x: int) -> None:
    """Draw a text that reads upward, beside the middle of the wall."""
    across = Image.new("L", (_HIGH, 2 * _TEXT_PX))
    ImageDraw.Draw(across).text((_HIGH / 2, _TEXT_PX / 2), text, 255, _font(), "mm")
    upward = across.transpose(Image.Transpose.ROTATE_90)
    page.paste("black", (x, _TOP), upward)


@cache
def _font(px: int = _TEXT_PX) -> ImageFont.FreeTypeFont:
    # matplotlib, which brings the font, is slow to import.
    from matplotlib import get_data_path

    return ImageFont.truetype(Path(get_data_path(), "fonts", "ttf", "DejaVuSans.ttf"), px)
