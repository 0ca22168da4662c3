"""Measures a run's accuracy: its differences from a reference, point by point, and their statistics."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from pipeline.adjustment.robust import root_mean_square, spread_about_median
from pipeline.arrays import Float
from pipeline.artefacts.wall_map import WallMap
from pipeline.errors import UnusableError
from pipeline.geometry.rigid import transform
from pipeline.machine.stage import Context, Of, Parameters, Stage
from stages.compare.reference import ReferenceSurface, WallPoints
from stages.compare.registration.by_points import NearestPoints, PointsPose, register_points
from stages.compare.registration.by_radius import (
    Alignment,
    align_maps,
    cells_around,
    looked_up,
    pose_design,
    samples_of,
)

# Half the width of the 95 % interval of a normal distribution, in σ.
_NORMAL_95 = 1.959964
# With fewer points a 95th percentile depends on at most five of them.
_LEAST_POINTS = 100


@dataclass(frozen=True)
class Differences:
    """Run minus reference, positive where the run's radius is larger.

    Attributes
    ----------
    distance_mm, azimuth_rad : (N,)
        Pipe coordinates in the run.
    error_mm, sigma_mm, sigma_random_mm : (N,)
        Differences, and their 1 σ with and without the instrument's part.
    """

    distance_mm: Float
    azimuth_rad: Float
    error_mm: Float
    sigma_mm: Float
    sigma_random_mm: Float


@dataclass(frozen=True)
class Accuracy:
    """The figures of a certificate, mm; shares from 0 to 1.

    Attributes
    ----------
    points : int
    bias_mm, median_mm, rms_mm, mad_sigma_mm, p95_mm, max_mm : float
        Mean, median, root mean square, robust σ about the median, 95th percentile and largest size.
    within_95, within_95_random : float
        Share of differences inside their 95 % interval, with the total and with the random σ; NaN where no
        σ is stated.
    """

    points: int
    bias_mm: float
    median_mm: float
    rms_mm: float
    mad_sigma_mm: float
    p95_mm: float
    max_mm: float
    within_95: float
    within_95_random: float


def accuracy(differences: Differences) -> Accuracy:
    """Return the figures of differences.

    Raises
    ------
    UnusableError
        If fewer than 100 points could be compared.
    """
    error = differences.error_mm
    if len(error) < _LEAST_POINTS:
        raise UnusableError(
            "verify", f"only {len(error)} points of the run lie on the reference",
            limit=f"at least {_LEAST_POINTS}",
            hint="check that both show the same stretch of pipe, and --max-shift-mm",
        )  # fmt: skip
    spread = spread_about_median(error)
    return Accuracy(
        len(error),
        float(error.mean()),
        float(np.median(error)),
        root_mean_square(error),
        float(spread),
        float(np.percentile(np.abs(error), 95)),
        float(np.abs(error).max()),
        _inside(error, differences.sigma_mm),
        _inside(error, differences.sigma_random_mm),
    )


def wall_coverage(wall: WallMap) -> float:
    """Return the measured share of the map between its first and last seen station."""
    seen = np.isfinite(wall.radius_mm)
    station = np.flatnonzero(seen.any(1))
    return float(seen[station[0] : station[-1] + 1].mean())


def bore_differences(wall: WallMap, diameter_mm: float, tolerance_mm: float) -> Differences:
    """Return the differences of a wall's radius from a bore's, its diameter uniform within ± tolerance."""
    known = np.isfinite(wall.radius_mm)
    station, azimuth = np.nonzero(known)
    bore = (tolerance_mm / 2) ** 2 / 3
    return Differences(
        wall.distance_mm[station],
        wall.azimuth_rad[azimuth],
        wall.radius_mm[known] - diameter_mm / 2,
        np.sqrt(wall.sigma_mm[known] ** 2 + bore),
        np.sqrt(wall.sigma_random_mm[known] ** 2 + bore),
    )


def map_differences(run: WallMap, reference: WallMap, alignment: Alignment) -> Differences:
    """Return run minus aligned reference for every cell of the run that lies on it."""
    samples = samples_of(run, run.radius_mm.size)
    error = samples.radius_mm - looked_up(reference.radius_mm, reference, samples, alignment.placement)
    error = error - pose_design(samples) @ np.array(alignment.pose_mm)
    on = np.isfinite(error)
    known = np.isfinite(run.radius_mm)

    cell, weight = cells_around(reference, samples, alignment.placement)
    # interpolation averages the random part of neighbouring cells, but not the instrument's
    its_random = np.sum(weight**2 * reference.sigma_random_mm[cell] ** 2, 0)[on]
    shared = np.maximum(reference.sigma_mm**2 - reference.sigma_random_mm**2, 0.0)
    its_shared = np.sum(weight * shared[cell], 0)[on]
    return Differences(
        samples.middle_mm + samples.offset_mm[on],
        samples.azimuth_rad[on],
        error[on],
        np.sqrt(run.sigma_mm[known][on] ** 2 + its_random + its_shared),
        np.sqrt(run.sigma_random_mm[known][on] ** 2 + its_random),
    )


def surface_differences(
    points: WallPoints, reference: ReferenceSurface, pose: PointsPose, reach_mm: float
) -> Differences:
    """Return the distances of the run's points from the reference along its outward normals.

    The reference is in mm. Points farther than ``reach_mm`` from it do not lie on it and are left out.
    """
    xyz, outward = transform(pose.T_rp, points.xyz_p), points.outward_p @ pose.T_rp[:3, :3].T
    closest = NearestPoints(reference)(xyz)
    away = xyz - closest
    error = np.sum(away * outward, -1)
    on = np.linalg.norm(away, axis=-1) <= reach_mm
    sigma = points.sigma_mm[on]
    return Differences(points.distance_mm[on], points.azimuth_rad[on], error[on], sigma, sigma)


def _inside(error: Float, sigma: Float) -> float:
    if not np.all(sigma > 0):
        return float("nan")
    return float(np.mean(np.abs(error) < _NORMAL_95 * sigma))


_UNITS_MM = {"mm": 1.0, "m": 1000.0}


class VerifyParameters(Parameters):
    """Limits of the alignment of run and reference."""

    max_shift_mm: float = Field(
        8.0, ge=0, le=1000, description="largest difference of the origins of distance, mm"
    )
    max_roll_deg: float = Field(
        5.0, ge=0, le=180, description="largest difference of the origins of roll, deg"
    )
    reference_unit: Literal["mm", "m"] = Field("mm", description="unit of a mesh or cloud")
    reach_mm: float = Field(
        5.0, ge=0.01, description="points farther than this from a mesh or cloud are left out, mm"
    )


@dataclass(frozen=True)
class KnownBore:
    """A bore's diameter and its ± tolerance, mm."""

    diameter_mm: float
    tolerance_mm: float


