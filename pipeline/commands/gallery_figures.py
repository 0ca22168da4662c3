"""Pictures and plots of the gallery: PNG as bytes, plots as paths for the page to draw."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from pipeline.arrays import Byte, Float
from pipeline.physics.effect import Channel
from pipeline.simulator.gallery.exhibit import Exhibit, unrolled
from pipeline.simulator.gallery.scenes import Course

# Size of a plot's field; the page adds the margins.
WIDTH, HEIGHT = 360.0, 130.0
# Side of the small picture, px.
_PICTURE_PX = 300
# Of the unrolled line: px on each side, step, columns around, and how often a column is repeated.
_STRIP_PX, _STRIP_STEP_PX, _STRIP_COLUMNS, _STRIP_SCALE = 10.0, 0.25, 360, 2
# The eye's response, so that a faint ghost or tail is seen beside the line.
_DISPLAY_GAMMA = 0.45
# Smallest light that a difference is stretched to: below it there is rounding only.
_LEAST_FULL_SCALE = 1e-4
# About so many marks on an axis.
_TICKS = 4


@dataclass(frozen=True)
class Plot:
    """Curves over one quantity, ready to draw: ``paths`` are SVG path data in a field WIDTH × HEIGHT."""

    title: str
    unit: str
    paths: tuple[str, ...]
    names: tuple[str, ...]
    x_ticks: tuple[tuple[float, str], ...]
    y_ticks: tuple[tuple[float, str], ...]
    x_title: str


def picture_png(exhibit: Exhibit) -> bytes:
    """Return the camera's picture with the effect, made small."""
    shape = (_PICTURE_PX, _PICTURE_PX)
    small = cv2.resize(exhibit.changed, shape, interpolation=cv2.INTER_AREA)
    return _png(_displayed(np.asarray(small, float), 0.5))


def line_png(exhibit: Exhibit) -> bytes:
    """Return the line unrolled, azimuth across and image radius up, with the effect."""
    return _png(_strip(_displayed(_around(exhibit, changed=True), 1.0)))


def difference_png(exhibit: Exhibit) -> tuple[bytes, float]:
    """Return what the effect changes there, red more and blue less light, and the light of full colour."""
    change = _around(exhibit, changed=True) - _around(exhibit, changed=False)
    full = max(float(np.quantile(np.abs(change), 0.999)), _LEAST_FULL_SCALE)
    share = np.clip(change / full, -1, 1)
    bgr = np.stack([1 - np.clip(share, 0, 1), 1 - np.abs(share), 1 + np.clip(share, -1, 0)], -1)
    return _png(_strip(np.asarray(255 * bgr, np.uint8))), full


def ring_plots(exhibit: Exhibit) -> list[Plot]:
    """Return the radius error around the ring, and light, width and skewness where the profile is changed."""
    azimuth = np.degrees(exhibit.azimuth_rad)
    residuals = exhibit.residual.values()
    names = tuple(f"{2 * r / 25.4:g} inch" for r in exhibit.residual)
    shown = [("residual on the ring", "µm", [1000 * r.error_mm for r in residuals], 0.5)]
    if exhibit.switch.effect.channel is Channel.PROFILE or not exhibit.shows_on_ring:
        shown += [
            ("light of the line", "%", [100 * r.light for r in residuals], 0.1),
            ("width of the line", "px", [r.width_px for r in residuals], 0.005),
            ("skewness of the line", "", [r.skewness for r in residuals], 0.01),
        ]
    return [
        _plot(title, unit, azimuth, curves, names, "azimuth, °", [-180, -90, 0, 90, 180], least)
        for title, unit, curves, least in shown
    ]


def course_plot(course: Course) -> Plot:
    """Return how an effect goes with time."""
    ticks = _nice(float(course.time_s[0]), float(course.time_s[-1]))
    return _plot(course.of, "mm", course.time_s, [course.value_mm], ("4 inch",), "time, s", ticks, 0.01)


def _plot(
    title: str, unit: str, x: Float, curves: Sequence[Float], names: tuple[str, ...], x_title: str,
    x_ticks: Sequence[float], least: float,
) -> Plot:  # fmt: skip
    """Return curves in a field that holds them and 0, and spans at least ``least``."""
    low, high = min(0.0, *(float(c.min()) for c in curves)), max(0.0, *(float(c.max()) for c in curves))
    room = max(0.08 * (high - low), least / 2)
    y_ticks = _nice(low - room, high + room)
    low, high = y_ticks[0], y_ticks[-1]

    def across(value: Float | float) -> Float:
        return np.asarray(WIDTH * (np.asarray(value) - x_ticks[0]) / (x_ticks[-1] - x_ticks[0]))

    def up(value: Float | float) -> Float:
        return np.asarray(HEIGHT * (high - np.asarray(value)) / (high - low))

    paths = tuple(_path(across(x), up(c)) for c in curves)
    return Plot(
        title, unit, paths, names,
        tuple((float(across(t)), f"{t:g}") for t in x_ticks),
        tuple((float(up(t)), f"{t:g}") for t in y_ticks), x_title,
    )  # fmt: skip


def _path(x: Float, y: Float) -> str:
    return "M" + "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(x, y, strict=True))


def _nice(low: float, high: float) -> list[float]:
    """Return round numbers from at or below ``low`` to at or above ``high``."""
    rough = (high - low) / _TICKS
    power = 10.0 ** math.floor(math.log10(rough))
    step = power * next(m for m in (1.0, 2.0, 2.5, 5.0, 10.0) if m * power >= rough)
    first, last = math.floor(low / step + 1e-9), math.ceil(high / step - 1e-9)
    return [k * step for k in range(first, last + 1)]


def _around(exhibit: Exhibit, *, changed: bool) -> Float:
    """Return the picture along radii (rows, outward up) and azimuths (columns)."""
    azimuth = -np.pi + 2 * np.pi * np.arange(_STRIP_COLUMNS) / _STRIP_COLUMNS
    picture = exhibit.changed if changed else exhibit.plain
    return np.asarray(unrolled(picture, exhibit.scene, azimuth, _STRIP_PX, _STRIP_STEP_PX)[1].T[::-1])


def _displayed(light: Float, white: float) -> Byte:
    return np.asarray(255 * np.clip(light / white, 0, 1) ** _DISPLAY_GAMMA, np.uint8)


def _strip(picture: Byte) -> Byte:
    return np.asarray(np.repeat(picture, _STRIP_SCALE, axis=1))


def _png(picture: Byte) -> bytes:
    return bytes(cv2.imencode(".png", picture, [cv2.IMWRITE_PNG_COMPRESSION, 9])[1].tobytes())
