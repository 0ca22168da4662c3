"""The figure of an overlay: the wall laid flat in error colours, with axes and a colour bar.

OpenCV draws it. matplotlib takes as long to load as four such figures take in all, and longer to draw them.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from pipeline.arrays import Byte
from pipeline.artefacts.model import Overlay, Overlays
from pipeline.pages import notation

# mm of pipe to 120 px, and the widest wall, px, which viewers still open.
_MM, _PX, _NARROWEST, _WIDEST = 30.0, 120, 720, 12000
# Margins and height of the wall, px.
_LEFT, _RIGHT, _TOP, _HIGH, _BOTTOM = 90, 150, 48, 480, 72
# Colour bar: distance from the wall, width, height of the tip for values beyond an end, px.
_APART, _BAR, _TIP = 18, 24, 22
# Heights of text, its weight (400 is regular), length of ticks, px.
_TITLE, _TEXT, _WEIGHT, _TICK = 21, 17, 400, 5
_INK, _PAPER = (0, 0, 0), 255
_PX_PER_MARK = 80
"""Least distance of the marks of an axis: as wide as the longest number beside it."""


@dataclass(frozen=True)
class _Sheet:
    """A picture (H, W, 3) to draw on; places are x and y, px."""

    picture: Byte
    font: cv2.FontFace

    @staticmethod
    def of(width: int, height: int) -> _Sheet:
        return _Sheet(np.full((height, width, 3), _PAPER, np.uint8), cv2.FontFace("sans"))

    def line(self, x: int, y: int, to_x: int, to_y: int) -> None:
        cv2.line(self.picture, (x, y), (to_x, to_y), _INK)

    def text(self, words: str, x: float, y: float, size: int = _TEXT, align: float = 0.5) -> None:
        """Write words on the line ``y``; the share ``align`` of them lies left of ``x``."""
        at = (round(x - align * self._length(words, size)), round(y))
        cv2.putText(self.picture, words, at, _INK, self.font, size, _WEIGHT)

    def upward(self, words: str, x: int, middle: int) -> None:
        """Write words from below to above; ``x`` is their right edge."""
        long, high = self._length(words, _TEXT) + 4, _TEXT + 6
        strip = _Sheet(np.full((high, long, 3), _PAPER, np.uint8), self.font)
        strip.text(words, 2, _TEXT, align=0)
        top = max(middle - long // 2, 0)
        turned = cv2.rotate(strip.picture, cv2.ROTATE_90_COUNTERCLOCKWISE)
        room = self.picture[top : top + long, x - high : x]
        room[:] = turned[: len(room)]

    def _length(self, words: str, size: int) -> int:
        return int(cv2.getTextSize((1, 1), words, (0, 0), self.font, size, _WEIGHT)[2])


def overlay_figure(overlays: Overlays, overlay: Overlay) -> Byte:
    """Return the figure (H, W, 3), BGR: distance to the right, clock upward, 12 in the middle."""
    distance = overlays.distance_mm
    width = int(np.clip(np.ptp(distance) / _MM * _PX, _NARROWEST, _WIDEST))
    sheet = _Sheet.of(_LEFT + width + _RIGHT, _TOP + _HIGH + _BOTTOM)
    wall = sheet.picture[_TOP : _TOP + _HIGH, _LEFT : _LEFT + width]
    # No finer than the picture's own dots.
    every = max(len(distance) // _WIDEST, 1)
    flat = overlay.palette_bgr[_twelve_in_the_middle(overlays, overlay.level[::every]).T[::-1]]
    cv2.resize(flat, (width, _HIGH), wall, interpolation=cv2.INTER_NEAREST)
    cv2.rectangle(sheet.picture, (_LEFT, _TOP), (_LEFT + width - 1, _TOP + _HIGH - 1), _INK)
    half = float(distance[-1] - distance[0]) / max(len(distance) - 1, 1) / 2
    _add_axes(sheet, width, float(distance[0]) - half, float(distance[-1]) + half)
    sheet.text(overlay.title, _LEFT + width / 2, _TOP - 14, _TITLE)
    _add_colour_bar(sheet, overlay, _LEFT + width + _APART)
    return sheet.picture


def _twelve_in_the_middle(overlays: Overlays, level: Byte) -> Byte:
    """Return levels (S, A) with columns from 6 o'clock over 12 (azimuth −90°) to 6 o'clock."""
    clock = (overlays.azimuth_rad + np.pi / 2 + np.pi) % (2 * np.pi)
    return np.asarray(level[:, np.argsort(clock, kind="stable")])


def _add_axes(sheet: _Sheet, width: int, first_mm: float, last_mm: float) -> None:
    bottom = _TOP + _HIGH
    for value in _marks(first_mm, last_mm, max(width // _PX_PER_MARK, 2)):
        x = _LEFT + round((value - first_mm) / (last_mm - first_mm) * (width - 1))
        sheet.line(x, bottom, x, bottom + _TICK)
        sheet.text(_number(value), x, bottom + _TICK + _TEXT + 2)
    sheet.text("distance (mm)", _LEFT + width / 2, bottom + _TICK + 2 * _TEXT + 12)
    for hours in (-6, -3, 0, 3, 6):
        y = _TOP + round((6 - hours) / 12 * (_HIGH - 1))
        sheet.line(_LEFT - _TICK, y, _LEFT, y)
        sheet.text(notation.clock(hours % 12), _LEFT - _TICK - 3, y + _TEXT // 3, align=1)
    sheet.upward("clock position, looking forward", _TEXT + 8, _TOP + _HIGH // 2)


def _add_colour_bar(sheet: _Sheet, overlay: Overlay, left: int) -> None:
    """Draw the colours, with a tip at each end beyond which values may lie."""
    low_tip = _TIP if overlay.low_mm < 0 else 0
    top, bottom, right = _TOP + _TIP, _TOP + _HIGH - 1 - low_tip, left + _BAR
    colours = overlay.palette_bgr[:0:-1, None]
    sheet.picture[top:bottom, left:right] = cv2.resize(
        colours, (1, bottom - top), interpolation=cv2.INTER_NEAREST
    )
    ends = [(top, _TOP, overlay.palette_bgr[-1]), (bottom, bottom + low_tip, overlay.palette_bgr[1])]
    for base, tip, colour in ends:
        corners = np.array([(left, base), ((left + right) // 2, tip), (right, base)], np.int32)
        cv2.fillConvexPoly(sheet.picture, corners, colour.tolist(), cv2.LINE_AA)
        cv2.polylines(sheet.picture, [corners], False, _INK, 1, cv2.LINE_AA)
    for x in (left, right):
        sheet.line(x, top, x, bottom)
    for value in _marks(overlay.low_mm, overlay.high_mm, 6):
        share = (value - overlay.low_mm) / (overlay.high_mm - overlay.low_mm)
        y = bottom - round(share * (bottom - top))
        sheet.line(right, y, right + _TICK, y)
        sheet.text(_number(value), right + _TICK + 4, y + _TEXT // 3, align=0)
    legend = f"mm  (grey: not measured; {100 * overlay.beyond:.1f} % beyond the ends)"
    sheet.upward(legend, left - _APART + _RIGHT - 6, _TOP + _HIGH // 2)


def _marks(low: float, high: float, most: int) -> list[float]:
    """Return round numbers between two ends, ``most`` at most: multiples of 1, 2 or 5 times a power of 10."""
    least = (high - low) / most
    power = 10.0 ** np.floor(np.log10(least))
    step = power * next(times for times in (1, 2, 5, 10) if times * power >= least)
    return [float(step * k) for k in range(int(np.ceil(low / step)), int(np.floor(high / step)) + 1)]


def _number(value: float) -> str:
    return f"{value:.6g}".replace("-", "−")
