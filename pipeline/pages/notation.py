"""How numbers and places are written, the same in every paper, table, page and message.

A clock position is ``7:01`` (12 o'clock up, clockwise looking forward), an extent ``7:01–7:11``. A depth
is given without sign and with its direction: ``1.58 ± 0.03 mm deep`` goes into the wall, ``1.48 ± 0.05
mm inward`` stands into the bore. Where a table needs a bare number, into the wall is positive. A finding
is at its peak, where its depth was read, with its extent behind: ``412.3 mm (408.1–416.0 mm)``. A value
bears as many digits as its 1 σ.
"""

from __future__ import annotations

import math

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
