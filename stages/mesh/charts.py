"""Cuts a surface in charts, unrolls them, and packs them in atlases by xatlas."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xatlas
from numpy.typing import NDArray

from pipeline.arrays import Bool, Float, Float32
from pipeline.geometry.axis import PipeAxis, frames_at, to_pipe
from stages.mesh.surface import Face, Index, Surface

# Texels between charts: three halvings of a texture do not mix them.
PADDING_PX = 8
# A chart spans at most a quarter turn, so that it is nearly flat.
_LEAST_SECTORS = 4
# Departure from the reference radius, relative, from which a triangle is not unrolled: as `mesh.fold`.
_LARGEST_FOLD = 0.35
# Cosine between a triangle's normal and the axis below which unrolling stretches it to three times its
# size.
_LEAST_FACING = 0.35


@dataclass(frozen=True)
class Unrolled:
    """A surface's triangles on the unrolled wall.

    Attributes
    ----------
    distance_mm, azimuth_rad : (T, 3)
        Pipe coordinates of the corners. The azimuths of a triangle are unwrapped: they may run beyond ±π.
    folded : (T,) bool
        Triangles that cannot be unrolled: edge-on as seen from the axis, or far from the reference radius.
    reference_mm : float
        Median radius.
    """

    distance_mm: Float
    azimuth_rad: Float
    folded: Bool
    reference_mm: float


@dataclass(frozen=True)
class Chart:
    """A piece of the surface with its own flat coordinates.

    Attributes
    ----------
    face : (T,) int
        Numbers of its triangles.
    corner : (T, 3) int
        Vertices of its triangles, numbered within the chart.
    vertex : (V,) int
        Their numbers among the surface's vertices.
    xy_mm : (V, 2)
        Flat coordinates.
    origin : (2,) or None
        Azimuth and distance of the flat origin of an unrolled chart, whose x is azimuth times the reference
        radius and whose y is distance; None where xatlas flattened the chart.
    """

    face: Index
    corner: Index
    vertex: Index
    xy_mm: Float
    origin: tuple[float, float] | None


@dataclass(frozen=True)
class Atlas:
    """Charts packed in one texture of ``size_px`` (width, height).

    ``corner_px`` holds, for each chart, the (V, 2) texture coordinates of its vertices in px; the centre of
    the top left texel is at (0.5, 0.5).
    """

    charts: tuple[Chart, ...]
    corner_px: tuple[Float, ...]
    size_px: tuple[int, int]


def unroll(surface: Surface, axis: PipeAxis) -> Unrolled:
    """Return where the triangles of a surface lie on the unrolled wall."""
    distance, azimuth, radius = to_pipe(axis, surface.vertex_p)
    inward = (frames_at(axis, distance)[0] - surface.vertex_p) / radius[:, None]
    a, b, c = np.moveaxis(surface.vertex_p[surface.face], 1, 0)
    normal = np.cross(b - a, c - a)
    facing = np.einsum("ti,ti->t", normal, inward[surface.face].mean(axis=1))
    facing /= np.maximum(np.linalg.norm(normal, axis=1), 1e-30)
    reference = float(np.median(radius))
    away = np.abs(radius[surface.face].mean(axis=1) / reference - 1)
    turn = azimuth[surface.face]
    turn = turn[:, :1] + (turn - turn[:, :1] + np.pi) % (2 * np.pi) - np.pi
    folded = (facing < _LEAST_FACING) | (away > _LARGEST_FOLD)
    return Unrolled(distance[surface.face], turn, folded, reference)


def tile_length(wished_mm: float, radius_mm: float, texel_mm: float, atlas_px: int) -> float:
    """Return the length of tiles, mm: as requested, or shorter if their atlas would become too large.

    The charts are near square, so half of the atlas is a safe share to fill.
    """
    return float(min(wished_mm, 0.5 * (atlas_px * texel_mm) ** 2 / (2 * np.pi * radius_mm)))


def tile_count(length_mm: float, tile_mm: float) -> int:
    """Return the number of tiles of one length into which a pipe is cut."""
    return max(1, round(length_mm / tile_mm))


def cut_charts(unrolled: Unrolled, surface: Surface, tile_mm: float, texel_mm: float) -> list[list[Chart]]:
    """Return the charts of every tile, in order of distance.

    Triangles that face the axis at about the reference radius are unrolled, in sectors as wide as a tile is
    long; folded parts, such as a branch, are flattened by xatlas.
    """
    tile, tiles = _tile_numbers(unrolled.distance_mm, tile_mm)
    sectors = max(_LEAST_SECTORS, int(np.ceil(2 * np.pi * unrolled.reference_mm / tile_mm)))
    around = unrolled.azimuth_rad.mean(axis=1) / (2 * np.pi) + 0.5
    sector = np.where(unrolled.folded, sectors, np.floor(around * sectors).astype(int) % sectors)
    charts: list[list[Chart]] = [[] for _ in range(tiles)]
    for number in np.unique(tile * (sectors + 1) + sector):
        chosen = np.flatnonzero(tile * (sectors + 1) + sector == number)
        folded = number % (sectors + 1) == sectors
        chart = _flattened(surface, chosen, texel_mm) if folded else _unrolled(unrolled, surface.face, chosen)
        charts[number // (sectors + 1)].append(chart)
    return [c for c in charts if c]


def pack(charts: list[Chart], texel_mm: float) -> Atlas:
    """Return the charts packed by xatlas, which is given their bounding boxes: they never overlap."""
    low = [c.xy_mm.min(axis=0) for c in charts]
    # xatlas takes two meshes at one address for the same mesh, so all arrays are kept until packing is done.
    boxes = [_box(np.maximum(c.xy_mm.max(axis=0) - o, texel_mm)) for c, o in zip(charts, low, strict=True)]
    packer = xatlas.Atlas()
    for corner, face in boxes:
        packer.add_uv_mesh(corner, face)
    packer.generate(xatlas.ChartOptions(), _pack_options(texel_mm))
    size = np.array([packer.width, packer.height])
    place = [(packer.get_mesh(i)[2] * size).min(axis=0) for i in range(len(charts))]
    px = tuple(p + (c.xy_mm - o) / texel_mm for p, c, o in zip(place, charts, low, strict=True))
    width, height = np.maximum(size, np.ceil(np.max([p.max(axis=0) for p in px], axis=0))).astype(int)
    return Atlas(tuple(charts), px, (int(width), int(height)))


def _box(size: Float) -> tuple[Float32, NDArray[np.uint32]]:
    """Return corners and triangles of a rectangle."""
    corner = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * size
    return corner.astype(np.float32), np.array([[0, 1, 2], [0, 2, 3]], np.uint32)


def _tile_numbers(distance_mm: Float, tile_mm: float) -> tuple[Index, int]:
    """Return the tile of each triangle and how many tiles of one length there are."""
    low, high = float(distance_mm.min()), float(distance_mm.max())
    tiles = tile_count(high - low, tile_mm)
    tile = (tiles * (distance_mm.mean(axis=1) - low) / max(high - low, 1e-9)).astype(np.int64)
    return np.minimum(tile, tiles - 1), tiles


def _unrolled(unrolled: Unrolled, face: Face, chosen: Index) -> Chart:
    """Return an analytic chart: x = reference radius × azimuth, y = distance, from the chart's middle."""
    vertex, first, corner = np.unique(face[chosen], return_index=True, return_inverse=True)
    azimuth, distance = unrolled.azimuth_rad[chosen].ravel(), unrolled.distance_mm[chosen].ravel()
    middle = float(np.angle(np.exp(1j * azimuth).mean())), float(distance.mean())
    turn = (azimuth[first] - middle[0] + np.pi) % (2 * np.pi) - np.pi
    xy = np.stack([unrolled.reference_mm * turn, distance[first] - middle[1]], -1)
    return Chart(chosen, corner.reshape(-1, 3), vertex.astype(np.int64), xy, middle)


def _flattened(surface: Surface, chosen: Index, texel_mm: float) -> Chart:
    """Return a chart flattened by xatlas, which may cut it further; padding lies between its parts."""
    vertex, corner = np.unique(surface.face[chosen], return_inverse=True)
    flattener = xatlas.Atlas()
    flattener.add_mesh(surface.vertex_p[vertex].astype(np.float32), corner.reshape(-1, 3).astype(np.uint32))
    flattener.generate(xatlas.ChartOptions(), _pack_options(texel_mm))
    source, split, uv = flattener.get_mesh(0)
    xy = uv * np.array([flattener.width, flattener.height]) * texel_mm
    return Chart(chosen, split.astype(np.int64), vertex[source].astype(np.int64), xy.astype(float), None)


def _pack_options(texel_mm: float) -> xatlas.PackOptions:
    options = xatlas.PackOptions()
    options.texels_per_unit = 1 / texel_mm
    options.padding = PADDING_PX
    options.bruteForce = False
    options.rotate_charts = False
    options.rotate_charts_to_axis = False
    return options
