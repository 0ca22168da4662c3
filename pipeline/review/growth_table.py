"""The table of what grew between two runs: one row for each finding of either, as CSV and JSON take it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pipeline.artefacts.comparison import Change, OutlinedFinding
from pipeline.artefacts.findings import clock_of_azimuth
from pipeline.pages import notation

COLUMNS = (
    "id", "earlier_id", "kind", "fate", "distance_mm", "clock", "seen_percent", "earlier_seen_percent",
    "reported_depth_mm", "reported_depth_sigma_mm", "earlier_reported_depth_mm",
    "earlier_reported_depth_sigma_mm", "depth_mm", "earlier_depth_mm", "depth_growth_mm",
    "depth_growth_sigma_mm", "z", "p", "p_adjusted", "significant", "length_growth_mm",
    "length_growth_sigma_mm", "width_growth_mm", "width_growth_sigma_mm", "area_growth_mm2",
    "area_growth_sigma_mm2", "extent_level_mm", "depth_rate_mm_per_year", "depth_rate_sigma_mm_per_year",
    "wall_loss_rate_percent_per_year", "wall_loss_rate_sigma_percent_per_year",
)  # fmt: skip
# Decimals by the column's name, else by its last part.
_DECIMALS = {"mm": 3, "mm2": 1, "percent": 1, "z": 2, "distance_mm": 1, "year": 3}


def growth_rows(
    changes: Sequence[Change], years: float | None, wall_thickness_mm: float | None
) -> list[dict[str, Any]]:
    """Return one row of `COLUMNS` for each change, numbers rounded once, here; None where there is none."""
    return [_row(c, years, wall_thickness_mm) for c in changes]


def _row(change: Change, years: float | None, wall_thickness_mm: float | None) -> dict[str, Any]:
    distance, azimuth = change.place.middle
    clock = notation.clock(float(clock_of_azimuth(azimuth)))
    row: dict[str, Any] = dict.fromkeys(COLUMNS) | {
        "id": _id(change.place.now), "earlier_id": _id(change.place.earlier), "kind": change.place.kind.value,
        "fate": change.fate.value, "distance_mm": distance, "clock": clock,
        "seen_percent": 100 * change.seen_now, "earlier_seen_percent": 100 * change.seen_earlier,
        "significant": change.is_significant,
        **_reported("", change.place.now), **_reported("earlier_", change.place.earlier),
        **_growth(change), **_rates(change, years, wall_thickness_mm),
    }  # fmt: skip
    return {name: _rounded(name, value) for name, value in row.items()}


def _reported(prefix: str, finding: OutlinedFinding | None) -> dict[str, float | None]:
    depth = (None, None) if finding is None else (finding.depth_mm, finding.depth_sigma_mm)
    return {f"{prefix}reported_depth_mm": depth[0], f"{prefix}reported_depth_sigma_mm": depth[1]}


def _growth(change: Change) -> dict[str, float]:
    growth = change.growth
    if growth is None:
        return {}
    out = {
        "depth_mm": growth.depth_now_mm, "earlier_depth_mm": growth.depth_before_mm,
        "z": change.z, "p": change.p, "p_adjusted": change.p_adjusted, "extent_level_mm": growth.level_mm,
        "area_growth_mm2": growth.area_mm2.value, "area_growth_sigma_mm2": growth.area_mm2.sigma,
    }  # fmt: skip
    for name in ("depth", "length", "width"):
        value = getattr(growth, f"{name}_mm")
        out |= {f"{name}_growth_mm": value.value, f"{name}_growth_sigma_mm": value.sigma}
    return out


def _rates(change: Change, years: float | None, wall_thickness_mm: float | None) -> dict[str, float]:
    """Return growth of the depth a year, and of the wall loss where it is one and the wall is known."""
    if change.growth is None or years is None:
        return {}
    rate, sigma = (v / years for v in vars(change.growth.depth_mm).values())
    out = {"depth_rate_mm_per_year": rate, "depth_rate_sigma_mm_per_year": sigma}
    if wall_thickness_mm is not None and change.place.kind.is_metal_loss:
        share = 100 / wall_thickness_mm
        out |= {"wall_loss_rate_percent_per_year": share * rate,
                "wall_loss_rate_sigma_percent_per_year": share * sigma}  # fmt: skip
    return out


def _id(finding: OutlinedFinding | None) -> str | None:
    return finding.id if finding is not None else None


def _rounded(name: str, value: Any) -> Any:
    if not isinstance(value, float):
        return value
    if not np.isfinite(value):
        return None
    if name in ("p", "p_adjusted"):
        return float(f"{value:.2g}")
    return round(value, _DECIMALS.get(name, _DECIMALS.get(name.rsplit("_", 1)[-1], 3)))
