"""Coarse levels of the model: a grid over the radius map, photo and error colours reduced level by level.

A grid is as good as decimation here, because a coarse level is a nearly regular tube.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np

from pipeline.arrays import Byte, Float, Float32, Int
from pipeline.artefacts.measured import RadiusMap, WallTexture
from pipeline.artefacts.model import VARIANTS, ErrorTexture, MeshTile, Overlays
from pipeline.geometry.axis import PipeAxis, from_pipe

# A tube keeps at least 36 facets (10°): its chord errs by 0.4 % of the radius.
_LEAST_COLUMNS = 36
# Every fourth cell is tested for the level's error: viewers only choose a level by it.
_TESTED = 4
# Colour where there is no photo: middle grey.
_GREY = 128


@dataclass(frozen=True)
class Flat:
    """Pictures of a stretch, unrolled: rows along distance, columns around from −π.

    Attributes
    ----------
    bgra : (H, W, 4) uint8
        Photo for the screen; alpha 0 where there is none.
    levels : tuple of (h, w) uint8
        Error colours, in the order of the variants.
    """

    bgra: Byte
    levels: tuple[Byte, ...]


@dataclass(frozen=True)
class CoarseTile:
    """A tile, the stretch of each of its vertices (V,), and the error of its wall, mm."""

    tile: MeshTile
    stretch: Int
    error_mm: float


def flat_of(texture: WallTexture, overlays: Overlays, from_mm: float, to_mm: float) -> Flat:
    """Return a stretch's pictures at full resolution; transparent where there is no photo."""
    ends = (np.array([from_mm, to_mm]) - texture.distance_from_mm) / texture.mm_per_px
    first = round(float(ends[0]))
    last = max(round(float(ends[1])), first + 1)
    bgra = np.zeros((last - first, texture.bgra.shape[1], 4), np.uint8)
    low, high = max(first, 0), min(last, len(texture.bgra))
    if high > low:
        bgra[low - first : high - first] = texture.bgra[low:high]
    rows = slice(*np.searchsorted(overlays.distance_mm, [from_mm - 1e-6, to_mm + 1e-6]))
    return Flat(bgra, tuple(overlays.of_variant(v).level[rows] for v in VARIANTS[1:]))


def joined(parts: Sequence[Flat]) -> Flat:
    """Return pictures of stretches that follow each other as one."""
    levels = [np.concatenate(v) for v in zip(*(p.levels for p in parts), strict=True)]
    return Flat(np.concatenate([p.bgra for p in parts]), tuple(levels))


def shrunk(flat: Flat, width_px: int, height_px: int, step: int) -> Flat:
    """Return pictures with the photo of a given size and every ``step``-th cell of the error colours."""
    both = flat.bgra.astype(np.float32)
    both[..., 3] /= 255
    both[..., :3] *= both[..., 3:]
    size = max(width_px, 1), max(height_px, 1)
    small = np.asarray(cv2.resize(both, size, interpolation=cv2.INTER_AREA), np.float32)
    covered = small[..., 3:]
    np.divide(small[..., :3], np.maximum(covered, 1e-6), out=small[..., :3])
    covered[:] = np.where(covered > 0.5, np.float32(255), np.float32(0))
    np.rint(np.clip(small, 0, 255, out=small), out=small)
    levels = tuple(level[::step, ::step] for level in flat.levels)
    return Flat(small.astype(np.uint8), levels)


def coarse_tile(
    radius_map: RadiusMap, axis: PipeAxis, borders: Sequence[int], stride: int, flat: Flat, overlays: Overlays
) -> CoarseTile:
    """Return the wall between rows ``borders`` (n + 1) on a grid of about every ``stride``-th cell.

    Between two borders lies a stretch; its vertices are its own, so that each triangle is of one stretch.
    """
    s = radius_map.distance_mm
    span = (float(s[borders[0]]), float(s[borders[-1]]))
    slabs = [_slab(radius_map, axis, rows, stride, span) for rows in pairwise(borders)]
    starts = np.cumsum([0, *(len(p.vertex_p) for p in slabs)])
    photo = np.where(flat.bgra[..., 3:] > 0, flat.bgra[..., :3], _GREY).astype(np.uint8)
    palettes = [overlays.of_variant(v).palette_bgr for v in VARIANTS[1:]]
    tile = MeshTile(
        np.concatenate([p.vertex_p for p in slabs]).astype(np.float32),
        np.concatenate([p.normal_p for p in slabs]).astype(np.float32),
        np.concatenate([p.uv for p in slabs]).astype(np.float32),
        np.concatenate([p.face + k for p, k in zip(slabs, starts, strict=False)]).astype(np.int32),
        photo, tuple(map(ErrorTexture, VARIANTS[1:], palettes, flat.levels)), span,
    )  # fmt: skip
    stretch = np.repeat(np.arange(len(slabs)), np.diff(starts))
    return CoarseTile(tile, stretch, max(p.error_mm for p in slabs))


