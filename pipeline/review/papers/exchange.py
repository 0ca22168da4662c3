"""Accepted findings in the formats of other programs and standards: POF, PACP and EN 13508-2.

Codes are suggestions from the shape: they do not replace a coded inspection by a certified inspector.
"""

from __future__ import annotations

import csv
from io import StringIO
from typing import Any

import numpy as np

from pipeline.artefacts.findings import DefectKind
from pipeline.artefacts.model import Overlays
from pipeline.pages import notation
from pipeline.review.decisions.replay import ACCEPTED
from pipeline.review.review import Review, State
from pipeline.review.tables import csv_text, findings_table

# The pipe tally of the Pipeline Operators Forum, "Specifications and requirements for in-line inspection of
# pipelines", version 2016, appendix 6: all its columns, in its order and with its units. The edition of 2021,
# POF 100, names some of them otherwise; the comment of every row says which edition it is.
POF_COLUMNS = (
    "Log distance [m]", "Latitude", "Longitude", "Altitude [m]", "Feature type", "Feature identification",
    "Comment / Cluster ID", "Girth weld Nr", "Joint manufacturing type", "Joint / component length [m]",
    "Internal diameter [mm]", "Nominal thickness [mm]", "Measured/reference thickness [mm]", "Ovality [%]",
    "Bend Y/N", "Abs. Dist. to upstream weld [m]", "Clock position seam weld / anomaly", "Surface location",
    "Inward/outward", "Depth / height [%.D or mm]", "Size (length x width) [mm]", "Mean depth [%.t or mm]",
    "Max. depth [%.t or mm]", "Length [mm]", "Width [mm]", "Anomaly dimension classification",
    "ERF (metal losses)", "Reference table for performance", "Comments",
)  # fmt: skip
_POF_EDITION = "POF 2016, appendix 6"
_POF_TYPE = {DefectKind.DEPOSIT: "Additional metal/material", DefectKind.WELD: "Weld"}
_POF_FEATURE = {
    DefectKind.PIT: "Corrosion", DefectKind.CORROSION: "Corrosion", DefectKind.GOUGE: "Gouge",
    DefectKind.CRACK: "Crack", DefectKind.DENT: "Dent", DefectKind.DEPOSIT: "Debris",
    DefectKind.WELD: "",
}  # fmt: skip
_POF_CLASS = {
    "general": "GENE", "pitting": "PITT", "pinhole": "PINH", "axial grooving": "AXGR",
    "axial slotting": "AXSL", "circumferential grooving": "CIGR", "circumferential slotting": "CISL",
}  # fmt: skip
# 80 % of a normal distribution lie within this many σ: at this certainty POF states tolerances (clause 6).
_80_PERCENT = 1.2816

# Columns of the table Conditions of NASSCO's standard exchange database, PACP 7.
PACP_COLUMNS = (
    "ConditionID", "InspectionID", "Distance", "Counter", "PACP_Code", "Continuous", "Value_1st_Dimension",
    "Value_2nd_Dimension", "Value_Percent", "Joint", "Clock_At_From", "Clock_To", "Remarks", "VCR_Time",
)  # fmt: skip

# Header and observation fields of EN 13508-2:2003+A1:2011, tables B.2, B.3, C.1 to C.3, that a run can fill.
EN_HEADER = ("AAA", "AAK", "AAM", "AAP", "ABA", "ABC", "ABF", "ABH", "ABQ", "ACB", "ACC")
EN_COLUMNS = ("I", "A", "B", "C", "D", "E", "G", "H", "J", "F")
_EN_FILE = ("ISO-8859-1", "en", ";", ".", '"', "2010")
# From this length on, PACP and EN 13508-2 code where a defect starts and where it ends: 1 m.
_CONTINUOUS_MM = 1000.0


def pof_text(review: Review, state: State) -> bytes:
    """Return the accepted findings as a pipe tally of POF; data that a run cannot provide is empty."""
    wall, bore = state.assumed.wall_thickness_mm, 2 * review.files.artefact(Overlays).nominal_radius_mm
    return csv_text([_pof(row, wall, bore) for row in _accepted(review, state)], POF_COLUMNS).encode(
        "utf-8-sig"
    )


def _accepted(review: Review, state: State) -> list[dict[str, Any]]:
    return [row for row in findings_table(review, state) if row["status"] == ACCEPTED]


