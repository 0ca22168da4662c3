"""Tables for users: sections, defects, trajectory as CSV and JSON; the centreline as GeoJSON and DXF too."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path

import numpy as np

from pipeline.arrays import Float
from pipeline.artefacts.findings import Defect, Defects, Sections
from pipeline.artefacts.measured import Trajectory
from pipeline.artefacts.motion import PipePiece
from pipeline.geometry.axis import distance_along, frames_at
from pipeline.geometry.rigid import quaternion_from_rotation
from pipeline.pages import notation

_DEGREES = {"major_axis_rad": "major_axis_deg"}
_TABLE = (
    "id", "kind", "distance_from_mm", "distance_to_mm", "clock_from", "clock_to", "peak_distance_mm",
    "peak_clock", "length_mm", "width_mm", "depth_mm", "depth_sigma_mm", "wall_loss_percent", "probability",
    "confidence", "frames", "pof_class", "pacp_suggestion", "en13508_suggestion", "statement",
)  # fmt: skip


def write_sections(sections: Sections, folder: Path) -> None:
    """Write ``sections.csv``: one row for each station; cells are empty where too little was seen."""
    names = [f.name for f in fields(Sections)]
    columns = [np.degrees(getattr(sections, n)) if n in _DEGREES else getattr(sections, n) for n in names]
    with (folder / "sections.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([_DEGREES.get(n, n) for n in names])
        writer.writerows([_number(v) for v in row] for row in zip(*columns, strict=True))


def write_defects(defects: Defects, folder: Path) -> None:
    """Write ``defects`` and ``unconfirmed``, each as .csv and .json: lists in order of distance.

    Every finding states the limit of detection at its place; ``detectable.csv`` has those of the whole pipe.
    """
    _write_detectable(defects, folder)
    for name, items in (("defects", defects.items), ("unconfirmed", defects.unconfirmed)):
        records = [_record(d) | _limit(defects, d.peak_distance_mm) for d in items]
        (folder / f"{name}.json").write_text(
            json.dumps(records, indent=1, allow_nan=False, ensure_ascii=False) + "\n", encoding="utf-8"
        )
        with (folder / f"{name}.csv").open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(_TABLE)
            writer.writerows([_cell(column, record[column]) for column in _TABLE] for record in records)


_LIMIT = (
    "from_mm", "to_mm", "ring_spacing_mm", "size_mm", "depth_mm", "photo_size_mm", "measured_percent",
    "photo_percent",
)  # fmt: skip


def _write_detectable(defects: Defects, folder: Path) -> None:
    """Write ``detectable.csv``: a row for each stretch; cells are empty where nothing is found reliably."""
    with (folder / "detectable.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(_LIMIT)
        for d in defects.detectable:
            numbers = (d.from_mm, d.to_mm, d.ring_spacing_mm, d.size_mm, d.depth_mm, d.photo_size_mm)
            writer.writerow([_number(v) for v in (*numbers, 100 * d.measured, 100 * d.photo)])


def _limit(defects: Defects, distance_mm: float) -> dict[str, object]:
    """Return the size and the depth, mm, from which nine of ten defects are found there; null where none."""
    limit = defects.limit_at(distance_mm)
    known = {} if limit is None else {"size": limit.size_mm, "depth": limit.depth_mm}
    return {
        f"detectable_{name}_mm": round(known[name], 4) if math.isfinite(known.get(name, math.nan)) else None
        for name in ("size", "depth")
    }


def _number(value: float) -> str:
    return f"{value:.6g}" if math.isfinite(value) else ""


def _record(defect: Defect) -> dict[str, object]:
    """Return the defect for JSON; an unknown number is null."""
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
    """Return a cell's text: frame numbers separated by blanks, clock positions as ``h:mm``."""
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
    values = np.column_stack([trajectory.T_pc[:, :3, 3], quaternion, sigma])
    with (folder / "trajectory.csv").open("w", newline="", encoding="utf-8") as stream:
        rows = csv.writer(stream, lineterminator="\n")
        rows.writerow([*_POSE, *_SIGMA])
        rows.writerows(
            [int(f), f"{t:.6f}", *(f"{v:.9g}" for v in row)]
            for f, t, row in zip(trajectory.frame, trajectory.time_s, values, strict=True)
        )


_STEP_MM = 10.0
_MOST_POINTS = 5000
"""Points are 10 mm apart, in long pipes more: a drawing handles 5000 easily."""
_POINT = ("distance_mm", "x_mm", "y_mm", "z_mm", "sigma_x_mm", "sigma_y_mm", "sigma_z_mm", "piece")
_PIECE = (
    "kind", "from_mm", "to_mm", "length_mm", "sigma_mm", "angle_deg", "angle_sigma_deg", "toward_clock",
    "radius_mm", "radius_sigma_mm", "standard",
)  # fmt: skip


