"""Wall to defects: what stands off the pipe's own smooth shape, told from noise, measured, named.

1. Take the pipe's own slowly varying shape out (`relief`), and the motion of single rings; once more when it
   is known where the defects are.
2. Matched filters over scales, threshold from a wished number of false alarms (`detect`).
3. Hysteresis (`grow`) to instances with outlines; all-round beads are welds (`segment`).
4. Depth as the extreme of a 1 mm mean of the points (`fine`), without what noise adds to it, ± 1 σ (`depth`).
5. What neither a second ring nor the photo confirms is set apart (`corroborate`).
6. Kind from named features as a probability, with codes and words (`classify`, `describe`).

A long wall is gone through in stretches with overlap; what is found does not depend on where they are cut.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from scipy.special import ndtri

from pipeline.artefacts.cloud_along import cloud_along
from pipeline.artefacts.findings import Defect, Defects
from pipeline.artefacts.measured import Wall, WallTexture
from pipeline.errors import UnusableError
from pipeline.machine.stage import Context, Stage
from pipeline.recording.base import Recording
from stages.defects.clean import clean_wall
from stages.defects.corroborate import chance_meetings, is_corroborated
from stages.defects.depth import measure_depth
from stages.defects.describe import Scene, describe
from stages.defects.detect import Detection, detect
from stages.defects.grow import footprint, grown
from stages.defects.parameters import DefectParameters
from stages.defects.relief import smooth_shape_removed
from stages.defects.segment import Region, regions_of
from stages.defects.stretch import stretches
from stages.defects.surface import MeasuredWall, Surface

__all__ = ["DEFECTS", "DefectParameters", "find_defects"]

_MIN_CELLS, _MIN_CIRCLES, _HALF = 1000, 8, 0.5


def find_defects(
    recording: Recording, wall: Wall, texture: WallTexture, parameters: DefectParameters, context: Context
) -> Defects:
    """Find, outline, measure and name the defects of a wall.

    Raises
    ------
    UnusableError
        When too little of the wall was measured to know its own shape.
    """
    _refuse_unseen(wall)
    relief = smooth_shape_removed(wall.radius_map, parameters)
    seeds = detect(relief, parameters.false_alarms, context.scratch, context.progress)
    known = footprint(relief, grown(relief, seeds, parameters, context.scratch), context.scratch)
    relief = smooth_shape_removed(wall.radius_map, parameters, known)
    cells = grown(relief, seeds, parameters, context.scratch)
    regions = regions_of(relief, cells, parameters.join_mm, context.scratch)
    scene = Scene(texture, recording.pipe.wall_thickness_mm, parameters.min_depth_mm)
    cloud = cloud_along(wall.cloud)
    measured = MeasuredWall(relief, cloud, cloud.ring_spacing_mm())
    found = tuple(_described(measured, regions, scene, parameters, context))
    confirmed, unconfirmed = ([d for d, sure in found if sure is wanted] for wanted in (True, False))
    items, alone = _numbered(confirmed, 1), _numbered(unconfirmed, len(confirmed) + 1)
    context.report("defects", len(items), "")
    context.report("unconfirmed: neither a second ring nor the photo shows them", len(alone), "detections")
    context.report(
        "rejected: shallower than the smallest depth or between rings",
        len(regions) - len(found),
        "detections",
    )
    by_chance = chance_meetings(alone, relief.extent_mm, measured.spacing_mm)
    expected = parameters.false_alarms + by_chance
    return Defects(items, expected, _smallest_depth(seeds, parameters), alone)


def _numbered(found: Sequence[Defect], first: int) -> tuple[Defect, ...]:
    return tuple(replace(defect, id=n) for n, defect in enumerate(found, first))


def _described(
    wall: MeasuredWall,
    regions: tuple[Region, ...],
    scene: Scene,
    parameters: DefectParameters,
    context: Context,
) -> Iterator[tuple[Defect, bool]]:
    """Yield the regions that were measured and are as deep as is worth reporting, and which are confirmed."""
    clean = clean_wall(wall, regions)
    for done, region in enumerate(regions, 1):
        # A region that the sure points do not show is measured once more with all points.
        for every_point in (False, True):
            surface, here = wall.surface_about(region, every_point)
            if not _is_measured(surface, here):
                continue
            depth = measure_depth(here, surface, clean, parameters.draws, context.random)
            if region.sign * depth.depth_mm >= parameters.min_depth_mm:
                confirmed = is_corroborated(here, depth, surface, scene.texture)
                yield describe(here, depth, surface, scene), confirmed
                break
        context.progress(len(regions) + done, 2 * len(regions))


def _is_measured(surface: Surface, region: Region) -> bool:
    """Whether any cell of a region has a surface: between rings far apart some have none."""
    shown = region.cut(surface.all_mm if region.all_round else surface.local_mm)
    return bool(np.isfinite(shown[region.mask]).any())


def _refuse_unseen(wall: Wall) -> None:
    """Refuse a wall of which too little was seen to know the shape that defects depart from."""
    radius, cells, circles = wall.radius_map.radius_mm, 0, 0
    for part in stretches(len(radius)):
        seen = np.isfinite(radius[part.own])
        cells, circles = cells + int(seen.sum()), circles + int((seen.mean(1) >= _HALF).sum())
    if cells < _MIN_CELLS or circles < _MIN_CIRCLES:
        raise UnusableError(
            "defects",
            f"{cells} cells of the wall were measured, {circles} circles of it to at least a half",
            limit=f"at least {_MIN_CELLS} cells and {_MIN_CIRCLES} circles",
            hint="see the rejected ring samples by reason, and whether the motion is right",
        )


def _smallest_depth(detection: Detection, parameters: DefectParameters) -> float:
    """Return the depth at which nine of ten defects of 3 mm × 3 mm pass both the threshold and the limit."""
    chance = float(ndtri(0.9))
    found = (detection.threshold + chance) * detection.small_sigma_mm
    return max(found, parameters.min_depth_mm + chance * detection.small_sigma_mm)


DEFECTS = Stage(
    "defects", "5", DefectParameters, find_defects, "defects as instances with depth, clock and kind"
)
