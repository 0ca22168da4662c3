"""Findings as rows of tables: what CSV, JSON, POF table and report all take their numbers from."""

from __future__ import annotations

import csv
from io import StringIO
from typing import Any

import numpy as np

from pipeline.artefacts.findings import DefectKind, en13508_suggestion, pacp_suggestion, pof_class
from pipeline.artefacts.model import Overlays
from pipeline.review.decisions.replay import GONE, Finding
from pipeline.review.documents import state_document
from pipeline.review.review import Review, State

COLUMNS = (
    "id", "kind", "status", "distance_from_mm", "distance_to_mm", "clock_from", "clock_to", "length_mm",
    "width_mm", "depth_mm", "depth_sigma_mm", "wall_loss_percent", "pof_class", "pacp", "en13508", "b31g_mpa",
    "modified_b31g_mpa", "edited", "decided_by", "decided_at", "reason", "remarks",
)  # fmt: skip

_POF_FEATURE = {DefectKind.PIT: "ANOM", DefectKind.CORROSION: "ANOM", DefectKind.GOUGE: "ANOM",
                DefectKind.CRACK: "ANOM", DefectKind.DENT: "ANOM", DefectKind.DEPOSIT: "ADME",
                DefectKind.WELD: "WELD"}  # fmt: skip
_POF_TYPE = {DefectKind.PIT: "CORR", DefectKind.CORROSION: "CORR", DefectKind.GOUGE: "GOUG",
             DefectKind.CRACK: "CRAC", DefectKind.DENT: "DENT", DefectKind.DEPOSIT: "DEBR",
             DefectKind.WELD: "GWEL"}  # fmt: skip


def findings_table(review: Review, state: State) -> list[dict[str, Any]]:
    """Return one row for each finding that stands, in order of distance; numbers rounded once, here."""
    documents = {f["id"]: f for f in state_document(state, review.files)["findings"]}
    bore_mm = 2 * review.files.artefact(Overlays).nominal_radius_mm
    standing = [f for f in state.findings if f.status != GONE]
    return [_row(f, documents[f.id], bore_mm, state) for f in standing]


def csv_text(rows: list[dict[str, Any]], columns: tuple[str, ...] = COLUMNS) -> str:
    """Return rows as CSV; text that a spreadsheet would take for a formula gets an apostrophe."""
    out = StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(columns)
    for row in rows:
        writer.writerow([_harmless(row[c]) for c in columns])
    return out.getvalue()


POF_COLUMNS = (
    "feature_id", "log_distance_m", "feature_type", "feature_identification", "dimension_class",
    "clock_position", "depth_percent", "depth_mm", "depth_tolerance_mm_80", "length_mm", "width_mm",
    "surface_location", "comment",
)  # fmt: skip
_FORMULA = ("=", "+", "-", "@", "\t", "\r")
# 80 % of a normal distribution lie within this many σ.
_80_PERCENT = 1.2816


def pof_rows(rows: list[dict[str, Any]], state: State) -> list[dict[str, Any]]:
    """Return the accepted findings as a list of features after POF 100."""
    wall = state.assumed.wall_thickness_mm
    return [_pof_row(row, wall) for row in rows if row["status"] == "accepted"]


def _row(finding: Finding, document: dict[str, Any], bore_mm: float, state: State) -> dict[str, Any]:
    size, strength = document["size"], document["strength"] or {}
    kind = DefectKind(finding.kind)
    pof = ""
    if kind.is_metal_loss:
        pof = pof_class(finding.size.length_mm, finding.size.width_mm, state.assumed.wall_thickness_mm)
    outline = np.asarray(finding.outline)
    direction = float(np.arctan2(np.ptp(outline[:, 1]) * bore_mm / 2, np.ptp(outline[:, 0])))
    return {
        "id": finding.id, "kind": finding.kind, "status": finding.status,
        **{name: _rounded(size[name], 1) for name in ("distance_from_mm", "distance_to_mm")},
        "clock_from": _rounded(size["clock_from"], 2), "clock_to": _rounded(size["clock_to"], 2),
        "length_mm": _rounded(size["length_mm"], 1), "width_mm": _rounded(size["width_mm"], 1),
        "depth_mm": _rounded(size["depth_mm"], 3), "depth_sigma_mm": _rounded(size["depth_sigma_mm"], 3),
        "wall_loss_percent": _rounded(document["wall_loss_percent"], 1), "pof_class": pof,
        "pacp": pacp_suggestion(kind, direction), "en13508": en13508_suggestion(kind),
        "b31g_mpa": _rounded(strength.get("b31g_mpa"), 1),
        "modified_b31g_mpa": _rounded(strength.get("modified_mpa"), 1),
        "edited": finding.edited, "decided_by": finding.decided_by, "decided_at": finding.decided_at,
        "reason": finding.reason, "remarks": " | ".join(f"{r.who}: {r.text}" for r in finding.remarks),
    }  # fmt: skip


def _pof_row(row: dict[str, Any], wall_mm: float | None) -> dict[str, Any]:
    kind = DefectKind(row["kind"])
    depth, sigma = row["depth_mm"], row["depth_sigma_mm"]
    percent = _rounded(100 * depth / wall_mm, 1) if wall_mm and depth is not None and depth > 0 else None
    return {
        "feature_id": row["id"], "log_distance_m": round(row["distance_from_mm"] / 1000, 4),
        "feature_type": _POF_FEATURE[kind], "feature_identification": _POF_TYPE[kind],
        "dimension_class": row["pof_class"], "clock_position": clock_text(row["clock_from"]),
        "depth_percent": percent, "depth_mm": depth,
        "depth_tolerance_mm_80": None if sigma is None else round(_80_PERCENT * sigma, 3),
        "length_mm": row["length_mm"], "width_mm": row["width_mm"], "surface_location": "INT",
        "comment": row["remarks"],
    }  # fmt: skip


def clock_text(hours: float) -> str:
    """Return a clock position as ``hh:mm``."""
    minutes = round(hours * 60) % 720
    return f"{minutes // 60 or 12:02d}:{minutes % 60:02d}"


def _rounded(value: float | None, digits: int) -> float | None:
    return None if value is None else round(value, digits)


def _harmless(value: object) -> object:
    if value is None:
        return ""
    return f"'{value}" if isinstance(value, str) and value.startswith(_FORMULA) else value
