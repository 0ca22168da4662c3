"""Which effects look the same in a gauge run.

What remains of each when poses are free, and which pairs are collinear. A stepped bore of 50.8, 42 and 35 mm
radius, driven off-centre by 6 mm, yawed and rolled, with fiducials.

usage: python -m tests.benchmarks.bench_collinearity [FRAMES]
"""

import sys
from dataclasses import replace

import numpy as np

from pipeline.instrument.camera.fisheye import KannalaBrandt
from pipeline.instrument.laser import LaserSheet
from pipeline.instrument.probe import Probe
from pipeline.physics.catalogue import EFFECTS
from stages.diagnose.effects.base import ImagePoints
from stages.diagnose.effects.library import LIBRARY, columns, texture_columns
from tests.unit.wall_points import Bore, ring_points, texture_points

RADII_MM, SECTION_MM = (50.8, 42.0, 35.0), 42.0
RATE_HZ, SIGMA_PX, ALIKE = 30.0, 0.05, 0.97
AHEAD_MM = (12.0, 30.0, 55.0)


def main(frames: int) -> None:
    probe = stated_probe()
    drive = [frame_points(probe, k, frames) for k in range(frames)]
    for title, with_fiducials in (("rings alone", False), ("rings and fiducials", True)):
        report(title, {name: eliminated(name, drive, with_fiducials) for name in LIBRARY})


def stated_probe() -> Probe:
    camera = KannalaBrandt((1600, 1200), (366.0, 366.0), (800.0, 600.0), (-0.0118, 0.0008, -0.0008, 0.0))
    return Probe(camera, LaserSheet(23.4, 1e-4, -1e-4), np.zeros((20, 20)))


def frame_points(probe: Probe, k: int, frames: int) -> tuple[ImagePoints, ImagePoints, float]:
    """Return the ring, wall points ahead, and the time, of one frame of the drive."""
    t = k / frames
    bore = Bore(
        RADII_MM[min(int(3 * t), 2)],
        (6 * np.sin(9 * t + 0.4), 5 * np.cos(7 * t), 0.0),
        (0.04 * np.sin(11 * t), 0.03 * np.cos(8 * t + 1), 1.0),
    )
    roll, time_s = 0.7 * np.sin(5 * t), k / RATE_HZ * 4
    speed = 12 * (1 + 0.5 * np.sin(13 * t))
    ring = seen_moving(ring_points(probe, bore, 60, time_s), roll, speed, k)
    wall = [texture_points(probe, bore, ahead, 24) for ahead in AHEAD_MM]
    return ring, seen_moving(joined(wall, time_s), roll, speed, k), time_s


def joined(parts: list[ImagePoints], time_s: float) -> ImagePoints:
    stacked = {
        name: np.concatenate([getattr(p, name) for p in parts])
        for name in (
            "frame",
            "uv",
            "xyz_c",
            "normal_c",
            "along_c",
            "velocity_px",
            "speed_mm_s",
            "line_width_px",
        )
    }
    return replace(parts[0], **stacked, time_s=np.full(len(stacked["uv"]), time_s))


def seen_moving(points: ImagePoints, roll: float, speed: float, k: int) -> ImagePoints:
    """Return points with their velocities in a drive that sways at 2 Hz, and their places in P."""
    sway = np.array([2.0 * np.cos(k), 1.5 * np.sin(1.3 * k), 0.0])
    passing = -speed * points.along_c - sway
    by_point = points.ring.by_point
    velocity = np.einsum("mij,mj->mi", by_point, passing)
    if points.on_line:
        rate = np.sum(points.normal_c * passing, axis=1)
        velocity = (rate * points.ring.read_move(points.ring.per_wall_c))[:, None] * points.outward
    azimuth_p = np.arctan2(points.normal_c[:, 1], points.normal_c[:, 0]) + roll
    place = speed * points.time_s + points.xyz_c[:, 2]
    slope = 0.2 * np.sin(5 * azimuth_p + place / 2)
    return replace(
        points, velocity_px=velocity, wall_azimuth_rad=azimuth_p, distance_mm=place,
        albedo_slope_per_mm=slope, speed_mm_s=np.full(len(points.uv), speed),
    )  # fmt: skip


def eliminated(name: str, drive: list, with_fiducials: bool) -> tuple[np.ndarray, float]:
    """Return an effect at its first shape, in σ per plausible size, without the part that poses can mimic.

    Also return its size before the elimination of poses.
    """
    model = LIBRARY[name]
    shape = model.shapes(drive[-1][2], RATE_HZ)[0]
    plausible = np.array([a.plausible for a in model.amplitudes]) / SIGMA_PX
    left, before = [], 0.0
    for ring, wall, _ in drive:
        rows, pose = [columns(model, ring, shape)], [ring_by_pose(ring)]
        if with_fiducials:
            rows.append(texture_columns(model, wall, shape).reshape(-1, len(plausible)))
            pose.append(wall_by_pose(wall))
        made, held = np.concatenate(rows) * plausible, np.concatenate(pose)
        basis, size, _ = np.linalg.svd(held / np.linalg.norm(held, axis=0).clip(1e-12), full_matrices=False)
        basis = basis[:, size > 1e-6 * size[0]]
        before += float(np.sum(made**2))
        left.append(made - basis @ (basis.T @ made))
    return np.concatenate(left), np.sqrt(before)


def ring_by_pose(ring: ImagePoints) -> np.ndarray:
    way = np.concatenate([-ring.normal_c, -np.cross(ring.xyz_c, ring.normal_c)], axis=1)
    return ring.ring.read_move(ring.ring.per_wall_c)[:, None] * way


def wall_by_pose(wall: ImagePoints) -> np.ndarray:
    turning = np.stack([np.cross(wall.xyz_c, unit) for unit in np.eye(3)], axis=-1)
    moves = np.concatenate([np.tile(-np.eye(3), (len(turning), 1, 1)), turning], axis=-1)
    return np.einsum("mij,mjk->mik", wall.ring.by_point, moves).reshape(-1, 6)


def likeness(first: np.ndarray, second: np.ndarray) -> float:
    """Return the smallest canonical correlation.

    1 when the other effect can mimic every amplitude of the smaller one.
    """
    bases = [np.linalg.qr(c / np.linalg.norm(c, axis=0))[0] for c in (first, second)]
    return float(np.linalg.svd(bases[0].T @ bases[1], compute_uv=False).min())


def report(title: str, found: dict[str, tuple[np.ndarray, float]]) -> None:
    print(f"\n{title}: signal of a plausible size in σ, and the part that free poses leave")
    seen = {}
    for name, (left, before) in found.items():
        kept = np.linalg.norm(left)
        if before > 1e-6:
            print(f"  {name:<18} {before:9.1f} σ  {kept / before:6.1%}")
        if kept > 1.0 and np.linalg.norm(left, axis=0).min() > 1e-3 * kept:
            seen[name] = left
    names = list(seen)
    pairs = [(likeness(seen[a], seen[b]), a, b) for i, a in enumerate(names) for b in names[i + 1 :]]
    print(f"{title}: pairs alike beyond {ALIKE}")
    for value, a, b in sorted(pairs, reverse=True):
        if value > ALIKE:
            stated = "known" if b in EFFECTS[a].alike or a in EFFECTS[b].alike else "not in the catalogue"
            print(f"  {value:.4f}  {a} ~ {b}  ({stated})")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 60)