@dataclass(frozen=True)
class _Slab:
    """A stretch's vertices (V, 3), normals (V, 3), texture places (V, 2) and triangles (T, 3)."""

    vertex_p: Float
    normal_p: Float
    uv: Float
    face: Int
    error_mm: float


def _slab(
    radius_map: RadiusMap, axis: PipeAxis, ends: tuple[int, int], stride: int, span: tuple[float, float]
) -> _Slab:
    count = max(int(np.ceil((ends[1] - ends[0]) / stride)), 1)
    row = np.rint(np.linspace(*ends, count + 1)).astype(np.int64)
    step = _column_step(radius_map.radius_mm.shape[1], stride)
    radius = _means(radius_map.radius_mm, row, stride // 2, step)
    distance = radius_map.distance_mm[row]
    psi = np.append(radius_map.azimuth_rad[::step], radius_map.azimuth_rad[0] + 2 * np.pi)
    wide = np.concatenate([radius, radius[:, :1]], 1)
    xyz = from_pipe(axis, distance[:, None], psi, np.nan_to_num(wide))
    u = np.broadcast_to(np.linspace(0, 1, len(psi)), wide.shape)
    v = np.broadcast_to(((distance - span[0]) / max(span[1] - span[0], 1e-9))[:, None], wide.shape)
    error = _largest_error(radius_map.radius_mm, row, step, wide)
    known = np.isfinite(wide).ravel()
    kept = np.cumsum(known) - 1
    face = _faces(*wide.shape)
    face = kept[face[known[face].all(1)]]
    normal = _normals(xyz)
    return _Slab(
        xyz.reshape(-1, 3)[known], normal[known], np.stack([u, v], -1).reshape(-1, 2)[known], face, error
    )  # fmt: skip


def _column_step(columns: int, stride: int) -> int:
    """Return the largest step not beyond the stride that divides the columns and leaves enough of them."""
    steps = [d for d in range(1, stride + 1) if columns % d == 0 and columns // d >= _LEAST_COLUMNS]
    return max(steps, default=1)


def _means(radius_mm: Float32, row: Int, half: int, step: int) -> Float:
    """Return the means (n, m) of measured values around some cells; NaN where nothing was measured."""
    out = np.full((len(row), radius_mm.shape[1] // step), np.nan)
    for k, i in enumerate(row):
        block = np.roll(radius_mm[max(i - half, 0) : i + half + 1], step // 2, 1).astype(float)
        block = block.reshape(len(block), -1, step)
        seen = np.isfinite(block)
        count = seen.sum((0, 2))
        np.divide(np.where(seen, block, 0).sum((0, 2)), count, out=out[k], where=count > 0)
    return out


def _largest_error(radius_mm: Float32, row: Int, step: int, coarse: Float) -> float:
    """Return the largest difference of the fine map from the coarse one, mm, tested at every fourth cell."""
    rows = np.arange(row[0], row[-1] + 1, _TESTED)
    columns = np.arange(0, radius_mm.shape[1], _TESTED)
    i = np.clip(np.searchsorted(row, rows, side="right") - 1, 0, len(row) - 2)
    j = columns // step
    a = ((rows - row[i]) / np.maximum(row[i + 1] - row[i], 1))[:, None]
    b = (columns / step - j)[None]
    top = coarse[i][:, j] * (1 - b) + coarse[i][:, j + 1] * b
    low = coarse[i + 1][:, j] * (1 - b) + coarse[i + 1][:, j + 1] * b
    off = np.abs(radius_mm[np.ix_(rows, columns)] - (top * (1 - a) + low * a))
    return float(np.max(off, where=np.isfinite(off), initial=0.0))


def _faces(rows: int, columns: int) -> Int:
    """Return the triangles of a grid, counter-clockwise seen from inside."""
    number = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = number[:-1, :-1], number[:-1, 1:], number[1:, :-1], number[1:, 1:]
    return np.concatenate([np.stack(t, -1).reshape(-1, 3) for t in ((a, c, b), (b, c, d))])


def _normals(xyz: Float) -> Float:
    """Return unit normals (V, 3) of a grid (n, m, 3), toward the inside."""
    normal = np.cross(np.gradient(xyz, axis=0), np.gradient(xyz, axis=1)).reshape(-1, 3)
    return np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12))