def _pof(row: dict[str, Any], wall_mm: float | None, bore_mm: float) -> dict[str, Any]:
    kind = DefectKind(row["kind"])
    entry: dict[str, Any] = dict.fromkeys(POF_COLUMNS) | {
        "Log distance [m]": _metres(row), "Feature type": _POF_TYPE.get(kind, "Anomaly"),
        "Feature identification": _POF_FEATURE[kind], "Comment / Cluster ID": f"Finding {row['label']}",
        "Internal diameter [mm]": bore_mm, "Nominal thickness [mm]": wall_mm,
        "Clock position seam weld / anomaly": _pof_clock(row["clock"] or row["clock_from"]),
        "Surface location": "" if kind is DefectKind.WELD else "Int", "Comments": _pof_comment(row),
    }  # fmt: skip
    if kind is DefectKind.DENT:
        return entry | _pof_deformation(row)
    return entry | _pof_loss(row, wall_mm) if kind.is_metal_loss else entry


def _pof_deformation(row: dict[str, Any]) -> dict[str, Any]:
    depth = row["depth_mm"]
    way = {} if depth is None else {
        "Inward/outward": "Inw" if depth < 0 else "Outw", "Depth / height [%.D or mm]": f"{abs(depth)} mm",
    }  # fmt: skip
    return way | {"Size (length x width) [mm]": f"{row['length_mm']:.0f}x{row['width_mm']:.0f}"}


def _pof_loss(row: dict[str, Any], wall_mm: float | None) -> dict[str, Any]:
    """Return depth in % of the wall if that is stated; none if no loss was measured: see the comment."""
    depth, deep = row["depth_mm"], ""
    if depth is not None and depth > 0:
        deep = f"{100 * depth / wall_mm:.1f}%" if wall_mm else f"{depth} mm"
    return {
        "Max. depth [%.t or mm]": deep, "Length [mm]": row["length_mm"], "Width [mm]": row["width_mm"],
        "Anomaly dimension classification": _POF_CLASS.get(row["pof_class"], ""),
        "ERF (metal losses)": "Not calculated",
    }  # fmt: skip


def _pof_clock(clock: str) -> str:
    """Return a clock position as POF writes it: half past twelve is 0:30."""
    hours, minutes = clock.split(":")
    return f"{int(hours) % 12}:{minutes}"


def _pof_comment(row: dict[str, Any]) -> str:
    sigma = row["depth_sigma_mm"]
    tolerance = "" if sigma is None else f"; depth ± {_80_PERCENT * sigma:.3f} mm at 80 % certainty"
    return f"{_comment(row)}{tolerance} ({_POF_EDITION})"


def pacp_text(review: Review, state: State) -> bytes:
    """Return the accepted findings as rows of PACP's table Conditions; distances in metres."""
    bore = 2 * review.files.artefact(Overlays).nominal_radius_mm
    rows = [part for row in _accepted(review, state) for part in _pacp(row, bore)]
    numbered = [row | {"ConditionID": k, "InspectionID": 1, "Counter": k} for k, row in enumerate(rows, 1)]
    return csv_text(numbered, PACP_COLUMNS).encode("utf-8-sig")


def _pacp(row: dict[str, Any], bore_mm: float) -> list[dict[str, Any]]:
    first, last = _whole_hours(row)
    entry: dict[str, Any] = dict.fromkeys(PACP_COLUMNS, None) | {
        "PACP_Code": row["pacp"].split(" ")[0], "Value_Percent": _percent(row, bore_mm),
        "Clock_At_From": first, "Clock_To": last, "Remarks": _comment(row),
    }  # fmt: skip
    return [entry | {"Distance": at, "Continuous": mark} for at, mark in _ends(row, "S01", "F01")]


