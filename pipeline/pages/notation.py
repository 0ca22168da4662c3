"""How numbers, places and the figures of a run are written, the same in every paper, table, page and message.

A clock position is ``7:01`` (12 o'clock up, clockwise looking forward), an extent ``7:01–7:11``. A depth
is given without sign and with its direction: ``1.58 ± 0.03 mm deep`` goes into the wall, ``1.48 ± 0.05
mm inward`` stands into the bore. Where a table needs a bare number, into the wall is positive. A finding
is at its peak, where its depth was read, with its extent behind: ``412.3 mm (408.1–416.0 mm)``. A value
bears as many digits as its 1 σ. Files keep the stages' own names of figures; people read plain ones.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable

_MOST_DIGITS = 3
_MINUTES_ROUND = 720


def clock(hours: float) -> str:
    """Return a clock position given in hours, as ``h:mm``.

    Outlines run along the edges of cells, which lie at half minutes: these are rounded up whether the number
    comes exactly or from a file with few decimals, so that all papers say the same.
    """
    minutes = math.floor(round(hours * 60, 1) + 0.5) % _MINUTES_ROUND
    return f"{minutes // 60 or 12}:{minutes % 60:02d}"


def clock_extent(hours_from: float, hours_to: float) -> str:
    """Return an extent on the clock, clockwise, as ``h:mm–h:mm``; ``all round`` for the whole circle."""
    if hours_to - hours_from >= 12:
        return "all round"
    return f"{clock(hours_from)}–{clock(hours_to)}"


def distance(peak_mm: float | None, from_mm: float, to_mm: float) -> str:
    """Return a distance along the pipe: the peak, and the extent in brackets; without a peak the extent."""
    extent = f"{from_mm:.1f}–{to_mm:.1f} mm"
    return extent if not _known(peak_mm) else f"{peak_mm:.1f} mm ({extent})"


def measured(value: float | None, sigma: float | None, unit: str = "mm") -> str:
    """Return a value ± its 1 σ, with two digits of the σ but no more than three decimals."""
    if value is None or not math.isfinite(value):
        return "not seen"
    if sigma is None or not math.isfinite(sigma) or sigma <= 0:
        return f"{float(f'{value:.4g}'):.10g} {unit}".strip()
    digits = max(0, min(_MOST_DIGITS, 1 - math.floor(math.log10(sigma))))
    least = 10.0**-digits
    spread = f"< {least:.{digits}f}" if sigma < least / 2 else f"{sigma:.{digits}f}"
    return f"{value:.{digits}f} ± {spread} {unit}".strip()


def depth(depth_mm: float | None, sigma_mm: float | None) -> str:
    """Return a depth (positive into the wall) without sign, with its direction in words."""
    if depth_mm is None or not math.isfinite(depth_mm):
        return "depth not seen"
    return f"{measured(abs(depth_mm), sigma_mm)} {direction(depth_mm)}"


def direction(depth_mm: float) -> str:
    """Return which way a depth goes: ``deep`` into the wall, ``inward`` into the bore."""
    return "inward" if depth_mm < 0 else "deep"


def moment(at: str) -> str:
    """Return a time of ISO 8601, UTC, to the minute: ``2026-11-22 18:30 UTC``."""
    return f"{at[:16].replace('T', ' ')} UTC"


def _known(value: float | None) -> bool:
    return value is not None and math.isfinite(value)


def plus_minus(sigma: float, unit: str) -> str:
    """Return 1 σ in brackets, to stand after a number; ``unit`` is empty for what has none."""
    return f"(± {sigma:.2g} {unit}".rstrip() + ")"


STAGES = {
    "premises": "Recording checked", "rings": "Laser line in the frames", "triangulate": "Points of the wall",
    "motion": "Motion of the camera", "accumulate": "Shape of the wall", "texture": "Photo of the wall",
    "overlays": "Colours of the error layers", "mesh": "Surface of the model", "sections": "Cross-sections",
    "defects": "Findings",
}  # fmt: skip
SAMPLE_REASONS = {
    "valid": "used", "no_line": "no laser line there", "low_contrast": "line too faint",
    "saturated": "saturated", "glint": "glint", "ghost": "second reflection",
    "outlier": "off the neighbouring line", "out_of_view": "outside the picture",
    "width": "line of implausible width", "frame_rejected": "its whole frame was rejected",
}  # fmt: skip
"""Why a ring sample is not used, by the name of its `RingValidity` in small letters."""
_LAYERS = {
    "deviation": "deviation from the fitted pipe", "deviation_nominal": "deviation from the nominal diameter",
    "uncertainty": "1 σ of the radius", "misalignment": "radius error if misalignment were ignored",
}  # fmt: skip
_PLAIN: tuple[tuple[re.Pattern[str], Callable[[re.Match[str]], str]], ...] = (
    (re.compile(r"^overlay (\w+): range$"), lambda m: f"{_LAYERS.get(m[1], m[1])}: value of the last colour"),
    (re.compile(r"^overlay (\w+): beyond the range$"),
     lambda m: f"{_LAYERS.get(m[1], m[1])}: share beyond the last colour"),
    (re.compile(r"^ring samples rejected: (\w+)$"),
     lambda m: f"ring samples not used: {SAMPLE_REASONS.get(m[1], m[1])}"),
    (re.compile(r"^ring samples valid$"), lambda _: "ring samples used"),
    (re.compile(r"^rejected: "), lambda _: "not used: "),
    (re.compile(r"^mesh: "), lambda _: ""),
    (re.compile(r"\bRMS (.*)"), lambda m: f"{m[1]}, root mean square"),
    (re.compile(r"\b1 sigma\b"), lambda _: "1 σ"),
)  # fmt: skip


def figure_name(name: str) -> str:
    """Return what a figure of a stage or of a run is called on a page."""
    for pattern, plain in _PLAIN:
        name = pattern.sub(plain, name)
    return name


def stage_title(stage: str) -> str:
    """Return what a stage does, in words; of a stage that is not known, its name."""
    return STAGES.get(stage, stage)
