"""Reads the files that a run is verified against: another map of the radius, a mesh or a cloud of the wall.

Commands read the files; the stages take the objects that these functions return.
"""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.arrays import Float, Int
from pipeline.artefacts.wall_map import WallMap
from pipeline.errors import InputError
from pipeline.system.native import open3d

_MAP_KEYS = ("distance_mm", "azimuth_rad", "radius_mm")
_POINT_FIELDS = ("x", "y", "z", "nx", "ny", "nz", "sigma_mm", "distance_mm", "azimuth_rad")
# The map of 100 m of pipe (200 000 × 720 cells of 24 bytes) unpacks to 3.5 GB; a larger one would fill the
# memory.
LARGEST_UNPACKED_BYTES = 4 << 30
SURFACE_SUFFIXES = (".ply", ".obj", ".stl", ".off", ".glb", ".gltf", ".pcd", ".xyz")


@dataclass(frozen=True)
class WallPoints:
    """Points (M, 3) of a run's wall in P, outward normals (M, 3), pipe coordinates and σ (M,)."""

    xyz_p: Float
    outward_p: Float
    distance_mm: Float
    azimuth_rad: Float
    sigma_mm: Float


@dataclass(frozen=True)
class ReferenceSurface:
    """Vertices (V, 3), in the unit of the file, and triangles (T, 3); no triangles for a cloud of points."""

    vertices: Float
    triangles: Int


def read_wall_map(path: Path) -> WallMap:
    """Read a radius map: a .npz, or a folder (a run, a truth folder) with exactly one .npz that holds one.

    Raises
    ------
    InputError
        If there is none, there are several, or it is malformed.
    """
    file = map_file(path)
    with _opened(file) as content:
        arrays = {
            k: np.asarray(content[k], float)
            for k in content.files
            if k in (*_MAP_KEYS, "displaced_mm") or k.startswith("sigma")
        }
    missing = [k for k in _MAP_KEYS if k not in arrays]
    if missing:
        raise InputError(file, f"lacks {', '.join(missing)}", expected=f"arrays {', '.join(_MAP_KEYS)}")
    distance, azimuth, radius = (arrays[k] for k in _MAP_KEYS)
    _check_grid(file, distance, azimuth, radius)
    sigma = arrays.get("sigma_mm", np.zeros_like(radius))
    random, displaced = arrays.get("sigma_random_mm", sigma), arrays.get("displaced_mm")
    if displaced is not None and displaced.shape != distance.shape:
        raise InputError(file, f"displaced_mm is {displaced.shape}", place="displaced_mm",
                         expected=f"{len(distance)} numbers, one for each distance")  # fmt: skip
    return WallMap(distance, azimuth, radius, sigma, random, displaced_mm=displaced)


