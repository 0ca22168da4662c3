"""A run compared with a recording's truth, after removing what no run can determine.

That is the pose of the first frame, seen as a shift and a tilt of the pipe, and the zeros of distance and
roll.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from scipy.interpolate import RegularGridInterpolator
from scipy.optimize import least_squares

from pipeline.adjustment.robust import spread_about_median
from pipeline.arrays import Float
from pipeline.artefacts.measured import RadiusMap, Trajectory


@dataclass(frozen=True)
class WallComparison:
    """Radius errors (M,), mm, of randomly chosen cells, their stated σ, and the share of measured cells."""

    error_mm: Float
    sigma_mm: Float
    coverage: float

    @property
    def robust_sigma_mm(self) -> float:
        return spread_about_median(self.error_mm)

    @property
    def inside_95(self) -> float:
        return float(np.mean(np.abs(self.error_mm) < 1.96 * self.sigma_mm))


@dataclass(frozen=True)
class MotionComparison:
    """Errors of distance (N,), mm, and roll (N,), rad, since the first frame, and the path driven, mm."""

    distance_mm: Float
    roll_rad: Float
    path_mm: float


def compare_wall(found: RadiusMap, folder: Path, cells: int = 20000) -> WallComparison:
    s, psi, r, sigma = _drawn_cells(found, cells)
    seen = np.isfinite(found.radius_mm)
    error = wall_error(found, folder, cells)
    return WallComparison(error(s, psi, r), sigma, float(seen[seen.any(1)].mean()))


def wall_error(found: RadiusMap, folder: Path, cells: int = 20000) -> Callable[[Float, Float, Float], Float]:
    """Return a function for the error of a radius at a distance and azimuth in the run's own pipe frame."""
    s, psi, r, _ = _drawn_cells(found, cells)
    truth, middle, length = _true_radius(folder), s.mean(), np.ptp(s)

    def error(p: Float, s: Float, psi: Float, r: Float) -> Float:
        x = (s - middle) / length
        shape = np.stack([f(psi) * x**k for k in range(3) for f in (np.cos, np.sin)], -1)
        return r - truth(np.stack([s + p[0] + 10 * x * p[1], psi + p[2]], -1)) - shape @ p[3:]

    def all_errors(p: Float) -> Float:
        return error(p, s, psi, r)

    start = min(np.arange(-6, 6.1, 0.5), key=lambda d: np.median(np.abs(all_errors(np.array([d, *[0] * 8])))))
    best = least_squares(
        all_errors, [start, *[0.0] * 8], loss="cauchy", f_scale=0.1, x_scale=0.1, diff_step=1e-4
    )
    return partial(error, best.x)


def _drawn_cells(found: RadiusMap, cells: int) -> tuple[Float, Float, Float, Float]:
    """Distance, azimuth, radius and its σ of randomly chosen cells."""
    row, column = np.nonzero(np.isfinite(found.radius_mm))
    pick = np.random.default_rng(0).choice(len(row), min(cells, len(row)), replace=False)
    row, column = row[pick], column[pick]
    radius, sigma = (a[row, column].astype(float) for a in (found.radius_mm, found.sigma_mm))
    return found.distance_mm[row], found.azimuth_rad[column], radius, sigma


def compare_motion(found: Trajectory, folder: Path) -> MotionComparison:
    poses = np.array(json.loads((folder / "truth.json").read_text())["camera_pose_in_pipe"])[found.frame]
    z = found.T_pc[:, 2, 3] - poses[:, 2, 3]
    roll = _roll(found.T_pc) - _roll(poses)
    return MotionComparison(z - z[0], roll - roll[0], float(np.sum(np.abs(np.diff(poses[:, 2, 3])))))


def _roll(T: Float) -> Float:
    return np.unwrap(np.arctan2(T[:, 1, 0], T[:, 0, 0]))


def _true_radius(folder: Path) -> RegularGridInterpolator:
    with np.load(folder / "truth_wall.npz") as file:
        s, psi, r = (file[k].astype(float) for k in ("distance_mm", "azimuth_rad", "radius_mm"))
    wide = np.concatenate([psi - 2 * np.pi, psi, psi + 2 * np.pi])
    return RegularGridInterpolator((s, wide), np.tile(r, 3), bounds_error=False, fill_value=None)
