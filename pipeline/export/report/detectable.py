"""The limit of detection in words."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pipeline.artefacts.findings import Detectable


def limits(stretches: Sequence[Detectable]) -> list[str]:
    """Return, for each stretch of a pipe, from which size and depth on defects are found there."""
    return [_limit(d, len(stretches) > 1) for d in stretches]


def _limit(stretch: Detectable, one_of_several: bool) -> str:
    """Return one stretch's limit of detection in words."""
    where = f"at {stretch.from_mm:.0f}–{stretch.to_mm:.0f} mm: " if one_of_several else ""
    rings = f"rings are {stretch.ring_spacing_mm:.2g} mm apart"
    if not math.isfinite(stretch.depth_mm):
        return f"{where}not even large defects are found reliably; {rings}"
    size = f"{stretch.size_mm:.2g} mm"
    found = f"{where}nine of ten defects of {size} × {size} are found from {stretch.depth_mm:.2f} mm deep on"
    if stretch.photo_size_mm >= stretch.size_mm:
        return f"{found}; {rings}"
    return f"{found}, smaller ones from {stretch.photo_size_mm:.2g} mm if the photo shows them; {rings}"
