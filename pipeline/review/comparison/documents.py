"""A comparison as plain data for the page, and its table as CSV and JSON."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from pipeline.artefacts.findings import clock_of_azimuth
from pipeline.files.provenance import MadeBy
from pipeline.review.comparison.changes import FAMILY_ERROR, Change, Fate
from pipeline.review.comparison.comparison import Comparison
from pipeline.review.comparison.registration import Registration
from pipeline.review.decisions.replay import Finding
from pipeline.review.documents import cleaned, overlay_document
from pipeline.review.papers.tables import csv_text

COLUMNS = (
    "id", "earlier_id", "kind", "fate", "distance_mm", "clock", "seen_percent", "earlier_seen_percent",
    "reported_depth_mm", "reported_depth_sigma_mm", "earlier_reported_depth_mm",
    "earlier_reported_depth_sigma_mm", "depth_mm", "earlier_depth_mm", "depth_growth_mm",
    "depth_growth_sigma_mm", "z", "p", "p_adjusted", "significant", "length_growth_mm",
    "length_growth_sigma_mm", "width_growth_mm", "width_growth_sigma_mm", "area_growth_mm2",
    "area_growth_sigma_mm2", "extent_level_mm", "depth_rate_mm_per_year", "depth_rate_sigma_mm_per_year",
    "wall_loss_rate_percent_per_year", "wall_loss_rate_sigma_percent_per_year",
)  # fmt: skip
_HALF_VIEW_MM = 12.0
# Decimals by the column's name, else by its last part.
_DECIMALS = {"mm": 3, "mm2": 1, "percent": 1, "z": 2, "clock": 2, "distance_mm": 1, "year": 3}


def comparison_document(comparison: Comparison) -> dict[str, Any]:
    """Return registration, diameter, layers' legends and every change."""
    found, layers = comparison.changes(), comparison.difference_layers()
    return cleaned({
        "earlier": comparison.earlier.files.record()["recording"]["name"],
        "years": comparison.years,
        "family_error": FAMILY_ERROR,
        "statement": _statement(found),
        "registration": _registration(comparison.pair.registration),
        "diameter": vars(comparison.diameter),
        "one_calibration": comparison.is_one_calibration,
        "overlays": [overlay_document(o) for o in (layers.difference, layers.sigma)],
        "changes": [growth_row(c, comparison) | _shown(c) for c in found],
    })  # fmt: skip


def growth_csv(comparison: Comparison) -> str:
    """Return the table of changes as CSV."""
    return csv_text(growth_rows(comparison), COLUMNS)


def growth_json(comparison: Comparison) -> str:
    """Return the table of changes, and the registration they rest on, as JSON."""
    document = comparison_document(comparison)
    told = {k: document[k] for k in ("earlier", "years", "family_error", "registration", "diameter")}
    runs = {"run": comparison.now.files.version, "earlier": comparison.earlier.files.version}
    told |= {"made_by": MadeBy("review --compare", runs).document(), "changes": growth_rows(comparison)}
    return json.dumps(told, indent=1, ensure_ascii=False)


def growth_rows(comparison: Comparison) -> list[dict[str, Any]]:
    """Return one row for each finding of either run; numbers rounded once, here."""
    return [growth_row(c, comparison) for c in comparison.changes()]


def growth_row(change: Change, comparison: Comparison) -> dict[str, Any]:
    """Return a change as a row of `COLUMNS`; None where there is no number."""
    distance, azimuth = change.place.middle
    row: dict[str, Any] = dict.fromkeys(COLUMNS) | {
        "id": _id(change.place.now), "earlier_id": _id(change.place.earlier), "kind": change.place.kind.value,
        "fate": change.fate.value, "distance_mm": distance, "clock": float(clock_of_azimuth(azimuth)),
        "seen_percent": 100 * change.seen_now, "earlier_seen_percent": 100 * change.seen_earlier,
        "significant": change.is_significant,
        **_reported("", change.place.now), **_reported("earlier_", change.place.earlier),
    }  # fmt: skip
    if change.growth is not None:
        row |= _growth(change) | _rates(change, comparison)
    return {name: _rounded(name, value) for name, value in row.items()}


def _reported(prefix: str, finding: Finding | None) -> dict[str, float | None]:
    depth = (None, None) if finding is None else (finding.size.depth_mm, finding.size.depth_sigma_mm)
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


def _rates(change: Change, comparison: Comparison) -> dict[str, float]:
    """Return growth of the depth a year, and of the wall loss where it is one and the wall is known."""
    if change.growth is None or comparison.years is None:
        return {}
    rate, sigma = (v / comparison.years for v in vars(change.growth.depth_mm).values())
    out = {"depth_rate_mm_per_year": rate, "depth_rate_sigma_mm_per_year": sigma}
    wall = comparison.wall_thickness_mm
    if wall is not None and change.place.kind.is_metal_loss:
        share = 100 / wall
        out |= {"wall_loss_rate_percent_per_year": share * rate,
                "wall_loss_rate_sigma_percent_per_year": share * sigma}  # fmt: skip
    return out


def _shown(change: Change) -> dict[str, Any]:
    """Return what the page needs to show a place: its middle, outlines of both runs, how much about it."""
    _, azimuth = change.place.middle
    corner = np.concatenate(change.place.outlines)
    return {
        "azimuth_rad": azimuth,
        "half_mm": max(float(np.ptp(corner[:, 0])), _HALF_VIEW_MM),
        "outlines": [o.tolist() for o in change.place.outlines],
        "changed": change.fate in (Fate.GREW, Fate.SHRANK, Fate.NEW, Fate.VANISHED),
    }


def _registration(found: Registration) -> dict[str, Any]:
    told = vars(found)
    return told | {
        "welds": [vars(w) for w in found.welds],
        "shift_range_mm": [found.shift_mm.min(), found.shift_mm.max()],
        "roll_range_rad": [found.roll_rad.min(), found.roll_rad.max()],
    }


def _statement(found: tuple[Change, ...]) -> str:
    count = {fate: sum(c.fate is fate for c in found) for fate in Fate}
    tested = sum(c.growth is not None for c in found)
    words = ", ".join(f"{count[f]} {f}" for f in (Fate.GREW, Fate.SHRANK, Fate.NEW, Fate.VANISHED))
    return (
        f"{tested} findings compared on both walls: {words}. Where nothing has changed, the chance that any "
        f"of these is declared is {FAMILY_ERROR:.0%}."
    )


def _id(finding: Finding | None) -> str | None:
    return finding.id if finding is not None else None


def _rounded(name: str, value: Any) -> Any:
    if not isinstance(value, float):
        return value
    if not np.isfinite(value):
        return None
    if name in ("p", "p_adjusted"):
        return float(f"{value:.2g}")
    return round(value, _DECIMALS.get(name, _DECIMALS.get(name.rsplit("_", 1)[-1], 3)))
