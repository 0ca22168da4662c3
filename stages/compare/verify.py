"""The stages of a verification: a wall against a known bore, another map of it, or a mesh or cloud."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from pipeline.artefacts.wall_map import WallMap
from pipeline.machine.stage import Context, Of, Parameters, Stage
from stages.compare.reference import ReferenceSurface, WallPoints
from stages.compare.registration.by_points import PointsPose, register_points
from stages.compare.registration.by_radius import Alignment, align_maps
from stages.compare.verification import (
    Accuracy,
    Differences,
    accuracy,
    bore_differences,
    map_differences,
    surface_differences,
)

_UNITS_MM = {"mm": 1.0, "m": 1000.0}


class VerifyParameters(Parameters):
    """How far run and reference may be apart."""

    max_shift_mm: float = Field(
        8.0, ge=0, le=1000, description="how far apart the origins of distance may be, mm"
    )
    max_roll_deg: float = Field(
        5.0, ge=0, le=180, description="how far apart the origins of roll may be, deg"
    )
    reference_unit: Literal["mm", "m"] = Field("mm", description="unit of a mesh or cloud")
    reach_mm: float = Field(
        5.0, ge=0.01, description="points farther from a mesh or cloud do not lie on it, mm"
    )


@dataclass(frozen=True)
class KnownBore:
    """A bore's diameter and the ± of it, mm."""

    diameter_mm: float
    tolerance_mm: float


@dataclass(frozen=True)
class Verification:
    """How both were brought together (None where nothing had to be), the differences and their figures."""

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


_SUMMARY = "Compare a run's wall with what is known of it."
VERIFY_BORE, VERIFY_MAP, VERIFY_SURFACE = (
    Stage("verify", "1", VerifyParameters, function, _SUMMARY)
    for function in (verify_bore, verify_map, verify_surface)
)
