"""Find the defects of a measured wall: detect deviations from the pipe's own shape, measure, classify.

1. Subtract the pipe's own slowly varying shape and the motion error of single rings (`relief`). Repeat this
   with the defects left out, once it is known where they are.
2. Run matched filters of several sizes; the threshold follows from the wanted number of false alarms
   (`detect`).
3. Grow what exceeds the threshold by hysteresis (`grow`) and split it into instances with outlines; beads
   that go all round the pipe are welds (`segment`).
4. Measure each depth as the extreme of the wall averaged over 1 mm (`surface`), corrected for what noise adds
   to an extreme, with 1 σ (`depth`, `smear`).
5. Set unconfirmed findings apart, with the reason: neither a second ring nor the photo shows it, it stays at
   one place of the image, it lies where the line ends, or the recording itself shows that findings like it
   are more often false than real (`corroborate`, `credibility`).
6. Give a probability to each kind of defect by named features, and write codes and a description
   (`describe`).
7. List dark lines that only the photo shows, as cracks are, among the unconfirmed findings (`dark_lines`).

A long wall is processed in overlapping stretches along the pipe; the result does not depend on where they are
cut.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from scipy.special import ndtri

from pipeline.arrays import Float, Float32
from pipeline.artefacts.cloud_along import cloud_along
from pipeline.artefacts.findings import Defect, Defects
from pipeline.artefacts.measured import RingSamples, Trajectory, Wall, WallTexture
from pipeline.artefacts.moved_back import told_by_roll
from pipeline.artefacts.wall_map import FixedToProbe
from pipeline.errors import UnusableError
from pipeline.instrument.probe import Probe
from pipeline.machine.stage import Context, Stage
from pipeline.recording.base import Recording
from pipeline.recording.checks import CheckedFrames
from stages.defects.all_round import bore_beside, goes_round, measure_all_round
from stages.defects.along import stretches
from stages.defects.clean import CleanWall, clean_wall
from stages.defects.corroborate import Witnesses, evidence_for
from stages.defects.dark_lines import dark_lines, lies_beside
from stages.defects.depth import Depth, measure_depth
from stages.defects.describe import Scene, describe, describe_line
from stages.defects.detect import Detection, detect
from stages.defects.grow import footprint, grown
from stages.defects.judge import Found, credibility_on, judged
from stages.defects.neighbours import allowed_by_neighbours, contradicted_frame, reaching
from stages.defects.noise_tail import noise_tail
from stages.defects.parallax import LitPictures
from stages.defects.parameters import DefectParameters
from stages.defects.relief import smooth_shape_removed
from stages.defects.report import report_found, report_unconfirmed, warn_of_missed, warn_of_short_ones
from stages.defects.segment import Region, regions_of
from stages.defects.smear import flattened
from stages.defects.surface import MeasuredWall, Surface

__all__ = ["DEFECTS", "DefectParameters", "find_defects"]

# Least wall for a search: 1000 cells, and 8 circles of the map of which half of the cells were measured
# (chosen).
_MIN_CELLS, _MIN_CIRCLES, _HALF = 1000, 8, 0.5
# At most so many rings with a glint on them are left out when a finding is measured (chosen).
_MOST_LEFT_OUT = 4


def find_defects(
    recording: Recording,
    wall: Wall,
    texture: WallTexture,
    parameters: DefectParameters,
    context: Context,
    rings: RingSamples | None = None,
    pictures: LitPictures | None = None,
) -> Defects:
    """Find, outline, measure and classify the defects of a wall.

    ``rings`` give the brightness of the laser line, ``pictures`` the LED-lit frames in which a finding is
    looked for; what needs them is skipped where they are None. Depths are mm, positive into the wall.

    Raises
    ------
    UnusableError
        When too little of the wall was measured to determine the pipe's own shape.
    """
    _refuse_unseen(wall)
    relief = smooth_shape_removed(wall.radius_map, parameters)
    seeds = detect(relief, parameters.false_alarms, context.scratch, context.progress)
    known = footprint(relief, grown(relief, seeds, parameters, context.scratch), context.scratch)
    relief = smooth_shape_removed(wall.radius_map, parameters, known)
    cells = grown(relief, seeds, parameters, context.scratch)
    regions = regions_of(relief, cells, parameters.join_mm, context.scratch)
    scene = Scene(
        Witnesses(texture, rings, pictures, wall.held),
        recording.pipe.wall_thickness_mm,
        parameters.min_depth_mm,
    )
    cloud = cloud_along(wall.cloud)
    measured = MeasuredWall(relief, cloud, cloud.ring_spacing_mm())
    clean = clean_wall(measured, regions)
    found = tuple(_measured(measured, regions, clean, seeds.score, scene, wall.fixed, parameters, context))
    tail = noise_tail(relief, seeds, known)
    credibility = credibility_on(found, tail, measured)
    context.report("peaks of noise expected above the threshold", tail.above(seeds.threshold), "")
    confirmed, unconfirmed = judged(found, credibility, parameters.min_depth_mm)
    lines = list(_lines(measured, found, clean, scene, parameters, context))
    items, alone = _numbered(confirmed, 1), _numbered([*unconfirmed, *lines], len(confirmed) + 1)
    expected = sum(1 - d.probability for d in items)
    report_found(len(items), expected, context)
    report_unconfirmed(len(items), len(unconfirmed), len(lines), context)
    rejected = len(regions) - len(found)
    context.report("rejected: shallower than the smallest depth or between rings", rejected, "detections")
    smallest_mm = _smallest_depth(seeds, parameters)
    warn_of_missed(smallest_mm, parameters.min_depth_mm, context)
    warn_of_short_ones(wall.held, measured.spacing_mm, context)
    return Defects(items, expected, smallest_mm, alone)


def _numbered(found: Sequence[Defect], first: int) -> tuple[Defect, ...]:
    return tuple(replace(defect, id=n) for n, defect in enumerate(found, first))


def _measured(
    wall: MeasuredWall,
    regions: tuple[Region, ...],
    clean: CleanWall,
    score: Float32,
    scene: Scene,
    fixed: FixedToProbe | None,
    parameters: DefectParameters,
    context: Context,
) -> Iterator[Found]:
    """Yield the regions that were measured and reach the smallest depth to be reported."""
    for done, region in enumerate(regions, 1):
        # A region without points of usual σ is measured once more with all points.
        for every_point in (False, True):
            surface, here = wall.surface_about(region, every_point)
            if not _is_measured(surface, here):
                continue
            whole, uncut = surface, _depth_of(region, here, surface, wall, clean, parameters, context)
            depth = uncut
            while (frame := _contradicted(depth, here, surface)) is not None:
                without, _ = wall.surface_about(region, every_point, (*surface.left_out, frame))
                if not _is_measured(without, here):
                    break
                surface = without
                depth = _depth_of(region, here, surface, wall, clean, parameters, context)
            depth = depth if region.all_round else allowed_by_neighbours(depth, here, surface)
            if region.sign * depth.depth_mm >= parameters.min_depth_mm:
                top = float(region.cut(score.astype(float))[region.mask].max())
                evidence = evidence_for(here, depth, surface, scene.seen_by, _fixed_in(region, fixed), top)
                bead = _chance_of_bead(region, wall, parameters)
                widened = flattened(depth, here, surface, scene.seen_by.held, wall.ways_mm)
                lone_mm = uncut.depth_mm if abs(uncut.depth_mm) > abs(depth.depth_mm) else None
                if lone_mm is not None:
                    widened = reaching(widened, uncut, here, whole)
                told = describe(here, widened, surface, scene)
                by_noise = replace(told, depth_sigma_mm=depth.sigma_mm)
                yield Found(region, told, by_noise, evidence, bead, lone_mm)
                break
        context.progress(len(regions) + done, 2 * len(regions))


def _depth_of(
    region: Region,
    here: Region,
    surface: Surface,
    wall: MeasuredWall,
    clean: CleanWall,
    parameters: DefectParameters,
    context: Context,
) -> Depth:
    """Return the depth of a region; ``here`` is that region with rows counted from the surface's first."""
    if region.all_round:
        return measure_all_round(
            here, surface, clean, bore_beside(region, wall.relief.radius_map, wall.rings_mm)
        )
    return measure_depth(here, surface, clean, parameters.draws, context.random)