@dataclass(frozen=True)
class Verification:
    """The alignment of run and reference (None against a known bore), their differences and the figures."""

    kind: str
    alignment: Alignment | PointsPose | None
    differences: Differences
    figures: Accuracy


def verify_bore(
    wall: Annotated[WallMap, Of("wall")], bore: KnownBore, parameters: VerifyParameters, context: Context
) -> Verification:
    """Compare a wall with a known bore; raises as `accuracy`."""
    differences = bore_differences(wall, bore.diameter_mm, bore.tolerance_mm)
    return _verification("known bore", None, differences, context)


def verify_map(
    wall: Annotated[WallMap, Of("wall")],
    reference: Annotated[WallMap, Of("reference")],
    parameters: VerifyParameters,
    context: Context,
) -> Verification:
    """Compare a wall with another map of it; raises as `align_maps` and `accuracy`."""
    alignment = align_maps(wall, reference, parameters.max_shift_mm, parameters.max_roll_deg)
    kind = "repeatability" if (reference.sigma_mm > 0).any() else "reference map"
    return _verification(kind, alignment, map_differences(wall, reference, alignment), context)


def verify_surface(
    points: WallPoints,
    reference: Annotated[ReferenceSurface, Of("reference")],
    parameters: VerifyParameters,
    context: Context,
) -> Verification:
    """Compare a run's points with a mesh or a cloud; raises as `register_points` and `accuracy`."""
    surface = replace(reference, vertices=reference.vertices * _UNITS_MM[parameters.reference_unit])
    pose = register_points(points, surface)
    differences = surface_differences(points, surface, pose, parameters.reach_mm)
    kind = "reference mesh" if len(reference.triangles) else "reference cloud"
    return _verification(kind, pose, differences, context)


def _verification(
    kind: str, alignment: Alignment | PointsPose | None, differences: Differences, context: Context
) -> Verification:
    figures = accuracy(differences)
    context.report("points compared", figures.points)
    context.report("rms difference", float(np.round(figures.rms_mm, 6)), "mm")
    return Verification(kind, alignment, differences, figures)


_SUMMARY = "Compare a run's wall with a reference."
VERIFY_BORE, VERIFY_MAP, VERIFY_SURFACE = (
    Stage("verify", "2", VerifyParameters, function, _SUMMARY)
    for function in (verify_bore, verify_map, verify_surface)
)
