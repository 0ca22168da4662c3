"""Tables for people: sections, defects and the trajectory as CSV and JSON."""

from __future__ import annotations

import csv
import json
import math
from dataclasses import fields
from pathlib import Path

import numpy as np

from pipeline.artefacts.findings import Defect, Defects, Sections
from pipeline.artefacts.measured import Trajectory
from pipeline.geometry.rigid import quaternion_from_rotation
from pipeline.pages import notation

_DEGREES = {"major_axis_rad": "major_axis_deg"}
_TABLE = (
    "id", "kind", "distance_from_mm", "distance_to_mm", "clock_from", "clock_to", "peak_distance_mm",
    "peak_clock", "length_mm", "width_mm", "depth_mm", "depth_sigma_mm", "wall_loss_percent", "probability",
    "confidence", "frames", "pof_class", "pacp_suggestion", "en13508_suggestion", "statement",
)  # fmt: skip


def write_sections(sections: Sections, folder: Path) -> None:
    """Write ``sections.csv``: a row a station; empty where too little was seen."""
    names = [f.name for f in fields(Sections)]
    columns = [np.degrees(getattr(sections, n)) if n in _DEGREES else getattr(sections, n) for n in names]
    with (folder / "sections.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([_DEGREES.get(n, n) for n in names])
        writer.writerows([_number(v) for v in row] for row in zip(*columns, strict=True))


def write_defects(defects: Defects, folder: Path) -> None:
    """Write ``defects`` and ``unconfirmed``, each as .csv and .json: lists in order of distance."""
    for name, items in (("defects", defects.items), ("unconfirmed", defects.unconfirmed)):
        records = [_record(d) for d in items]
        (folder / f"{name}.json").write_text(
            json.dumps(records, indent=1, allow_nan=False, ensure_ascii=False) + "\n", encoding="utf-8"
        )
        with (folder / f"{name}.csv").open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(_TABLE)
            writer.writerows([_cell(column, record[column]) for column in _TABLE] for record in records)


def _number(value: float) -> str:
    return f"{value:.6g}" if math.isfinite(value) else ""


def _record(defect: Defect) -> dict[str, object]:
    """Return the defect as JSON holds it; a number that is not known is null."""
    record: dict[str, object] = {}
    for f in fields(Defect):
        value = getattr(defect, f.name)
        if isinstance(value, float):
            value = round(value, 4) if math.isfinite(value) else None
        elif isinstance(value, np.ndarray):
            value = np.round(value, 4).tolist()
        record[f.name] = value
    return record


def _cell(column: str, value: object) -> str:
    """Return a cell's text; numbers of frames stand apart by blanks, clock positions are ``h:mm``."""
    if "clock" in column and isinstance(value, float):
        return notation.clock(value)
    if isinstance(value, list):
        return " ".join(str(v) for v in value)
    return "" if value is None else str(value)


_POSE = ("frame", "time_s", "x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")
_SIGMA = ("sigma_x_mm", "sigma_y_mm", "sigma_z_mm", "sigma_rx_rad", "sigma_ry_rad", "sigma_rz_rad")


def write_trajectory(trajectory: Trajectory, folder: Path) -> None:
    """Write ``trajectory.csv``: the camera in P; rotation sigmas are those of a rotation vector in C."""
    sigma = np.sqrt(np.diagonal(trajectory.covariance, axis1=-2, axis2=-1))
    quaternion = quaternion_from_rotation(trajectory.T_pc[:, :3, :3])
    values = np.column_stack([trajectory.time_s, trajectory.T_pc[:, :3, 3], quaternion, sigma])
    with (folder / "trajectory.csv").open("w", newline="", encoding="utf-8") as stream:
        rows = csv.writer(stream, lineterminator="\n")
        rows.writerow([*_POSE, *_SIGMA])
        rows.writerows(
            [int(f), *(f"{v:.9g}" for v in row)] for f, row in zip(trajectory.frame, values, strict=True)
        )
