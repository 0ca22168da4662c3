"""Findings, and what grew between two runs, as rows: every table and report takes its numbers from them."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from io import StringIO
from typing import Any

import numpy as np

from pipeline.artefacts.comparison import Change, OutlinedFinding
from pipeline.artefacts.findings import (
    DefectKind,
    clock_of_azimuth,
    en13508_suggestion,
    pacp_suggestion,
    pof_class,
)
from pipeline.artefacts.model import Overlays
from pipeline.pages import notation
from pipeline.review.decisions.replay import GONE, Finding, Measured
from pipeline.review.documents import state_document
from pipeline.review.review import Review, State
from pipeline.review.run_files import measured_findings

# Depths are positive into the wall; measured_… is as the run found it, empty where nothing was edited.
COLUMNS = (
    "id", "label", "kind", "status", "distance_mm", "distance_from_mm", "distance_to_mm", "clock",
    "clock_from", "clock_to", "length_mm", "width_mm", "depth_mm", "depth_sigma_mm", "wall_loss_percent",
    "wall_loss_sigma_percent", "pof_class", "pacp", "en13508", "b31g_mpa", "modified_b31g_mpa", "edited",
    "measured_kind", "measured_distance_mm", "measured_length_mm", "measured_width_mm", "measured_depth_mm",
    "measured_depth_sigma_mm", "decided_by", "decided_at", "reason", "remarks",
)  # fmt: skip
GROWTH_COLUMNS = (
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
_FORMULA = ("=", "+", "-", "@", "\t", "\r")


def findings_table(review: Review, state: State) -> list[dict[str, Any]]:
    """Return one row for each finding that stands, in order of distance; numbers rounded once, here."""
    documents = {f["id"]: f for f in state_document(state, review.files)["findings"]}
    bore_mm = 2 * review.files.artefact(Overlays).nominal_radius_mm
    file = review.files.path / "defects.json"
    as_measured = {f.original: f for f in measured_findings(review.files.defects_text(), file)}
    standing = [f for f in state.findings if f.status != GONE]
    return [
        _row(f, documents[f.id], bore_mm, state) | _measured(f, as_measured.get(f.original)) for f in standing
    ]


def csv_text(rows: list[dict[str, Any]], columns: tuple[str, ...] = COLUMNS) -> str:
    """Return rows as CSV; text that a spreadsheet would take for a formula gets an apostrophe."""
    out = StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(columns)
    for row in rows:
        writer.writerow([_harmless(row[c]) for c in columns])
    return out.getvalue()


def _row(finding: Finding, document: dict[str, Any], bore_mm: float, state: State) -> dict[str, Any]:
    strength = document["strength"] or {}
    kind = DefectKind(finding.kind)
    pof = ""
    if kind.is_metal_loss:
        pof = pof_class(finding.size.length_mm, finding.size.width_mm, state.assumed.wall_thickness_mm)
    outline = np.asarray(finding.outline)
    direction = float(np.arctan2(np.ptp(outline[:, 1]) * bore_mm / 2, np.ptp(outline[:, 0])))
    return {
        "id": finding.id, "label": document["label"], "kind": finding.kind, "status": finding.status,
        **_size(finding.size),
        "wall_loss_percent": rounded(document["wall_loss_percent"], 2),
        "wall_loss_sigma_percent": rounded(document["wall_loss_sigma_percent"], 2), "pof_class": pof,
        "pacp": pacp_suggestion(kind, direction), "en13508": en13508_suggestion(kind),
        "b31g_mpa": rounded(strength.get("b31g_mpa"), 1),
        "modified_b31g_mpa": rounded(strength.get("modified_mpa"), 1),
        "edited": finding.edited, "decided_by": finding.decided_by, "decided_at": finding.decided_at,
        "reason": finding.reason, "remarks": " | ".join(f"{r.who}: {r.text}" for r in finding.remarks),
        "cautions": list(document["cautions"]),
    }  # fmt: skip


def _size(size: Measured) -> dict[str, Any]:
    all_round = size.clock_to - size.clock_from >= 12
    return {
        "distance_mm": rounded(size.peak_distance_mm, 1),
        "distance_from_mm": rounded(size.distance_from_mm, 1),
        "distance_to_mm": rounded(size.distance_to_mm, 1),
        "clock": notation.clock(size.peak_clock) if np.isfinite(size.peak_clock) else None,
        "clock_from": "12:00" if all_round else notation.clock(size.clock_from),
        "clock_to": "12:00" if all_round else notation.clock(size.clock_to),
        "length_mm": rounded(size.length_mm, 1), "width_mm": rounded(size.width_mm, 1),
        "depth_mm": rounded(size.depth_mm, 3), "depth_sigma_mm": rounded(size.depth_sigma_mm, 3),
    }  # fmt: skip


def _measured(finding: Finding, run: Finding | None) -> dict[str, Any]:
    """Return how the run measured an edited finding; None for each value of one that it did not measure."""
    if run is None or not finding.edited:
        return {name: None for name in COLUMNS if name.startswith("measured_")}
    size = {f"measured_{name}": value for name, value in _size(run.size).items()}
    return {name: value for name, value in size.items() if name in COLUMNS} | {"measured_kind": run.kind}


def rounded(value: float | None, digits: int) -> float | None:
    """Return a rounded number, None for what is not known."""
    return None if value is None or not np.isfinite(value) else round(value, digits)


def _harmless(value: object) -> object:
    if value is None:
        return ""
    return f"'{value}" if isinstance(value, str) and value.startswith(_FORMULA) else value


def growth_rows(
    changes: Sequence[Change], years: float | None, wall_thickness_mm: float | None
) -> list[dict[str, Any]]:
    """Return one row of `GROWTH_COLUMNS` for each change, rounded once; None where there is none."""
    return [_growth_row(c, years, wall_thickness_mm) for c in changes]


def _growth_row(change: Change, years: float | None, wall_thickness_mm: float | None) -> dict[str, Any]:
    distance, azimuth = change.place.middle
    clock = notation.clock(float(clock_of_azimuth(azimuth)))
    row: dict[str, Any] = dict.fromkeys(GROWTH_COLUMNS) | {
        "id": _id(change.place.now), "earlier_id": _id(change.place.earlier), "kind": change.place.kind.value,
        "fate": change.fate.value, "distance_mm": distance, "clock": clock,
        "seen_percent": 100 * change.seen_now, "earlier_seen_percent": 100 * change.seen_earlier,
        "significant": change.is_significant,
        **_reported("", change.place.now), **_reported("earlier_", change.place.earlier),
        **_growth(change), **_rates(change, years, wall_thickness_mm),
    }  # fmt: skip
    return {name: _rounded_by_name(name, value) for name, value in row.items()}


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


def _rounded_by_name(name: str, value: Any) -> Any:
    if not isinstance(value, float):
        return value
    if not np.isfinite(value):
        return None
    if name in ("p", "p_adjusted"):
        return float(f"{value:.2g}")
    return round(value, _DECIMALS.get(name, _DECIMALS.get(name.rsplit("_", 1)[-1], 3)))