def write_centreline(trajectory: Trajectory, folder: Path) -> None:
    """Write ``centreline.csv``, ``.geojson`` and ``.dxf``, and ``route.csv``: straight lengths and bends."""
    distance, xyz, sigma = _points(trajectory)
    pieces = trajectory.pieces or (_undecided(float(distance[0]), float(distance[-1])),)
    with (folder / "centreline.csv").open("w", newline="", encoding="utf-8") as stream:
        rows = csv.writer(stream, lineterminator="\n")
        rows.writerow(_POINT)
        for s, p, u in zip(distance, xyz, sigma, strict=True):
            rows.writerow([*(_decimal(v) for v in (s, *p, *u)), _piece_at(pieces, float(s))])
    with (folder / "route.csv").open("w", newline="", encoding="utf-8") as stream:
        rows = csv.writer(stream, lineterminator="\n")
        rows.writerow(_PIECE)
        rows.writerows(_row(piece) for piece in pieces)
    document = json.dumps(_geojson(pieces, distance, xyz), indent=1, allow_nan=False)
    (folder / "centreline.geojson").write_text(document + "\n", encoding="utf-8")
    (folder / "centreline.dxf").write_text("\n".join(_dxf(pieces, distance, xyz)) + "\n", encoding="ascii")


def _points(trajectory: Trajectory) -> tuple[Float, Float, Float]:
    """Return distances (n,), points (n, 3) in P and their 1 σ (n, 3) over the camera's path, mm."""
    s = distance_along(trajectory.axis, trajectory.T_pc)
    first, last = float(s.min()), float(s.max())
    step = max(_STEP_MM, (last - first) / _MOST_POINTS)
    distance = np.linspace(first, last, max(int(np.ceil((last - first) / step)), 1) + 1)
    order = np.argsort(s, kind="stable")
    own = np.sqrt(np.diagonal(trajectory.covariance, axis1=1, axis2=2)[order, :3])
    sigma = np.stack([np.interp(distance, s[order], own[:, i]) for i in range(3)], -1)
    return distance, frames_at(trajectory.axis, distance)[0], sigma


def _undecided(from_mm: float, to_mm: float) -> PipePiece:
    """Return the whole way as one piece, where it is too short to tell a bend from a straight length."""
    return PipePiece("undecided", from_mm, to_mm, math.nan, math.nan, math.nan)


def _piece_at(pieces: tuple[PipePiece, ...], distance_mm: float) -> str:
    return next((p.kind for p in pieces if distance_mm <= p.to_mm), pieces[-1].kind)


def _row(piece: PipePiece) -> list[str]:
    # Azimuth atan2(y, x) with y down; 12 o'clock is −y.
    clock = (math.degrees(piece.toward_rad) + 90) % 360 / 30
    numbers = (
        piece.from_mm, piece.to_mm, piece.to_mm - piece.from_mm, piece.sigma_mm,
        math.degrees(piece.angle_rad), math.degrees(piece.angle_sigma_rad), clock, piece.radius_mm,
        piece.radius_sigma_mm,
    )  # fmt: skip
    return [piece.kind, *(_decimal(v) for v in numbers), piece.standard]


def _decimal(value: float) -> str:
    """Return six digits, at most six of them decimals, so that a rounding error reads 0; unknown is empty."""
    return f"{round(value, 6) + 0.0:.6g}" if math.isfinite(value) else ""


def _parts(
    pieces: tuple[PipePiece, ...], distance: Float, xyz: Float
) -> Iterator[tuple[PipePiece, list[list[float]]]]:
    """Yield each piece with its points, mm; neighbours share the one where they meet."""
    for piece in pieces:
        inside = (distance >= piece.from_mm) & (distance <= piece.to_mm)
        places = np.unique(np.concatenate([[piece.from_mm], distance[inside], [piece.to_mm]]))
        line = np.stack([np.interp(places, distance, xyz[:, i]) for i in range(3)], -1)
        yield piece, np.round(line, 3).tolist()


def _geojson(pieces: tuple[PipePiece, ...], distance: Float, xyz: Float) -> dict[str, object]:
    """Return a feature for each piece: as in RFC 7946, but in metres of P, without a place on a map."""
    features = []
    for piece, line in _parts(pieces, distance, xyz):
        properties = {name: text for name, text in zip(_PIECE, _row(piece), strict=True) if text}
        metres = [[round(v / 1000, 6) for v in point] for point in line]
        geometry = {"type": "LineString", "coordinates": metres}
        features.append({"type": "Feature", "properties": properties, "geometry": geometry})
    frame = "metres in the pipe's frame P: x right, y down, z along the pipe at its start"
    return {"type": "FeatureCollection", "coordinate_frame": frame, "features": features}


def _dxf(pieces: tuple[PipePiece, ...], distance: Float, xyz: Float) -> Iterator[str]:
    """Yield the lines of a DXF drawing (release 12): a polyline in mm for each piece, by kind on layers."""
    yield from ("0", "SECTION", "2", "HEADER", "9", "$ACADVER", "1", "AC1009", "0", "ENDSEC")
    yield from ("0", "SECTION", "2", "ENTITIES")
    for piece, line in _parts(pieces, distance, xyz):
        layer = piece.kind.upper()
        yield from ("0", "POLYLINE", "8", layer, "66", "1", "70", "8", "10", "0", "20", "0", "30", "0")
        for x, y, z in line:
            yield from ("0", "VERTEX", "8", layer, "70", "32")
            yield from ("10", f"{x:.3f}", "20", f"{y:.3f}", "30", f"{z:.3f}")
        yield from ("0", "SEQEND", "8", layer)
    yield from ("0", "ENDSEC", "0", "EOF")