def read_wall_points(run: Path, at_most: int = 200_000) -> WallPoints:
    """Read the points of ``cloud.ply`` of a run folder, evenly thinned to ``at_most``."""
    file = run / "cloud.ply"
    if not file.is_file():
        raise InputError(file, "is missing", expected="a run folder with a point cloud",
                         hint="complete the run: boresight run RECORDING -o RUN")  # fmt: skip
    from plyfile import PlyData, PlyParseError

    try:
        vertex = PlyData.read(str(file))["vertex"].data
    except (PlyParseError, OSError, KeyError, ValueError, EOFError, MemoryError) as error:
        raise InputError(file, f"is not a point cloud: {error}") from error
    missing = [name for name in _POINT_FIELDS if name not in (vertex.dtype.names or ())]
    if missing:
        raise InputError(
            file, f"lacks {', '.join(missing)}", expected=f"points with {' '.join(_POINT_FIELDS)}"
        )
    vertex = vertex[:: max(1, -(-len(vertex) // at_most))]
    azimuth = np.asarray(vertex["azimuth_rad"], float)
    normal = np.stack([vertex[f"n{axis}"] for axis in "xyz"], -1).astype(float)
    across = np.stack([np.cos(azimuth), np.sin(azimuth)], -1)
    outward = normal * np.where((normal[:, :2] * across).sum(-1) < 0, -1.0, 1.0)[:, None]
    xyz = np.stack([vertex[axis] for axis in "xyz"], -1).astype(float)
    sigma = np.asarray(vertex["sigma_mm"], float)
    return WallPoints(xyz, outward, np.asarray(vertex["distance_mm"], float), azimuth, sigma)


def read_surface(file: Path) -> ReferenceSurface:
    """Read a mesh or a cloud of points, in the file's own unit.

    Raises
    ------
    InputError
        If the file holds neither.
    """
    o3d = open3d()
    quiet = o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error)
    with quiet:
        mesh = o3d.io.read_triangle_mesh(str(file))
        triangles = np.asarray(mesh.triangles, np.int64).reshape(-1, 3)
        vertices = np.asarray(mesh.vertices, float)
        if len(triangles) == 0:
            vertices = np.asarray(o3d.io.read_point_cloud(str(file)).points, float)
    if len(vertices) < 100 or not np.isfinite(vertices).all():
        raise InputError(
            file, f"holds {len(vertices)} usable points", expected="a mesh or a cloud of the pipe's wall"
        )
    return ReferenceSurface(vertices, triangles)


def map_file(path: Path) -> Path:
    """Return the file of a radius map: itself, or the only one in a folder; see `read_wall_map`."""
    return path if path.is_file() else _only_map(path)


def _only_map(folder: Path) -> Path:
    if not folder.is_dir():
        raise InputError(folder, "does not exist", expected="a file, a run folder or a truth folder")
    found = []
    for file in sorted(folder.glob("*.npz")):
        with _opened(file) as content:
            if all(key in content.files for key in _MAP_KEYS):
                found.append(file)
    if len(found) != 1:
        names = ", ".join(f.name for f in found) or "none"
        raise InputError(
            folder, f"{len(found)} radius maps found: {names}",
            expected=f"one .npz with {', '.join(_MAP_KEYS)}", hint="name the file itself",
        )  # fmt: skip
    return found[0]


@contextmanager
def _opened(file: Path) -> Iterator[np.lib.npyio.NpzFile]:
    """Open an archive of arrays; any error in it, here or when an array is read, names the file."""
    expected = "a NumPy .npz archive"
    try:
        with file.open("rb") as stream:
            content = np.load(stream, allow_pickle=False)
            if not isinstance(content, np.lib.npyio.NpzFile):
                raise InputError(file, "is not an archive", expected=expected)
            _refuse_bomb(file, content)
            yield content
    except (OSError, ValueError, zipfile.BadZipFile, zlib.error, EOFError, MemoryError,
            NotImplementedError) as error:  # fmt: skip
        raise InputError(file, f"cannot be read: {error}", expected=expected) from error


def _refuse_bomb(file: Path, content: np.lib.npyio.NpzFile) -> None:
    """Refuse an archive that unpacks to more than memory should hold."""
    unpacked = sum(entry.file_size for entry in content.zip.infolist()) if content.zip is not None else 0
    if unpacked > LARGEST_UNPACKED_BYTES:
        expected = f"at most {LARGEST_UNPACKED_BYTES} bytes"
        raise InputError(file, f"unpacks to {unpacked} bytes", expected=expected)


def _check_grid(file: Path, distance: Float, azimuth: Float, radius: Float) -> None:
    if radius.shape != (len(distance), len(azimuth)) or min(radius.shape) < 4:
        raise InputError(file, f"radius_mm is {radius.shape}", place="radius_mm",
                         expected=f"{len(distance)} × {len(azimuth)}, at least 4 × 4")  # fmt: skip
    for name, axis in (("distance_mm", distance), ("azimuth_rad", azimuth)):
        step = np.diff(axis)
        # A thousandth of a step: coordinates stored in single precision vary by that much.
        if not (np.isfinite(axis).all() and step.min() > 0 and np.ptp(step) < 1e-3 * step.mean()):
            raise InputError(file, "is not uniform and increasing", place=name)
    if not np.isfinite(radius).any():
        raise InputError(file, "holds no measured radius", place="radius_mm")
