"""Pictures of the textured mesh by ray casting, for report and README; they need no graphics driver."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from pipeline.arrays import Byte, Float, Int
from pipeline.artefacts.model import MeshTile, TexturedMesh
from pipeline.system.native import open3d

_GAMMA = 2.2
_SUPERSAMPLING = 2
_LIGHTS = 6
_AMBIENT = 0.12
_WHITE_QUANTILE = 0.99
_WHITE = 0.9
_GROUND_BGR = (0.01, 0.01, 0.01)


@dataclass(frozen=True)
class View:
    """A pinhole camera and the lights of a picture.

    Attributes
    ----------
    eye_p, target_p, up_p : (3,)
        Position, point looked at, and upward direction of the picture, in P.
    field_of_view_rad : float
        Over the picture's width.
    light_p : (L, 3)
        Point lights, in P.
    """

    eye_p: Float
    target_p: Float
    up_p: Float
    field_of_view_rad: float
    light_p: Float


@dataclass(frozen=True)
class _Hits:
    """What rays (N,) hit: distance, tile (−1: nothing), face within the tile, barycentric weights (N, 3)."""

    distance: Float
    tile: Int
    face: Int
    weight: Float


def inside_view(mesh: TexturedMesh, field_of_view_rad: float = 1.45) -> View:
    """Return the view from the start of the pipe forward along its axis, with lights above it."""
    start, end = _middle(mesh.tiles[0], 0.06, first=True), _middle(mesh.tiles[-1], 0.06, first=False)
    radius = float(np.median(np.linalg.norm((mesh.tiles[0].vertex_p - start)[:, :2], axis=1)))
    up = np.array([0.0, -1.0, 0.0])
    along = np.linspace(0.0, 1.0, _LIGHTS)[:, None]
    lights = start + along * (end - start) + 0.2 * radius * up
    eye = start - 0.1 * radius * up
    return View(eye, start + 0.6 * (end - start), up, field_of_view_rad, lights)


def outside_view(mesh: TexturedMesh, field_of_view_rad: float = 0.6) -> View:
    """Return the view of the whole pipe from outside, from above and beside."""
    vertex = np.concatenate([t.vertex_p[::50] for t in mesh.tiles]).astype(float)
    centre, size = vertex.mean(axis=0), float(np.linalg.norm(np.ptp(vertex, axis=0)))
    away = np.array([0.75, -0.5, -0.55])
    eye = centre + away / np.linalg.norm(away) * size / (2 * np.tan(field_of_view_rad / 2)) * 1.15
    up = np.array([0.0, -1.0, 0.0])
    return View(eye, centre, up, field_of_view_rad, np.stack([eye + size * up, eye]))


def render_inside(mesh: TexturedMesh, width_px: int = 1280, height_px: int = 720) -> Byte:
    """Return a picture (H, W, 3) BGR of the photo-textured wall, seen from inside."""
    return render(mesh, inside_view(mesh), width_px, height_px)


def render(mesh: TexturedMesh, view: View, width_px: int, height_px: int, variant: str = "photo") -> Byte:
    """Return a picture (H, W, 3) BGR of the model; the photo is shaded, error colours are not."""
    width, height = width_px * _SUPERSAMPLING, height_px * _SUPERSAMPLING
    ray = _rays(view, width, height)
    hits = _cast(mesh, view.eye_p, ray)
    colour = np.tile(np.array(_GROUND_BGR), (len(ray), 1))
    for number, tile in enumerate(mesh.tiles):
        on_tile = np.flatnonzero(hits.tile == number)
        albedo = _texels(tile, hits, on_tile, variant)
        if variant == "photo":
            point = view.eye_p + ray[on_tile] * hits.distance[on_tile, None]
            albedo = albedo * _light(tile, hits, on_tile, point, ray[on_tile], view)[:, None]
        colour[on_tile] = albedo
    met = hits.tile >= 0
    if variant == "photo" and met.any():
        colour[met] *= _WHITE / max(float(np.quantile(colour[met], _WHITE_QUANTILE)), 1e-6)
    picture = cv2.resize(
        colour.reshape(height, width, 3), (width_px, height_px), interpolation=cv2.INTER_AREA
    )
    return np.asarray(np.rint(255 * np.clip(picture, 0, 1) ** (1 / _GAMMA)).astype(np.uint8))


def _rays(view: View, width: int, height: int) -> Float:
    """Return unit rays (height × width, 3) in P, row by row."""
    forward = view.target_p - view.eye_p
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, view.up_p)
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    half = np.tan(view.field_of_view_rad / 2)
    x = half * (2 * (np.arange(width) + 0.5) / width - 1)
    y = half * (2 * (np.arange(height) + 0.5) / height - 1) * height / width
    ray = forward + x[None, :, None] * right + y[:, None, None] * down
    return np.asarray(ray / np.linalg.norm(ray, axis=-1, keepdims=True)).reshape(-1, 3)


def _cast(mesh: TexturedMesh, eye_p: Float, ray: Float) -> _Hits:
    scene = open3d().t.geometry.RaycastingScene()
    for tile in mesh.tiles:
        scene.add_triangles(tile.vertex_p, tile.face.astype(np.uint32))
    origin = np.broadcast_to(eye_p, ray.shape)
    found = scene.cast_rays(np.concatenate([origin, ray], axis=1).astype(np.float32))
    distance = found["t_hit"].numpy().astype(float)
    uv = found["primitive_uvs"].numpy().astype(float)
    tile_number = np.where(np.isfinite(distance), found["geometry_ids"].numpy().astype(np.int64), -1)
    face = found["primitive_ids"].numpy().astype(np.int64)
    return _Hits(distance, tile_number, face, np.column_stack([1 - uv.sum(1), uv]))


def _texels(tile: MeshTile, hits: _Hits, rays: Int, variant: str) -> Float:
    """Return linear colours (N, 3) of a variant where rays hit."""
    if variant == "photo":
        picture = tile.photo_bgr
    else:
        error = next(e for e in tile.errors if e.variant == variant)
        picture = error.palette_bgr[error.level]
    uv = np.einsum("nk,nkj->nj", hits.weight[rays], tile.uv[tile.face[hits.face[rays]]])
    px = uv * [picture.shape[1], picture.shape[0]] - 0.5
    step = 32000  # cv2.remap takes maps shorter than 32768
    parts = [
        cv2.remap(
            picture,
            px[i : i + step, :1].astype(np.float32),
            px[i : i + step, 1:].astype(np.float32),
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        )
        for i in range(0, len(px), step)
    ]
    sampled = np.concatenate(parts).reshape(-1, 3) if parts else np.zeros((0, 3))
    return np.asarray((sampled / 255.0) ** _GAMMA)


def _light(tile: MeshTile, hits: _Hits, rays: Int, point: Float, ray: Float, view: View) -> Float:
    """Return the brightness (N,) of matt wall under all lights, on the side that faces the viewer."""
    normal = np.einsum("nk,nkj->nj", hits.weight[rays], tile.normal_p[tile.face[hits.face[rays]]])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    normal = np.where(np.sum(normal * ray, axis=1, keepdims=True) > 0, -normal, normal)
    total = np.zeros(len(rays))
    for light in view.light_p:
        toward = light - point
        far = np.linalg.norm(toward, axis=1)
        total += np.maximum(np.sum(normal * toward, axis=1) / far, 0) / far**2
    return np.asarray(total + _AMBIENT * np.median(total) if len(total) else total)


def _middle(tile: MeshTile, share: float, *, first: bool) -> Float:
    """Return the middle of the wall near one end of a tile; vertices go by distance within a few percent."""
    along = tile.vertex_p[:, 2]
    edge = np.quantile(along, share if first else 1 - share)
    ring = tile.vertex_p[along <= edge] if first else tile.vertex_p[along >= edge]
    return np.asarray((ring.max(axis=0).astype(float) + ring.min(axis=0)) / 2)
