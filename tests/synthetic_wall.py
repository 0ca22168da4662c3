"""Synthetic walls: radius maps with correlated noise and randomly drawn defects."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from pipeline.artefacts.measured import PointCloud, RadiusMap, Wall, WallTexture
from pipeline.geometry.axis import PipeAxis, straight_axis
from pipeline.recording.base import FrameTable, PipeFacts, Recording
from stages.texture.surface import WallSurface


class NoFrames:
    """A frame source without frames."""

    image_size = (1600, 1200)

    def read(self, frames, planes):
        return iter(())


def bare_recording(nominal_diameter_mm=101.6, wall_thickness_mm=None, name="drawn"):
    table = FrameTable(np.arange(3), np.arange(3) / 30, np.array(["both"] * 3))
    facts = PipeFacts(nominal_diameter_mm, wall_thickness_mm)
    return Recording(name, "inspection", Path(name), table, None, facts, 30.0, NoFrames(), None, "key")


def wall_of(distance_mm, azimuth_rad, radius_mm, sigma_random_mm=0.03, sigma_mm=0.08):
    """Return a straight wall with one cloud point in each cell, whose frame is its row number."""
    shape = radius_mm.shape
    full = lambda v: np.full(shape, v, np.float32)  # noqa: E731
    radius_map = RadiusMap(
        distance_mm, azimuth_rad, radius_mm.astype(np.float32), full(sigma_mm), full(sigma_random_mm),
        np.isfinite(radius_mm).astype(np.int64), full(0.0),
    )  # fmt: skip
    s, psi = (g.ravel().astype(np.float32) for g in np.meshgrid(distance_mm, azimuth_rad, indexing="ij"))
    r = radius_mm.ravel().astype(np.float32)
    inward = np.stack([-np.cos(psi), -np.sin(psi), 0 * psi], -1)
    xyz = np.stack([r * np.cos(psi), r * np.sin(psi), s], -1)
    frame = np.repeat(np.arange(shape[0]), shape[1])
    cloud = PointCloud(xyz, inward, full(sigma_mm).ravel(), r, s, psi, frame)
    ends = np.array([distance_mm[0] - 50, distance_mm[-1] + 50])
    origin = np.stack([0 * ends, 0 * ends, ends], -1)
    return Wall(cloud, radius_map, PipeAxis(ends, origin, np.tile(np.eye(3), (2, 1, 1))))


def grey_texture(wall):
    """Return a plain grey photo of the wall."""
    s, psi = wall.radius_map.distance_mm, wall.radius_map.azimuth_rad
    bgra = np.full((len(s), len(psi), 4), 128, np.uint8)
    return WallTexture(bgra, float(s[0]), float(s[1] - s[0]), float(psi[0]), float(psi[1] - psi[0]))


def smooth_noise(rng, shape, sigma, cells):
    """Return Gaussian noise of 1 σ ``sigma`` blurred by ``cells`` cells, periodic in azimuth."""
    pad = int(4 * cells) + 1
    white = rng.standard_normal((shape[0] + 2 * pad, shape[1])).astype(np.float32)
    wide = np.concatenate([white[:, -pad:], white, white[:, :pad]], 1)
    blurred = cv2.GaussianBlur(wide, (0, 0), cells)[pad:-pad, pad:-pad]
    return sigma * blurred / (1 / (2 * np.sqrt(np.pi) * cells))


@dataclass(frozen=True)
class DrawnDefect:
    """Kind, centre, extent and depth (positive into the wall) of a drawn defect."""

    kind: str
    distance_mm: float
    azimuth_rad: float
    length_mm: float
    width_mm: float
    depth_mm: float


def _offsets(defect, distance_mm, azimuth_rad, radius_mm):
    along = (distance_mm - defect.distance_mm)[:, None]
    around = (np.mod(azimuth_rad - defect.azimuth_rad + np.pi, 2 * np.pi) - np.pi)[None] * radius_mm
    return along, around


def relief(defect, distance_mm, azimuth_rad, radius_mm, rng):
    """Return the change of radius (S, A) that the defect makes."""
    along, around = _offsets(defect, distance_mm, azimuth_rad, radius_mm)
    q = np.hypot(along / (defect.length_mm / 2), around / max(defect.width_mm / 2, 1e-3))
    if defect.kind == "weld":
        return defect.depth_mm * np.exp(-((2.2 * along / defect.length_mm) ** 2)) + 0 * around
    if defect.kind == "dent":
        return defect.depth_mm * np.exp(-((1.5 * q) ** 2))
    if defect.kind in ("pit", "gouge", "crack"):
        return defect.depth_mm * np.where(q < 1, np.sqrt(np.maximum(1 - q * q, 0)), 0)
    rough = 1 + 0.3 * smooth_noise(rng, (len(distance_mm), len(azimuth_rad)), 1.0, 4.0)
    field = np.where(q < 1, (1 - q**4) * rough, 0)
    return defect.depth_mm * field / np.abs(field).max()


def draw_defect(kind, distance_mm, azimuth_rad, rng):
    """Draw size and depth within what occurs in pipes; each is at least 0.3 mm deep, 3 mm long and wide."""
    u = rng.uniform
    length, width, depth = {
        "pit": lambda: (u(3, 10), u(3, 10), u(0.35, 1.5)),
        "corrosion": lambda: (u(10, 45), u(10, 45), u(0.35, 1.2)),
        "gouge": lambda: (u(18, 40), u(3, 4), u(0.35, 1.0)),
        "dent": lambda: (u(20, 50), u(20, 40), -u(0.35, 2.0)),
        "deposit": lambda: (u(6, 25), u(6, 30), -u(0.35, 1.5)),
        "weld": lambda: (u(4, 9), 0.0, -u(0.35, 1.5)),
    }[kind]()
    return DrawnDefect(kind, distance_mm, azimuth_rad, length, width, depth)


def plain_bore(radius_mm=50.0, bump_mm=0.0):
    distance = np.arange(0.0, 300.0, 0.5)
    radius = np.full((len(distance), 360), radius_mm, np.float32)
    radius[:, 100:140] += bump_mm
    flat = np.zeros_like(radius)
    return WallSurface(straight_axis(-100, 500), distance, radius, flat, flat, (0.0, 299.5))
