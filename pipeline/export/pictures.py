"""Flat pictures of the wall: the unrolled photo, and error colours with axes and colour bars."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np

from pipeline.arrays import Byte
from pipeline.artefacts.measured import WallTexture
from pipeline.artefacts.model import Overlay, Overlays
from pipeline.pages import notation

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Common viewers and graphics cards refuse pictures with a side of more than 16384 px.
_MOST_ROWS = 16384
# PNG level of figures: a higher one hardly reduces their size.
_COMPRESSION = 3
# PNG strategy of photos, which are noisy: run lengths alone take 0.6 of level 3's time and 5 % less room.
_PHOTO = (cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_RLE)
# Figure of an overlay: dots per inch, mm of pipe per inch, the longest figure (12000 px at 120 dpi, which
# viewers still open).
_DPI, _MM_PER_INCH, _LONGEST_INCH = 120, 30.0, 100.0


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
    for overlay in overlays.pictures:
        figure = overlay_figure(overlays, overlay)
        figure.savefig(
            folder / f"{overlay.name}.png", dpi=_DPI, metadata={"Software": "boresight"},
            pil_kwargs={"compress_level": _COMPRESSION},
        )  # fmt: skip


def overlay_figure(overlays: Overlays, overlay: Overlay) -> Figure:
    """Return the figure of one overlay, without any global state of matplotlib."""
    # matplotlib is slow to import, so it is imported only when the first figure is drawn.
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    distance = overlays.distance_mm
    width = float(np.clip(np.ptp(distance) / _MM_PER_INCH, 6, _LONGEST_INCH))
    figure = Figure(figsize=(width + 2, 5))
    FigureCanvasAgg(figure)
    # Positions are fixed: a layout engine draws every figure three times to find them.
    axes = figure.add_axes((0.75 / (width + 2), 0.6 / 5, width / (width + 2), 4.0 / 5))
    half = (distance[-1] - distance[0]) / max(len(distance) - 1, 1) / 2
    # No finer than the picture's own dots.
    every = max(len(distance) // int(_LONGEST_INCH * _DPI), 1)
    rgb = overlay.palette_bgr[_twelve_in_the_middle(overlays, overlay.level[::every]), ::-1]
    axes.imshow(
        rgb.transpose(1, 0, 2),
        extent=(distance[0] - half, distance[-1] + half, -6, 6),
        origin="lower",
        aspect="auto",
        interpolation="nearest",
    )
    hours = np.arange(-6, 7, 3)
    axes.set_yticks(hours, [notation.clock(float(h) % 12) for h in hours])
    axes.set_xlabel("distance (mm)")
    axes.set_ylabel("clock position, looking forward")
    axes.set_title(overlay.title)
    _add_colour_bar(figure, overlay)
    return figure


def _twelve_in_the_middle(overlays: Overlays, level: Byte) -> Byte:
    """Return levels (S, A) with columns from 6 o'clock over 12 (azimuth −90°) to 6 o'clock."""
    clock = (overlays.azimuth_rad + np.pi / 2 + np.pi) % (2 * np.pi)
    return np.asarray(level[:, np.argsort(clock, kind="stable")])


def _add_colour_bar(figure: Figure, overlay: Overlay) -> None:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, Normalize

    colours = ListedColormap(overlay.palette_bgr[1:, ::-1] / 255.0)
    scale = ScalarMappable(Normalize(overlay.low_mm, overlay.high_mm), colours)
    left, bottom, wide, high = figure.axes[0].get_position().bounds
    inch = 1 / figure.get_figwidth()
    beside = figure.add_axes((left + wide + 0.15 * inch, bottom, 0.2 * inch, high))
    bar = figure.colorbar(scale, cax=beside, extend="both" if overlay.low_mm < 0 else "max")
    bar.set_label(f"mm  (grey: not measured; {100 * overlay.beyond:.1f} % beyond the ends)")