def _contradicted(depth: Depth, here: Region, surface: Surface) -> int | None:
    """Return the next frame to be left out when a region is measured, None where there is none."""
    if here.all_round or len(surface.left_out) >= _MOST_LEFT_OUT:
        return None
    return contradicted_frame(depth, here, surface)


def _chance_of_bead(region: Region, wall: MeasuredWall, parameters: DefectParameters) -> float:
    """Return the probability that a region is not a step of the bore's diameter."""
    radius_map = wall.relief.radius_map
    if not goes_round(region, radius_map):
        return 1.0
    return bore_beside(region, radius_map, wall.rings_mm).chance_of_bead(parameters.min_depth_mm)


def _lines(
    wall: MeasuredWall,
    found: Sequence[Found],
    clean: CleanWall,
    scene: Scene,
    parameters: DefectParameters,
    context: Context,
) -> Iterator[Defect]:
    """Yield dark lines that only the photo shows; one beside a finding of the rings belongs to it."""
    for region in dark_lines(scene.seen_by.texture, wall.relief, context.scratch):
        beside = any(lies_beside(region, f.region, wall.relief) for f in found)
        surface, here = wall.surface_about(region, every_point=True)
        if not beside and _is_measured(surface, here):
            depth = measure_depth(here, surface, clean, parameters.draws, context.random)
            yield describe_line(here, depth, surface, scene)