def en13508_text(review: Review, state: State) -> bytes:
    """Return the accepted findings as a file of EN 13508-2: blocks A, B01 and C, with a start and an end."""
    bore = 2 * review.files.artefact(Overlays).nominal_radius_mm
    distance = review.files.artefact(Overlays).distance_mm
    facts = state.described
    header = (
        facts.line or review.files.record()["recording"]["name"], "A", facts.client, facts.site,
        "EN 13508-2:2003+A1:2011", "A", facts.date, facts.operator,
        round(float(np.ptp(distance)) / 1000, 3), round(bore), round(bore),
    )  # fmt: skip
    seen = [row for found in _accepted(review, state) for row in _en(found, bore)]
    out = StringIO()
    out.writelines(f"#A{k}={text}\n" for k, text in enumerate(_EN_FILE, 1))
    table = csv.writer(out, delimiter=";", lineterminator="\n")
    out.write(f"#B01={';'.join(EN_HEADER)}\n")
    table.writerow(header)
    out.write(f"#C={';'.join(EN_COLUMNS)}\n")
    table.writerows(["" if v is None else v for v in (row[c] for c in EN_COLUMNS)] for row in seen)
    out.write("#Z\n")
    return out.getvalue().encode("iso-8859-1", errors="replace")


def _en(row: dict[str, Any], bore_mm: float) -> list[dict[str, Any]]:
    kind = DefectKind(row["kind"])
    first, last = _whole_hours(row)
    one, two = _characterised(kind, row)
    is_narrowing = kind in (DefectKind.DENT, DefectKind.DEPOSIT)
    entry: dict[str, Any] = dict.fromkeys(EN_COLUMNS, None) | {
        "A": row["en13508"].split(" ")[0], "B": one, "C": two,
        "D": _percent(row, bore_mm) if is_narrowing else None,
        "G": first, "H": last, "F": _comment(row),
    }  # fmt: skip
    return [entry | {"I": at, "J": mark} for at, mark in _ends(row, "A1", "B1")]


def _characterised(kind: DefectKind, row: dict[str, Any]) -> tuple[str, str]:
    """Return characterisations 1 and 2; Z (other) with a remark where the shape alone does not decide."""
    if kind is DefectKind.CRACK:
        direction = {"CL": "A", "CC": "B", "CS": "D"}[row["pacp"].split(" ")[0]]
        return "B", direction
    if kind is DefectKind.DENT:
        return ("A" if _whole_hours(row)[0] in (11, 12, 1, 5, 6, 7) else "B"), ""
    return ("" if kind is DefectKind.WELD else "Z"), ("E" if kind.is_metal_loss else "")


def _percent(row: dict[str, Any], bore_mm: float) -> int | None:
    """Return the narrowing of the bore by a dent, or of its area by a deposit at most, in whole per cent."""
    kind, depth = DefectKind(row["kind"]), row["depth_mm"]
    if depth is None or kind not in (DefectKind.DENT, DefectKind.DEPOSIT):
        return None
    share = abs(depth) / bore_mm
    if kind is DefectKind.DEPOSIT:
        share = abs(depth) * row["width_mm"] / (np.pi * bore_mm**2 / 4)
    return max(1, round(100 * float(share)))


def _whole_hours(row: dict[str, Any]) -> tuple[int, int | None]:
    """Return the start and end of a finding on the clock in whole hours; 12 and 12 all round."""
    first, last = (_hour(row[name]) for name in ("clock_from", "clock_to"))
    if row["clock_from"] == row["clock_to"]:
        return 12, 12
    return first, None if first == last else last


def _hour(clock: str) -> int:
    hours, minutes = clock.split(":")
    return round(int(hours) + int(minutes) / 60 - 1) % 12 + 1


def _ends(row: dict[str, Any], start: str, end: str) -> list[tuple[float, str | None]]:
    """Return the place of a finding, m: its peak, or start and end with their marks if it is long."""
    if row["length_mm"] < _CONTINUOUS_MM:
        return [(_metres(row), None)]
    return [(round(row["distance_from_mm"] / 1000, 3), start), (round(row["distance_to_mm"] / 1000, 3), end)]


def _metres(row: dict[str, Any]) -> float:
    at = row["distance_mm"]
    middle = (row["distance_from_mm"] + row["distance_to_mm"]) / 2
    return round(float(middle if at is None else at) / 1000, 4)


def _comment(row: dict[str, Any]) -> str:
    """Return number, kind and size in words: the codes do not hold millimetres."""
    depth = notation.depth(row["depth_mm"], row["depth_sigma_mm"])
    size = f"{row['label']}: {row['kind']}, {depth}, {row['length_mm']} x {row['width_mm']} mm"
    return f"{size}. {row['remarks']}" if row["remarks"] else size
