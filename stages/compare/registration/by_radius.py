"""Registers a wall on a reference map by least squares of the radius.

A run does not contain the origin of the reference. So shift along the pipe, roll, and the first pose, which
appears as a constant, linear and quadratic offset of the centre line, are removed from the difference. The
distance scale is estimated and reported. Differences of radius and shape remain.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.optimize import least_squares

from pipeline.adjustment.robust import spread_about_median
from pipeline.arrays import Float, Int
from pipeline.artefacts.wall_map import WallMap
from pipeline.errors import UnusableError

# Cells used in the fit, and in the search of shift and roll: bounds on time alone.
_FIT_POINTS, _SEARCH_POINTS = 10_000, 2000
# Steps of that search: finer than half the width of the smallest defect that is reported, 3 mm.
_SHIFT_STEP_MM, _ROLL_STEP_RAD = 0.5, math.radians(1)
# Least 1 σ of the smoothing before the fit. Interpolation halfway between cells reduces white noise, and the
# alignment would prefer such places.
_SMOOTH_MM, _SMOOTH_CELLS = 1.0, 1.5


@dataclass(frozen=True)
class Alignment:
    """The transformation of a run onto the reference.

    Its distance on the reference is middle + (1 + scale_error) (distance − middle) + shift, its azimuth is
    azimuth + roll. ``pose_mm`` (6,) are the amplitudes of cos ψ, sin ψ, and of both times x and x², with x
    from −1 to 1 along the run.
    """

    shift_mm: float
    roll_deg: float
    scale_error: float
    pose_mm: tuple[float, ...]

    @property
    def placement(self) -> Float:
        """Shift, mm, roll, rad, and scale error, as `looked_up` takes them."""
        return np.array([self.shift_mm, math.radians(self.roll_deg), self.scale_error])


@dataclass(frozen=True)
class WallSamples:
    """Measured cells of a map: distance from the middle, azimuth, radius, and x from −1 to 1; each (N,)."""

    middle_mm: float
    offset_mm: Float
    azimuth_rad: Float
    radius_mm: Float
    x: Float


def align_maps(run: WallMap, reference: WallMap, max_shift_mm: float, max_roll_deg: float) -> Alignment:
    """Return the alignment of least robust squared difference within the limits.

    Raises
    ------
    UnusableError
        If at no shift within the limits half of the run lies on the reference.
    """
    samples, reference = samples_of(_smoothed(run), _FIT_POINTS), _smoothed(reference)
    start = _search(samples, reference, max_shift_mm, math.radians(max_roll_deg))
    spread = spread_about_median(_residual(start, samples, reference))
    found = least_squares(
        _residual, start, args=(samples, reference), loss="cauchy", f_scale=max(2 * spread, 1e-6),
        x_scale=np.array([0.1, 0.01, 1e-3] + [0.1] * 7),
    ).x  # fmt: skip
    return Alignment(
        float(found[0]), math.degrees(found[1]), float(found[2]), tuple(float(p) for p in found[3:9])
    )


def samples_of(wall: WallMap, at_most: int) -> WallSamples:
    """Return the measured cells of a map, evenly thinned to ``at_most``."""
    station, azimuth = np.nonzero(np.isfinite(wall.radius_mm))
    if len(station) > at_most:
        chosen = np.sort(np.random.default_rng(0).choice(len(station), at_most, replace=False))
        station, azimuth = station[chosen], azimuth[chosen]
    distance = wall.distance_mm[station]
    middle = float(distance.min() + distance.max()) / 2
    half = max(float(np.ptp(distance)) / 2, 1.0)
    offset = distance - middle
    return WallSamples(
        middle, offset, wall.azimuth_rad[azimuth], wall.radius_mm[station, azimuth], offset / half
    )


def _search(samples: WallSamples, reference: WallMap, max_shift_mm: float, max_roll_rad: float) -> Float:
    """Return the best of a grid of shifts and rolls; scale error is 0, the linear pose is solved for."""
    best: tuple[float, Float] | None = None
    few = slice(None, None, max(1, len(samples.x) // _SEARCH_POINTS))
    thin = WallSamples(samples.middle_mm, *(a[few] for a in (
        samples.offset_mm, samples.azimuth_rad, samples.radius_mm, samples.x)))  # fmt: skip
    design = _nuisance_design(thin)
    for shift in np.arange(-max_shift_mm, max_shift_mm + 1e-9, _SHIFT_STEP_MM):
        for roll in np.arange(-max_roll_rad, max_roll_rad + 1e-9, _ROLL_STEP_RAD):
            error = thin.radius_mm - looked_up(
                reference.radius_mm, reference, thin, np.array([shift, roll, 0.0])
            )
            on = np.isfinite(error)
            if on.mean() < 0.5:
                continue
            pose = np.linalg.lstsq(design[on], error[on], rcond=None)[0]
            cost = float(np.mean(np.abs(error[on] - design[on] @ pose)))
            if best is None or cost < best[0]:
                best = cost, np.concatenate([[shift, roll, 0.0], pose])
    if best is None:
        raise UnusableError(
            "verify", "run and reference do not overlap",
            limit=f"half of the run within ±{max_shift_mm:g} mm",
            hint="use a reference of the same stretch, or raise --max-shift-mm",
        )  # fmt: skip
    return best[1]


def _residual(parameters: Float, samples: WallSamples, reference: WallMap) -> Float:
    """Return run minus aligned reference (N,), mm, 0 where the reference has no value."""
    error = samples.radius_mm - looked_up(reference.radius_mm, reference, samples, parameters)
    return np.where(np.isfinite(error), error - _nuisance_design(samples) @ parameters[3:], 0.0)


def pose_design(samples: WallSamples) -> Float:
    """Return the derivatives (N, 6) of the radius by the amplitudes of `Alignment.pose_mm`."""
    c, s, x = np.cos(samples.azimuth_rad), np.sin(samples.azimuth_rad), samples.x
    return np.stack([c, s, x * c, x * s, x * x * c, x * x * s], -1)


def _nuisance_design(samples: WallSamples) -> Float:
    """Return columns (N, 7) of the pose and of a constant radius; only the pose is taken out of the result.

    Without its own column, a constant radius would bias shift and scale.
    """
    return np.concatenate([pose_design(samples), np.ones((len(samples.x), 1))], -1)


def looked_up(values: Float, grid: WallMap, samples: WallSamples, at: Float) -> Float:
    """Return (N,) bilinear values (S, A) of a grid at the aligned samples; NaN beyond its ends."""
    cell, weight = cells_around(grid, samples, at)
    return np.asarray(np.sum(weight * values[cell], 0))


def cells_around(grid: WallMap, samples: WallSamples, at: Float) -> tuple[tuple[Int, Int], Float]:
    """Return the four cells next to each aligned sample, (4, N) rows and columns, and weights (4, N)."""
    shift, roll, scale_error = at[:3]
    distance = samples.middle_mm + samples.offset_mm * (1 + scale_error) + shift
    row = (distance - grid.distance_mm[0]) / (grid.distance_mm[1] - grid.distance_mm[0])
    count = len(grid.azimuth_rad)
    column = np.mod((samples.azimuth_rad + roll - grid.azimuth_rad[0]) * count / (2 * math.pi), count)
    row = np.where((row >= 0) & (row <= len(grid.distance_mm) - 1), row, np.nan)
    i = np.nan_to_num(np.minimum(row, len(grid.distance_mm) - 2)).astype(int)
    j = np.minimum(column.astype(int), count - 1)
    u, v = row - i, column - j
    weight = np.stack([(1 - u) * (1 - v), (1 - u) * v, u * (1 - v), u * v])
    return (np.stack([i, i, i + 1, i + 1]), np.stack([j, (j + 1) % count, j, (j + 1) % count])), weight


def _smoothed(wall: WallMap) -> WallMap:
    """Return a map smoothed over cells, since interpolation between noisy cells would look like a match."""
    step = wall.distance_mm[1] - wall.distance_mm[0]
    arc = float(np.nanmean(wall.radius_mm)) * (wall.azimuth_rad[1] - wall.azimuth_rad[0])
    size = tuple(max(_SMOOTH_MM / s, _SMOOTH_CELLS) for s in (step, arc))
    known = np.isfinite(wall.radius_mm)
    middle = float(np.nanmean(wall.radius_mm))
    filled, weight = (
        gaussian_filter(a, size, mode=("nearest", "wrap"))
        for a in (np.where(known, wall.radius_mm - middle, 0.0), known.astype(float))
    )
    radius = np.where(known, middle + filled / np.maximum(weight, 1e-12), np.nan)
    return replace(wall, radius_mm=radius)
