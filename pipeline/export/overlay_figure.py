"""The figure of an overlay: its colours with axes, clock hours and a colour bar.

It is drawn by Pillow: importing and drawing by matplotlib took 7 % of a run's processor time.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from pipeline.arrays import Byte
from pipeline.artefacts.model import Overlay, Overlays
from pipeline.errors import BoresightError
from pipeline.pages import notation

# mm of pipe per px, and the widest wall, px, which viewers still open.
_MM_PER_PX, _NARROWEST, _WIDEST = 0.25, 720, 12000
# px: of the wall's picture and what is around it, of the colour bar, its ends, ticks, letters.
_LEFT, _TOP, _HIGH, _RIGHT, _BELOW = 90, 48, 480, 150, 72
_BAR_ASIDE, _BAR_WIDE, _BAR_END, _TICK, _LETTERS, _TITLE = 18, 24, 24, 5, 16, 20
# px between the marks of an axis, at least.
_ALONG_APART, _BAR_APART = 90, 70
# In the folder of matplotlib; has every letter that is needed.
_FONT = "mpl-data/fonts/ttf/DejaVuSans.ttf"


def overlay_figure(overlays: Overlays, overlay: Overlay) -> Image.Image:
    """Return the figure of one overlay: distance to the right, clock hours upward, 12 in the middle."""
    distance = overlays.distance_mm
    wide = int(np.clip(round(np.ptp(distance) / _MM_PER_PX), _NARROWEST, _WIDEST))
    figure = Image.new("RGB", (_LEFT + wide + _RIGHT, _TOP + _HIGH + _BELOW), "white")
    draw = ImageDraw.Draw(figure)
    figure.paste(Image.fromarray(_wall(overlays, overlay, wide)), (_LEFT, _TOP))
    draw.rectangle((_LEFT - 1, _TOP - 1, _LEFT + wide, _TOP + _HIGH), outline="black")
    draw.text((_LEFT + wide / 2, _TOP - 10), overlay.title, "black", _font(_TITLE), "ms")
    _mark_distance(draw, overlays, wide)
    _mark_hours(figure, draw)
    _draw_bar(figure, draw, overlay, _LEFT + wide + _BAR_ASIDE)
    return figure


def _mark_distance(draw: ImageDraw.ImageDraw, overlays: Overlays, wide: int) -> None:
    distance, y = overlays.distance_mm, _TOP + _HIGH
    half = float(distance[-1] - distance[0]) / max(len(distance) - 1, 1) / 2
    low, high = float(distance[0]) - half, float(distance[-1]) + half
    for value, text in _marks(low, high, wide / _ALONG_APART):
        x = _LEFT + (value - low) / (high - low) * wide
        draw.line((x, y, x, y + _TICK), "black")
        draw.text((x, y + _TICK + 4), text, "black", _font(_LETTERS), "ma")
    draw.text((_LEFT + wide / 2, y + 36), "distance (mm)", "black", _font(_LETTERS), "ma")


def _mark_hours(figure: Image.Image, draw: ImageDraw.ImageDraw) -> None:
    for hours in range(-6, 7, 3):
        y = _TOP + _HIGH * (6 - hours) / 12
        draw.line((_LEFT - _TICK, y, _LEFT, y), "black")
        draw.text((_LEFT - _TICK - 3, y), notation.clock(float(hours % 12)), "black", _font(_LETTERS), "rm")
    _write_upward(figure, "clock position, looking forward", 8)


def _wall(overlays: Overlays, overlay: Overlay, wide: int) -> Byte:
    """Return the wall's colours (_HIGH, wide, 3) red, green, blue, each pixel that of the nearest cell."""
    rows, columns = overlay.level.shape
    clock = np.argsort((overlays.azimuth_rad + 3 * np.pi / 2) % (2 * np.pi), kind="stable")
    upward = clock[((np.arange(_HIGH) + 0.5) / _HIGH * columns).astype(int)][::-1]
    along = ((np.arange(wide) + 0.5) / wide * rows).astype(int)
    return np.ascontiguousarray(overlay.palette_bgr[overlay.level[np.ix_(along, upward)].T, ::-1])


def _draw_bar(figure: Image.Image, draw: ImageDraw.ImageDraw, overlay: Overlay, left: int) -> None:
    """Draw the colour bar, with a tip at each end beyond which values may lie."""
    low, high, signed = overlay.low_mm, overlay.high_mm, overlay.low_mm < 0
    top, bottom = _TOP + _BAR_END, _TOP + _HIGH - _BAR_END * signed
    colours, right = overlay.palette_bgr[1:, ::-1], left + _BAR_WIDE
    shade = np.linspace(len(colours) - 1, 0, bottom - top).round().astype(int)
    figure.paste(Image.fromarray(np.repeat(colours[shade][:, None], _BAR_WIDE, axis=1)), (left, top))
    outline = [(left, top), ((left + right) / 2, _TOP), (right, top)]
    draw.polygon(outline, tuple(colours[-1].tolist()))
    if signed:
        tip = [(right, bottom), ((left + right) / 2, bottom + _BAR_END), (left, bottom)]
        draw.polygon(tip, tuple(colours[0].tolist()))
        outline += tip
    else:
        outline += [(right, bottom), (left, bottom)]
    draw.line([*outline, outline[0]], "black")
    for value, text in _marks(low, high, (bottom - top) / _BAR_APART):
        y = bottom - (value - low) / (high - low) * (bottom - top)
        draw.line((right, y, right + _TICK, y), "black")
        draw.text((right + _TICK + 4, y), text, "black", _font(_LETTERS), "lm")
    beyond = f"mm  (grey: not measured; {100 * overlay.beyond:.1f} % beyond the ends)"
    _write_upward(figure, beyond, right + 72)


def _write_upward(figure: Image.Image, text: str, left: int) -> None:
    """Write a line that is read from below, beside the middle of the wall."""
    x0, y0, x1, y1 = _font(_LETTERS).getbbox(text)
    line = Image.new("L", (int(x1 - x0) + 2, int(y1 - y0) + 2))
    ImageDraw.Draw(line).text((1 - x0, 1 - y0), text, 255, _font(_LETTERS))
    upward = line.transpose(Image.Transpose.ROTATE_90)
    figure.paste("black", (left, _TOP + (_HIGH - upward.height) // 2), upward)


def _marks(low: float, high: float, most: float) -> Iterator[tuple[float, str]]:
    """Yield at most so many round values between two, one, two, two and a half or five of a unit apart."""
    unit = 10.0 ** np.floor(np.log10((high - low) / most))
    step = next(unit * times for times in (1, 2, 2.5, 5, 10) if unit * times * most >= high - low)
    decimals = next(d for d in range(12) if abs(step * 10**d - round(step * 10**d)) < step * 1e-6 * 10**d)
    for k in range(int(np.ceil(low / step - 1e-9)), int(np.floor(high / step + 1e-9)) + 1):
        yield k * step, f"{k * step:.{decimals}f}".replace("-", "−")


@cache
def _font(size: int) -> ImageFont.FreeTypeFont:
    package = find_spec("matplotlib")
    if package is None or package.origin is None:
        raise BoresightError("the package matplotlib is not installed: install boresight with what it needs")
    return ImageFont.truetype(str(Path(package.origin).parent / _FONT), size)
