"""Bakes the wall's photo and error colours into the texture atlas of a tile, and stores finished tiles."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np

from pipeline.arrays import Bool, Byte, Float, Float32
from pipeline.artefacts.measured import WallTexture
from pipeline.artefacts.model import VARIANTS, ErrorTexture, MeshTile, Overlays, PackedTiles
from pipeline.machine.scratch import Scratch, Spool
from pipeline.system.native import open3d
from stages.mesh.charts import PADDING_PX, Atlas, Chart, Unrolled
from stages.mesh.surface import Surface

# Error colours vary slowly: their texels are three times as large as the photo's.
_ERROR_COARSER = 3
_UNTEXTURED = 128  # middle grey


@dataclass(frozen=True)
class TexelPlaces:
    """Pipe coordinates of texels, each (H, W): distance, azimuth from −π to π, and whether wall is there."""

    distance_mm: Float32
    azimuth_rad: Float32
    on_wall: Bool


def bake_tile(
    atlas: Atlas,
    surface: Surface,
    normal_p: Float,
    unrolled: Unrolled,
    texture: WallTexture,
    overlays: Overlays,
    texel_mm: float,
) -> MeshTile:
    """Return the tile of an atlas' charts with its textures."""
    vertex = np.concatenate([c.vertex for c in atlas.charts])
    starts = np.cumsum([0, *(len(c.vertex) for c in atlas.charts)])
    face = np.concatenate([c.corner + s for c, s in zip(atlas.charts, starts, strict=False)])
    uv = np.concatenate(atlas.corner_px) / np.array(atlas.size_px)
    fine = texel_places(atlas, unrolled, texel_mm, 1)
    coarse = texel_places(atlas, unrolled, texel_mm, _ERROR_COARSER)
    return MeshTile(
        surface.vertex_p[vertex].astype(np.float32),
        normal_p[vertex].astype(np.float32),
        uv.astype(np.float32),
        face.astype(np.int32),
        _photo(texture, fine),
        _errors(overlays, coarse),
        _span(unrolled.distance_mm[np.concatenate([c.face for c in atlas.charts])]),
    )


def _span(distance_mm: Float) -> tuple[float, float]:
    return float(distance_mm.min()), float(distance_mm.max())


def texel_places(atlas: Atlas, unrolled: Unrolled, texel_mm: float, coarser: int) -> TexelPlaces:
    """Return where on the wall each texel of the atlas lies, ``coarser`` times larger texels than packed."""
    size = [max(1, round(n / coarser)) for n in atlas.size_px]
    step = np.array(atlas.size_px) / size
    distance = np.full((size[1], size[0]), unrolled.distance_mm[atlas.charts[0].face[0], 0], np.float32)
    azimuth, on_wall = np.zeros_like(distance), np.zeros(distance.shape, bool)
    for chart, px in zip(atlas.charts, atlas.corner_px, strict=True):
        low = np.maximum(np.floor((px.min(axis=0) - PADDING_PX / 2) / step), 0).astype(int)
        high = np.minimum(np.ceil((px.max(axis=0) + PADDING_PX / 2) / step), size).astype(int)
        box = (slice(low[1], high[1]), slice(low[0], high[0]))
        x, y = ((np.arange(low[i], high[i]) + 0.5) * step[i] for i in (0, 1))
        turned, distance[box] = _chart_places(chart, px, x, y, unrolled, texel_mm)
        azimuth[box], on_wall[box] = (turned + np.pi) % (2 * np.pi) - np.pi, True
    return TexelPlaces(distance, azimuth, on_wall)


def _chart_places(
    chart: Chart, px: Float, x: Float, y: Float, unrolled: Unrolled, texel_mm: float
) -> tuple[Float, Float]:
    """Return azimuth and distance at texture columns ``x`` (W,) and rows ``y`` (H,), px, to be broadcast."""
    if chart.origin is None:
        return _nearest_places(chart, px, x, y, unrolled)
    flat = chart.xy_mm[0] - px[0] * texel_mm
    azimuth = chart.origin[0] + (x * texel_mm + flat[0]) / unrolled.reference_mm
    distance = chart.origin[1] + y * texel_mm + flat[1]
    return azimuth, distance[:, None]


def _nearest_places(chart: Chart, px: Float, x: Float, y: Float, unrolled: Unrolled) -> tuple[Float, Float]:
    """Return azimuth and distance of the points of a flattened chart next to each texel (by open3d)."""
    corner = np.dstack([px[chart.corner], np.zeros(chart.corner.shape)]).reshape(-1, 3).astype(np.float32)
    scene = open3d().t.geometry.RaycastingScene()
    scene.add_triangles(corner, np.arange(len(corner), dtype=np.uint32).reshape(-1, 3))
    texel = np.dstack([*np.meshgrid(x, y), np.zeros((len(y), len(x)))]).astype(np.float32)
    found = scene.compute_closest_points(texel)
    face = chart.face[found["primitive_ids"].numpy().astype(np.int64)]
    uv = found["primitive_uvs"].numpy().astype(float)
    weight = np.dstack([1 - uv.sum(-1), uv])
    return (
        np.einsum("hwk,hwk->hw", weight, unrolled.azimuth_rad[face]),
        np.einsum("hwk,hwk->hw", weight, unrolled.distance_mm[face]),
    )