def _fixed_in(region: Region, fixed: FixedToProbe | None) -> Float:
    """Return the displacement of the line that stays at one place of the image, over a region (H, W), mm."""
    if fixed is None:
        return np.zeros(region.mask.shape)
    rows = fixed.departure_mm[region.row : region.row + len(region.mask)].astype(float)
    return region.counted_from(region.row).cut(rows)


def _is_measured(surface: Surface, region: Region) -> bool:
    """Whether any cell of a region has a measured surface: some regions between distant rings have none."""
    shown = region.cut(surface.all_mm if region.all_round else surface.local_mm)
    return bool(np.isfinite(shown[region.mask]).any())


def _refuse_unseen(wall: Wall) -> None:
    """Raise UnusableError when too little of the wall was measured to determine its smooth shape."""
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
    """Return the depth, mm, at which 9 of 10 defects of 3 mm × 3 mm pass threshold and smallest depth."""
    chance = float(ndtri(0.9))
    found = (detection.threshold + chance) * detection.small_sigma_mm
    return max(found, parameters.min_depth_mm + chance * detection.small_sigma_mm)


def _defects_of_run(
    recording: Recording,
    frames: CheckedFrames,
    probe: Probe,
    trajectory: Trajectory,
    rings: RingSamples,
    wall: Wall,
    texture: WallTexture,
    parameters: DefectParameters,
    context: Context,
) -> Defects:
    """Find the defects of a run, with the evidence of its rings and lit pictures."""
    pictures = LitPictures(frames.applied_to(recording), probe.as_found_in(trajectory), trajectory)
    on_wall = told_by_roll(rings, trajectory)
    return find_defects(recording, wall, texture, parameters, context, on_wall, pictures)


DEFECTS = Stage(
    "defects", "48", DefectParameters, _defects_of_run, "defects as instances with depth, clock and kind"
)
