"""A run's wall and findings beside the true wall itself, where the shared score is too coarse.

The score gives each true defect one finding: a second finding on it, or one on a defect at the end that the
shortened list of true defects leaves out, counts as false there. Here a finding is false if the true wall has
no such relief at its place. And one recording is one draw of its instrument's error, so that its share of
radii inside their intervals tests little: here the mean error is stated in σ of what all radii share, and the
share is that of the rest of error and σ.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from scipy.ndimage import map_coordinates, median_filter

from pipeline.adjustment.robust import robust_spread
from pipeline.arrays import Float

# Positions of a finding and of the true wall may differ by the motion's error and half a ring's spacing.
_NEAR_MM = 2.0
# A finding is real where the true wall departs by half of the smallest depth that is reported, and by a share
# of the finding's own depth.
_LEAST_MM, _LEAST_SHARE = 0.1, 0.3
# An oval is the median over 120 mm of the pipe: twice as long as two of the longest defects.
_OVAL_MM = 120.0


@dataclass(frozen=True)
class TrueWall:
    """Radius and relief (S, A), mm, positive into the wall, over distance (S,), mm, and azimuth (A,), rad."""

    distance_mm: Float
    azimuth_rad: Float
    radius_mm: Float
    relief_mm: Float

    def extreme(self, found: Mapping[str, float]) -> float:
        """Return the largest relief with a finding's sign, within its outline or up to 2 mm beside it."""
        rows = self.distance_mm > found["distance_from_mm"] - _NEAR_MM
        rows &= self.distance_mm < found["distance_to_mm"] + _NEAR_MM
        first, last = (np.radians(30 * found[clock] - 90) for clock in ("clock_from", "clock_to"))
        half = (last - first) % (2 * np.pi) / 2
        aside = (self.azimuth_rad - first - half + np.pi) % (2 * np.pi) - np.pi
        near = half + _NEAR_MM / float(np.median(self.radius_mm))
        here = self.relief_mm[np.ix_(rows, np.abs(aside) < near)]
        return float((np.sign(found["depth_mm"]) * here).max(initial=0.0))

    def shows(self, found: Mapping[str, float]) -> bool:
        """Return whether the wall departs at a finding's place as a real one does."""
        return self.extreme(found) > max(_LEAST_MM, _LEAST_SHARE * abs(found["depth_mm"]))

    def radius_at(self, distance_mm: Float, azimuth_rad: Float) -> Float:
        """Return the radius (n,), mm, at places."""
        row = (distance_mm - self.distance_mm[0]) / (self.distance_mm[1] - self.distance_mm[0])
        column = (azimuth_rad - self.azimuth_rad[0]) / (self.azimuth_rad[1] - self.azimuth_rad[0])
        wide = np.concatenate([self.radius_mm, self.radius_mm[:, :1]], axis=1)
        return np.asarray(map_coordinates(wide, [row, column % len(self.azimuth_rad)], order=1))


@dataclass(frozen=True)
class Errors:
    """Errors of radii: their mean in σ of what all share, and which share of the rest is inside 1.96 σ."""

    mean_sigmas: float
    inside_apart: float


def true_wall(folder: Path) -> TrueWall:
    """Read a true wall; its relief is what departs from its oval and from its usual radius."""
    with np.load(folder / "truth_wall.npz") as file:
        distance, azimuth, radius = (
            file[n].astype(float) for n in ("distance_mm", "azimuth_rad", "radius_mm")
        )
    return TrueWall(distance, azimuth, radius, relief_of(radius, distance, azimuth))


def relief_of(radius: Float, distance_mm: Float, azimuth_rad: Float) -> Float:
    """Return by how much a true radius (S, A), mm, departs from its oval and from its usual mean.

    The oval is the median along the pipe of those fitted to single rows. Fitted to each row by itself, it
    took .29 mm off a dent of 1.61 mm that is a tenth of the circumference wide.
    """
    basis = np.stack([f(k * azimuth_rad) for k in (1, 2) for f in (np.cos, np.sin)], -1)
    rows = 2 * round(_OVAL_MM / 2 / (distance_mm[1] - distance_mm[0])) + 1
    mean = radius.mean(1, keepdims=True)
    oval = median_filter((radius - mean) @ np.linalg.pinv(basis).T, (rows, 1), mode="nearest") @ basis.T
    own = np.median(radius - oval, axis=1)
    return np.asarray(cv2.blur(radius - oval - np.median(own), (5, 5)))


def errors(run: Path, wall: TrueWall, placed: Mapping[str, float]) -> Errors:
    """Compare the radii of a run with the true ones; ``placed`` is the wall's part of the shared score."""
    with np.load(run / "radius_map.npz") as file:
        measured = {name: file[name].astype(float) for name in file.files}
    row, column = np.nonzero(np.isfinite(measured["radius_mm"]))
    distance, azimuth = measured["distance_mm"][row], measured["azimuth_rad"][column]
    middle = distance.mean()
    in_truth = middle + (distance - middle) * (1 + placed["axial_scale_error"]) + placed["axial_shift_mm"]
    truth = wall.radius_at(in_truth, azimuth + np.radians(placed["roll_shift_deg"]))
    error = _centred(measured["radius_mm"][row, column] - truth, distance, azimuth)
    displaced = measured.get("displaced_mm", np.zeros(len(measured["distance_mm"])))[row]
    apart = np.hypot(measured["sigma_random_mm"][row, column], displaced)
    common = np.sqrt(np.maximum(measured["sigma_mm"][row, column] ** 2 - apart**2, 0))
    mean = float(error.mean())
    return Errors(mean / float(np.median(common)), float(np.mean(np.abs(error - mean) < 1.96 * apart)))


def _centred(error: Float, distance_mm: Float, azimuth_rad: Float) -> Float:
    """Return errors (n,) without the pipe's own shift, tilt and bend, as the shared score does."""
    along = (distance_mm - distance_mm.mean()) / max(np.ptp(distance_mm) / 2, 1.0)
    ways = np.stack([np.cos(azimuth_rad), np.sin(azimuth_rad)])
    design = np.concatenate([ways, along * ways, along**2 * ways]).T
    left, weight = error, np.ones(len(error))
    for _ in range(5):
        moved = np.linalg.lstsq(design * weight[:, None], error * weight, rcond=None)[0]
        left = error - design @ moved
        weight = 1 / np.sqrt(1 + (left / (3 * robust_spread(left) + 1e-9)) ** 2)
    return left


def not_in_wall(run: Path, wall: TrueWall, placed: Mapping[str, float]) -> list[Mapping[str, float]]:
    """Return the findings of a run at whose place the true wall has no such relief."""
    away, turn = placed["axial_shift_mm"], placed["roll_shift_deg"] / 30
    moved = {"distance_from_mm": away, "distance_to_mm": away, "clock_from": turn, "clock_to": turn}
    found = json.loads((run / "defects.json").read_text("utf-8"))
    return [f for f in found if not wall.shows(f | {n: f[n] + by for n, by in moved.items()})]
