"""Findings as rows of tables, from which CSV, JSON, POF table and report take their numbers, and pictures."""

from __future__ import annotations

import csv
from io import BytesIO, StringIO
from typing import Any

import cv2
import numpy as np
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from pipeline.arrays import Byte, Float
from pipeline.artefacts.findings import DefectKind, en13508_suggestion, pacp_suggestion, pof_class
from pipeline.artefacts.model import Overlays
from pipeline.artefacts.wall_map import WallMap
from pipeline.review.decisions.replay import GONE, Finding
from pipeline.review.documents import state_document
from pipeline.review.flat_tiles import PHOTO, FlatPicture, picture_of
from pipeline.review.review import Review, State
from pipeline.review.run_files import RunFiles

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
_SIZE_PX, _QUALITY = 480, 90
_LEAST_HALF_MM = 8.0
_OUTLINE_BGR, _HALO_BGR = (0, 71, 179), (255, 255, 255)
_EXAGGERATION = 20.0


def finding_picture(files: RunFiles, finding: Finding, radius_mm: float) -> bytes:
    """Return the wall about a finding, outlined, as JPEG; distance to the right, clock downward."""
    photo = picture_of(files, PHOTO)
    outline = np.asarray(finding.outline)
    middle = outline.mean(0)
    half = max(
        0.8 * float(np.ptp(outline[:, 0])), 0.8 * float(np.ptp(outline[:, 1])) * radius_mm, _LEAST_HALF_MM
    )
    half = min(half, np.pi * radius_mm)
    grid = (np.arange(_SIZE_PX) + 0.5) / _SIZE_PX * 2 - 1
    per_mm = photo.width / (photo.distance_to_mm - photo.distance_from_mm)
    column = (middle[0] + half * grid - photo.distance_from_mm) * per_mm - 0.5
    turns = (middle[1] + half / radius_mm * grid - photo.azimuth_from_rad) / (2 * np.pi)
    picture = _seen(photo, column, np.mod(turns * photo.height - 0.5, photo.height))
    corner = (outline - middle) * [1, radius_mm] / half * _SIZE_PX / 2 + _SIZE_PX / 2
    for colour, thick in ((_HALO_BGR, 5), (_OUTLINE_BGR, 2)):
        cv2.polylines(picture, [np.round(corner * 8).astype(np.int32)], True, colour, thick, cv2.LINE_AA, 3)
    return _jpeg(picture)


def section_plot(wall: WallMap, overlays: Overlays, distance_mm: float, azimuth_rad: float) -> bytes:
    """Return the cross-section at a distance as SVG, deviations exaggerated twentyfold."""
    row = wall.row(distance_mm)
    nominal = overlays.nominal_radius_mm
    figure = Figure(figsize=(3.0, 3.0), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    for radius, colour, dashes in (
        (np.full(len(wall.azimuth_rad), nominal), "#6b7682", "--"),
        (overlays.reference_radius_mm, "#0a5ea8", "-"),
        (wall.radius_mm[row], "#16202b", "-"),
    ):
        shown = nominal + _EXAGGERATION * (np.append(radius, radius[:1]) - nominal)
        angle = np.append(wall.azimuth_rad, wall.azimuth_rad[:1])
        axes.plot(shown * np.cos(angle), shown * np.sin(angle), color=colour, ls=dashes, lw=1.0)
    axes.plot([0, nominal * np.cos(azimuth_rad)], [0, nominal * np.sin(azimuth_rad)], color="#b34700", lw=0.9)
    axes.set_aspect("equal")
    axes.invert_yaxis()
    axes.axis("off")
    return _svg(figure)


def _seen(photo: FlatPicture, column: Float, row: Float) -> Byte:
    """Return the picture at columns and rows, grey where nothing was textured."""
    x, y = np.meshgrid(column, row)
    first, last = int(np.clip(column.min() - 2, 0, photo.width - 1)), int(max(column.max() + 3, 1))
    part = photo.columns(first, last)
    seen = cv2.remap(
        np.concatenate([part, part[:1]]),
        (x - first).astype(np.float32),
        y.astype(np.float32),
        cv2.INTER_LINEAR,
    )
    alpha = seen[..., 3:].astype(float) / 255
    return np.ascontiguousarray(np.round(alpha * seen[..., :3] + (1 - alpha) * 200).astype(np.uint8))


def _jpeg(picture: Byte) -> bytes:
    encoded, jpeg = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
    if not encoded:
        raise OSError("a picture of a finding cannot be encoded")
    return jpeg.tobytes()


def _svg(figure: Figure) -> bytes:
    out = BytesIO()
    with rc_context({"svg.hashsalt": "boresight"}):  # or names inside would be random
        figure.savefig(out, format="svg", metadata={"Date": None, "Creator": None})
    return out.getvalue()


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
