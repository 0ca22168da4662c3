"""cloud.ply: the accumulated wall points."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Byte
from pipeline.artefacts.measured import PointCloud, Wall, WallTexture
from pipeline.export.unrolled import display_colours

_AT_ONCE = 1 << 20
_GREY = 128
_ROW = np.dtype(
    [
        *((name, "<f4") for name in ("x", "y", "z", "nx", "ny", "nz")),
        *((name, "u1") for name in ("red", "green", "blue")),
        *((name, "<f4") for name in ("sigma_mm", "radius_mm", "distance_mm", "azimuth_rad")),
        ("frame", "<i4"),
    ]
)
_PLY_TYPES = {"f4": "float", "u1": "uchar", "i4": "int"}


def write_cloud(wall: Wall, texture: WallTexture, folder: Path) -> None:
    """Write ``cloud.ply`` (binary, little endian), mm in P; grey where the wall has no photo."""
    points = len(wall.cloud.xyz_p)
    with (folder / "cloud.ply").open("wb") as stream:
        stream.write(_header(points).encode("ascii"))
        for start in range(0, points, _AT_ONCE):
            stream.write(_rows(_part(wall.cloud, slice(start, start + _AT_ONCE)), texture).tobytes())


def _part(cloud: PointCloud, points: slice) -> PointCloud:
    return PointCloud(*(getattr(cloud, f.name)[points] for f in fields(cloud)))


def _rows(cloud: PointCloud, texture: WallTexture) -> NDArray[np.void]:
    row = np.zeros(len(cloud.xyz_p), _ROW)
    for i, axis in enumerate("xyz"):
        row[axis], row[f"n{axis}"] = cloud.xyz_p[:, i], cloud.normal_p[:, i]
    for name in ("sigma_mm", "radius_mm", "distance_mm", "azimuth_rad", "frame"):
        row[name] = getattr(cloud, name)
    row["blue"], row["green"], row["red"] = point_colours(cloud, texture).T
    return row


def point_colours(cloud: PointCloud, texture: WallTexture) -> Byte:
    """Return the display colours BGR (M, 3) of the texels next to the points."""
    rows, columns = texture.bgra.shape[:2]
    i = np.rint((cloud.distance_mm - texture.distance_from_mm) / texture.mm_per_px).astype(np.int64)
    j = np.rint((cloud.azimuth_rad - texture.azimuth_from_rad) / texture.rad_per_px).astype(np.int64)
    bgra = texture.bgra[np.clip(i, 0, rows - 1), j % columns]
    seen = (i >= 0) & (i < rows) & (bgra[:, 3] > 0)
    return np.where(seen[:, None], display_colours(bgra)[:, :3], _GREY).astype(np.uint8)


def _header(points: int) -> str:
    properties = [f"property {_PLY_TYPES[_ROW[name].str[1:]]} {name}" for name in _ROW.names or ()]
    lines = [
        "ply",
        "format binary_little_endian 1.0",
        "comment boresight: mm, pipe frame (x right, y down, z along)",
        f"element vertex {points}",
        *properties,
        "end_header",
    ]
    return "\n".join(lines) + "\n"