def _photo(texture: WallTexture, places: TexelPlaces) -> Byte:
    """Return the photo (H, W, 3) at texels."""
    rows, columns = texture.bgra.shape[:2]
    row = (places.distance_mm - texture.distance_from_mm) / texture.mm_per_px
    first = int(np.clip(row.min() - 1, 0, rows - 1))
    last = int(np.clip(row.max() + 2, first + 1, rows))
    picture = texture.bgra[first:last, :, :3].copy()
    picture[texture.bgra[first:last, :, 3] == 0] = _UNTEXTURED
    column = _columns(places.azimuth_rad, texture.azimuth_from_rad, texture.rad_per_px, columns)
    sampled = _sampled(picture, column, np.clip(row, first, last - 1) - first, cv2.INTER_LINEAR)
    sampled[~places.on_wall | (row < -0.5) | (row > rows - 0.5)] = _UNTEXTURED
    return sampled


def _columns(azimuth_rad: Float32, from_rad: float, step_rad: float, columns: int) -> Float32:
    """Return azimuths in px from the first of ``columns``, between 0 and ``columns``."""
    column = (azimuth_rad - np.float32(from_rad)) / np.float32(step_rad)
    return np.asarray(np.add(column, columns, out=column, where=column < 0), np.float32)


def _sampled(picture: Byte, column: Float32, row: Float32, method: int) -> Byte:
    """Return a picture that goes on from its last column to its first, at places (H, W)."""
    around = np.concatenate([picture, picture[:, :1]], axis=1)
    rows = row.astype(np.float32, copy=False)
    return np.asarray(cv2.remap(around, column, rows, method, borderMode=cv2.BORDER_REPLICATE))


def _errors(overlays: Overlays, places: TexelPlaces) -> tuple[ErrorTexture, ...]:
    """Return the levels of the overlays at texels; 0 off the wall and where nothing was measured."""
    shown = [overlays.of_variant(v) for v in VARIANTS[1:]]
    rows, columns = shown[0].level.shape
    spacing = (overlays.distance_mm[-1] - overlays.distance_mm[0]) / max(rows - 1, 1)
    row = (places.distance_mm - overlays.distance_mm[0]) / spacing
    column = _columns(places.azimuth_rad, overlays.azimuth_rad[0], 2 * np.pi / columns, columns)
    levels = [_sampled(overlay.level, column, row, cv2.INTER_NEAREST) for overlay in shown]
    return tuple(
        ErrorTexture(variant, overlay.palette_bgr, level * places.on_wall)
        for variant, overlay, level in zip(VARIANTS[1:], shown, levels, strict=True)
    )


_ARRAYS: dict[str, tuple[str, tuple[int, ...]]] = {
    "vertex_p": ("f4", (3,)), "normal_p": ("f4", (3,)), "uv": ("f4", (2,)), "face": ("i4", (3,)),
    "photo": ("u1", ()), "level": ("u1", ()),
}  # fmt: skip


@dataclass
class TilePacker:
    """Writes tiles, given in order of distance, to the disk and keeps only where they lie there."""

    scratch: Scratch
    _spools: dict[str, Spool] = field(init=False)
    _tiles: list[tuple[int, ...]] = field(default_factory=list)
    _distance: list[tuple[float, float]] = field(default_factory=list)
    _variants: tuple[str, ...] = ()
    _palettes: list[Byte] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._spools = {name: self.scratch.spool(*kind) for name, kind in _ARRAYS.items()}
        self._note((0, 0), (0, 0))

    def add(self, tile: MeshTile) -> None:
        """Put a tile on the disk."""
        for name in ("vertex_p", "normal_p", "uv", "face"):
            self._spools[name].append(getattr(tile, name))
        self._spools["photo"].append(tile.photo_bgr.ravel())
        for error in tile.errors:
            self._spools["level"].append(error.level.ravel())
        self._variants = tuple(e.variant for e in tile.errors)
        self._palettes = [e.palette_bgr for e in tile.errors]
        self._distance.append(tile.distance_mm)
        self._note(tile.photo_bgr.shape[:2], tile.errors[0].level.shape)

    def packed(self) -> PackedTiles:
        """Return all tiles."""
        arrays: dict[str, Any] = {name: spool.array() for name, spool in self._spools.items()}
        table = np.array(self._tiles, np.int64)
        return PackedTiles(
            **arrays,
            vertex_start=table[:, 0], face_start=table[:, 1], photo_start=table[:, 2],
            level_start=table[:, 3], photo_px=table[1:, 4:6], level_px=table[1:, 6:8],
            distance_mm=np.array(self._distance, float).reshape(-1, 2), variants=self._variants,
            palette_bgr=np.array(self._palettes, np.uint8).reshape(-1, 256, 3),
        )  # fmt: skip

    def _note(self, photo_px: tuple[int, ...], level_px: tuple[int, ...]) -> None:
        ends = [self._spools[name].count for name in ("vertex_p", "face", "photo", "level")]
        self._tiles.append((*ends, *photo_px, *level_px))
