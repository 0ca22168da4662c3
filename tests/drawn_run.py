"""Small complete recordings of a drawn pipe: textured or plain wall, LED light, laser ring, encoder."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np

from pipeline.arrays import Byte, Float, Float32, Int
from pipeline.artefacts.measured import RingPoints, RingSamples
from pipeline.geometry.rigid import from_parts, rotation_from_vector
from pipeline.instrument.camera.fisheye import KannalaBrandt
from pipeline.instrument.laser import LaserSheet
from pipeline.instrument.probe import Probe
from pipeline.recording.base import Encoder, FrameTable, PipeFacts, Recording
from stages.triangulate import TriangulateParameters, triangulate_rings
from tests.quiet import quiet_context
from tests.ring_images import MemorySource
from tests.unit.drawn_pipe import led_light

RADIUS, BASELINE = 50.0, 22.0
WallRadius = Callable[[Float, Float], Float]
_TEXEL_MM = 0.5


@dataclass(frozen=True)
class DrawnRun:
    """A recording, its probe, its rings and the true poses (N, 4, 4)."""

    recording: Recording
    probe: Probe
    rings: RingSamples
    points: RingPoints
    T_pc: Float


def small_probe() -> Probe:
    camera = KannalaBrandt((400, 300), (95.0, 95.0), (199.5, 149.5), (-0.01, 0.0, 0.0, 0.0))
    sigma = np.zeros(20)
    sigma[[0, 2, 3]], sigma[8] = 0.01, 0.005
    return Probe(camera, LaserSheet(BASELINE), np.diag(sigma**2))


def round_wall(s: Float, psi: Float) -> Float:
    """Return the radius (...) of a plain round pipe."""
    return RADIUS + 0 * psi


def drawn_run(
    z_mm: Float,
    roll_rad: Float,
    *,
    contrast: float = 0.35,
    encoder: bool = True,
    radius_at: WallRadius = round_wall,
) -> DrawnRun:
    """Draw a run whose laser and LED frames alternate; ``contrast`` 0 leaves the wall plain.

    ``radius_at`` must be a wall that each ray meets once, with slopes below a half.
    """
    probe, count = small_probe(), len(z_mm)
    T_pc = _poses(z_mm, roll_rad)
    light = np.array(["laser", "led"] * count)[:count]
    random = np.random.default_rng(0)
    wall = _texture(contrast)
    images = {k: _picture(probe, T_pc[k], wall, random, radius_at) for k in np.flatnonzero(light == "led")}
    rings = rings_on_wall(probe, T_pc, np.flatnonzero(light == "laser"), random, radius_at)
    points = triangulate_rings(rings, probe, TriangulateParameters(), quiet_context())
    time_s = np.arange(count) / 30
    readings = Encoder(time_s, np.round((z_mm - z_mm[0]) / 0.05) * 0.05) if encoder else None
    table = FrameTable(np.arange(count), time_s, light)
    source = MemorySource(images, probe.camera.image_size)
    facts = PipeFacts(2 * RADIUS)
    recording = Recording("drawn", "inspection", None, table, readings, facts, 30.0, source, None, "drawn")
    return DrawnRun(recording, probe, rings, points, T_pc)


def without_encoder(run: DrawnRun) -> DrawnRun:
    return replace(run, recording=replace(run.recording, encoder=None))


def _poses(z_mm: Float, roll_rad: Float) -> Float:
    t = np.linspace(0, 1, len(z_mm))
    turn = np.stack([0.01 * np.sin(5 * t), 0.008 * np.sin(4 * t), roll_rad], -1)
    origin = np.stack([0.8 * np.sin(3 * t), 0.5 * np.sin(4 * t), z_mm], -1)
    return from_parts(rotation_from_vector(turn), origin)


def _texture(contrast: float) -> Float32:
    """Return reflectance over distance −20 … 180 mm and azimuth −π … π (rows, columns)."""
    columns = round(2 * np.pi * RADIUS / _TEXEL_MM)
    white = np.random.default_rng(1).standard_normal((400, columns)).astype(np.float32)
    wide = np.concatenate([white[:, -30:], white, white[:, :30]], 1)
    smooth = cv2.GaussianBlur(wide, (0, 0), 2.5)[:, 30:-30]
    return (0.5 * (1 + contrast * smooth / smooth.std())).clip(0.02, 1).astype(np.float32)


def _picture(
    probe: Probe, T_pc: Float, wall: Float32, random: np.random.Generator, radius_at: WallRadius
) -> Byte:
    xyz = wall_hits(probe, T_pc, radius_at)
    row = ((xyz[..., 2] + 20) / _TEXEL_MM).astype(np.float32)
    column = ((np.arctan2(xyz[..., 1], xyz[..., 0]) + np.pi) * RADIUS / _TEXEL_MM).astype(np.float32)
    wide = np.concatenate([wall, wall[:, :2]], 1)
    seen = cv2.remap(wide, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    ahead = (xyz - T_pc[:3, 3]) @ T_pc[:3, 2]
    image = np.where(ahead > 5, seen * led_light(probe, T_pc, xyz) * 2.0e5, 0)
    return np.clip(np.rint(image + random.standard_normal(image.shape)), 0, 255).astype(np.uint8)


def wall_hits(probe: Probe, T_pc: Float, radius_at: WallRadius = round_wall) -> Float:
    """Return the point of the wall (H, W, 3), mm in P, that each pixel shows from a pose (4, 4)."""
    width, height = probe.camera.image_size
    uv = np.stack(np.meshgrid(np.arange(width), np.arange(height)), -1).astype(float)
    ray = probe.camera.unproject(uv).ray @ T_pc[:3, :3].T
    xyz = _on_cylinder(ray, T_pc[:3, 3])
    return xyz if radius_at is round_wall else _on_wall(xyz, ray, radius_at)


def _on_wall(xyz: Float, ray: Float, radius_at: WallRadius) -> Float:
    outward = np.maximum(np.hypot(ray[..., 0], ray[..., 1]), 1e-9)
    for _ in range(30):
        off = radius_at(xyz[..., 2], np.arctan2(xyz[..., 1], xyz[..., 0])) - np.hypot(
            xyz[..., 0], xyz[..., 1]
        )
        xyz = xyz + (0.5 * off / outward)[..., None] * ray
    return xyz


def _on_cylinder(ray_p: Float, origin: Float) -> Float:
    a = np.maximum(ray_p[..., 0] ** 2 + ray_p[..., 1] ** 2, 1e-9)
    b = ray_p[..., 0] * origin[0] + ray_p[..., 1] * origin[1]
    t = (-b + np.sqrt(b * b + a * (RADIUS**2 - origin[0] ** 2 - origin[1] ** 2))) / a
    return origin + t[..., None] * ray_p


def rings_on_wall(
    probe: Probe,
    T_pc: Float,
    frames: Int,
    random: np.random.Generator,
    radius_at: WallRadius = round_wall,
    sigma_px: float = 0.05,
    azimuths: int = 180,
) -> RingSamples:
    """Return where the sheet z = baseline meets the wall r(s, ψ), along image azimuths, with noise."""
    azimuth = np.linspace(-np.pi, np.pi, azimuths, endpoint=False)
    outward = np.stack([np.cos(azimuth), np.sin(azimuth), 0 * azimuth], -1)
    radius = np.empty((len(frames), azimuths), np.float32)
    for n, k in enumerate(frames):
        wall = _sheet_on_wall(T_pc[k], outward, radius_at)
        uv = probe.camera.project((wall - T_pc[k, :3, 3]) @ T_pc[k, :3, :3]).uv
        radius[n] = np.linalg.norm(uv - probe.camera.centre_px, axis=1)
    radius += (sigma_px * random.standard_normal(radius.shape)).astype(np.float32)
    full = lambda v: np.full(radius.shape, v, np.float32)  # noqa: E731
    validity = np.zeros(radius.shape, np.uint8)
    return RingSamples(
        frames, azimuth, probe.camera.centre_px, radius, full(sigma_px), full(1.2), full(100.0), validity
    )  # fmt: skip


def _sheet_on_wall(T_pc: Float, outward_c: Float, radius_at: WallRadius) -> Float:
    ray = outward_c @ T_pc[:3, :3].T
    source = T_pc[:3, 3] + BASELINE * T_pc[:3, 2]
    reach = np.full(len(ray), RADIUS)
    for _ in range(60):
        xyz = source + reach[:, None] * ray
        wall = radius_at(xyz[:, 2], np.arctan2(xyz[:, 1], xyz[:, 0]))
        reach = reach + 0.7 * (wall - np.hypot(xyz[:, 0], xyz[:, 1]))
    return source + reach[:, None] * ray
