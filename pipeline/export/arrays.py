"""Measured arrays as files: cloud.ply, radius_map.npz and rings.zarr."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any
from zipfile import ZIP_DEFLATED, ZipFile

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Byte
from pipeline.artefacts.measured import PointCloud, RingSamples, RingValidity, Wall, WallTexture

# Points written at a time (50 bytes each), to limit memory.
_AT_ONCE = 1 << 20
# Colour of points without a photo: middle grey.
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
    """Return the colours BGR (M, 3) of the texels next to the points."""
    rows, columns = texture.bgra.shape[:2]
    i = np.rint((cloud.distance_mm - texture.distance_from_mm) / texture.mm_per_px).astype(np.int64)
    j = np.rint((cloud.azimuth_rad - texture.azimuth_from_rad) / texture.rad_per_px).astype(np.int64)
    bgra = texture.bgra[np.clip(i, 0, rows - 1), j % columns]
    seen = (i >= 0) & (i < rows) & (bgra[:, 3] > 0)
    return np.where(seen[:, None], bgra[:, :3], _GREY).astype(np.uint8)


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


def write_radius_map(wall: Wall, folder: Path) -> None:
    """Write ``radius_map.npz``; NaN where nothing was seen."""
    radius = wall.radius_map
    places, measured = ("distance_mm", "azimuth_rad"), ("radius_mm", "sigma_mm", "count")
    arrays = {n: getattr(radius, n) for n in (*places, *measured, "sigma_random_mm", "misalignment_mm")}
    # Compression level 1: NumPy's default of 6 needs 2.5 times as long for 1 % less.
    with ZipFile(folder / "radius_map.npz", "w", ZIP_DEFLATED, compresslevel=1) as archive:
        rows = {"displaced_mm": radius.displaced_in(), "kernel_mm": radius.kernel_in()}
        for name, values in (arrays | rows).items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as stream:
                np.lib.format.write_array(stream, np.asanyarray(values))


if TYPE_CHECKING:
    import zarr

# Frames in a chunk of the store.
_FRAMES_PER_CHUNK = 64


def write_rings(rings: RingSamples, folder: Path) -> None:
    """Write ``rings.zarr``: laser frames × azimuth, with the meaning of every array in its attributes."""
    # zarr is slow to import, so it is imported only when it is needed.
    import zarr

    group = zarr.open_group(folder / "rings.zarr", mode="w")
    group.attrs.update(
        {
            "format": 1,
            "centre_px": [float(c) for c in rings.centre_px],
            "validity_codes": {v.name.lower(): int(v) for v in RingValidity},
        }
    )
    tables = {
        "radius_px": (rings.radius_px, "line position along the azimuth, px"),
        "sigma_px": (rings.sigma_px, "1 sigma of the position from image noise, px"),
        "line_width_px": (rings.width_px, "1 sigma of the line's profile, px"),
        "amplitude": (rings.amplitude, "height above the background, grey levels"),
        "valid": (rings.valid, "true where the sample may be used"),
        "validity": (rings.validity, "why a sample is not used, see validity_codes"),
        "frame": (rings.frame, "frame number of each row"),
        "azimuth_rad": (rings.azimuth_rad, "image azimuth of each column about centre_px, rad"),
    }
    for name, (values, meaning) in tables.items():
        _write_array(group, name, np.asarray(values), meaning)


def _write_array(group: zarr.Group, name: str, values: NDArray[Any], meaning: str) -> None:
    chunks = (min(_FRAMES_PER_CHUNK, max(1, len(values))), *values.shape[1:]) if values.ndim > 1 else None
    array = group.create_array(name, data=values, chunks=chunks or "auto")
    array.attrs["description"] = meaning
