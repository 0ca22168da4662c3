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
   one place of the image or where something does while the wall moves, it lies where the line ends, or the
   recording itself shows that findings like it are more often false than real (`corroborate`,
   `static_places`, `credibility`).
6. Give a probability to each kind of defect by named features, and write codes and a description
   (`describe`).
7. List dark lines that only the photo shows, as cracks are, among the unconfirmed findings (`dark_lines`).
8. State, stretch by stretch, from which size and depth on defects are found (`limits`).

A long wall is processed in overlapping stretches along the pipe; the result does not depend on where they are
cut.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from pipeline.arrays import Bool, Float, Float32
from pipeline.artefacts.cloud_along import cloud_along
from pipeline.artefacts.findings import Defect, Defects
from pipeline.artefacts.measured import RingSamples, Trajectory, Wall, WallTexture
from pipeline.artefacts.moved_back import kept_by_roll
from pipeline.artefacts.wall_map import FixedToProbe
from pipeline.errors import UnusableError
from pipeline.instrument.probe import Probe
from pipeline.machine.stage import Context, Stage
from pipeline.recording.base import Recording
from pipeline.recording.checks import CheckedFrames
from pipeline.system.parallel import in_threads
from stages.defects.all_along import may_be_on_window
from stages.defects.along import stretches
from stages.defects.clean import clean_wall
from stages.defects.corroborate import Evidence, Witnesses, evidence_for
from stages.defects.dark_lines import dark_lines, lies_beside
from stages.defects.depth import Depth
from stages.defects.describe import Scene, describe, describe_line
from stages.defects.detect import Detection, detect
from stages.defects.grow import footprint, grown
from stages.defects.judge import Found, credibility_on, judged
from stages.defects.limits import detectable
from stages.defects.measure import Measured, Measurer
from stages.defects.noise_tail import noise_tail
from stages.defects.parallax import LitPictures
from stages.defects.parameters import DefectParameters
from stages.defects.relief import WallRelief, smooth_shape_removed
from stages.defects.report import report_detectable, report_findings
from stages.defects.segment import Region, regions_of
from stages.defects.smear import flattened
from stages.defects.surface import MeasuredWall

__all__ = ["DEFECTS", "DefectParameters", "find_defects"]

# Least wall for a search: 1000 cells, and 8 circles of the map of which half of the cells were measured
# (chosen).
_MIN_CELLS, _MIN_CIRCLES, _HALF = 1000, 8, 0.5


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
    relief, seeds, known = _searched(wall, parameters, context)
    cells = grown(relief, seeds, parameters, context.scratch)
    regions = regions_of(relief, cells, parameters.join_mm, context.scratch)
    seen_by = Witnesses(texture, rings, pictures, wall.held)
    scene = Scene(seen_by, recording.pipe.wall_thickness_mm, parameters.min_depth_mm)
    cloud = cloud_along(wall.cloud)
    measured = MeasuredWall(relief, cloud, cloud.ring_spacing_mm())
    measurer = Measurer(measured, clean_wall(measured, regions), parameters, context.random)
    found = _all_found(regions, measurer, seeds.score, scene, wall.fixed, context)
    tail = noise_tail(relief, seeds, known)
    credibility = credibility_on(found, tail, measured)
    confirmed, unconfirmed = judged(found, credibility, parameters.min_depth_mm)
    lines = list(_lines(measurer, found, scene, context))
    items, alone = _numbered(confirmed, 1), _numbered([*unconfirmed, *lines], len(confirmed) + 1)
    limits = detectable(measured, seeds, credibility, texture, wall.held, parameters)
    context.report("peaks of noise expected above the threshold", tail.above(seeds.threshold), "")
    rejected = len(regions) - len(found)
    context.report("rejected: shallower than the smallest depth or between rings", rejected, "detections")
    defects = Defects(items, sum(1 - d.probability for d in items), limits, alone)
    report_findings(defects, len(lines), sum(f.evidence.moved_over for f in found), context)
    report_detectable(limits, parameters, wall.held, measured.spacing_mm, context)
    return defects


def _searched(
    wall: Wall, parameters: DefectParameters, context: Context
) -> tuple[WallRelief, Detection, Bool]:
    """Return the relief, where it exceeds the noise, and the cells that were left out of the smooth shape."""
    relief = smooth_shape_removed(wall.radius_map, parameters)
    seeds = detect(relief, parameters.false_alarms, context.scratch, context.progress)
    known = footprint(relief, grown(relief, seeds, parameters, context.scratch), context.scratch)
    return smooth_shape_removed(wall.radius_map, parameters, known), seeds, known


def _all_found(
    regions: Sequence[Region],
    measurer: Measurer,
    score: Float32,
    scene: Scene,
    fixed: FixedToProbe | None,
    context: Context,
) -> list[Found]:
    """Return what the regions show, those left out that were not measured or are too shallow."""

    def shown_by(own: tuple[Region, np.random.Generator]) -> Found | None:
        """Return what a region shows, with random numbers that do not depend on the other regions."""
        return _found_in(own[0], replace(measurer, random=own[1]), score, scene, fixed)

    own = zip(regions, context.random.spawn(len(regions)), strict=True)
    looked_at = in_threads(shown_by, own, context.workers)
    return [f for f in _with_progress(looked_at, len(regions), context) if f is not None]


def _numbered(found: Sequence[Defect], first: int) -> tuple[Defect, ...]:
    return tuple(replace(defect, id=n) for n, defect in enumerate(found, first))


def _with_progress(found: Iterator[Found | None], regions: int, context: Context) -> Iterator[Found | None]:
    """Yield what regions show, and report the progress; the first half of it was the search for them."""
    for done, each in enumerate(found, 1):
        yield each
        context.progress(regions + done, 2 * regions)


def _found_in(
    region: Region, measurer: Measurer, score: Float32, scene: Scene, fixed: FixedToProbe | None
) -> Found | None:
    """Return what a region shows; None where it was not measured or is too shallow to be reported.

    A region without points of usual σ is measured once more with all points.
    """
    for every_point in (False, True):
        whole = measurer.measured(region, every_point)
        if whole is None:
            continue
        spots = scene.seen_by.spots_in(whole.here, whole.depth, whole.surface)
        clear = measurer.measured(region, every_point, tuple(spots)) if spots else whole
        is_spot = bool(spots) and (clear is None or not clear.depth.is_known)
        whole = whole if clear is None or is_spot else clear
        kept = measurer.without_contradicted(region, every_point, whole)
        if region.sign * kept.allowed.depth_mm >= scene.min_depth_mm:
            fixed_mm = _fixed_in(region, fixed, measurer, scene.seen_by)
            top = kept.best(region.cut(score.astype(float)))
            evidence = evidence_for(
                kept.here, kept.allowed, kept.surface, scene.seen_by, fixed_mm, top, spots
            )
            return _described(region, measurer, scene, (whole, kept), replace(evidence, spot=is_spot))
    return None


def _described(
    region: Region, measurer: Measurer, scene: Scene, measured: tuple[Measured, Measured], evidence: Evidence
) -> Found:
    """Return a region with its ``evidence``; ``measured`` with all rings, and with those that were kept."""
    whole, kept = measured
    here, surface, depth = kept.here, kept.surface, kept.allowed
    depth = _displaced(depth, region, measurer)
    cut = abs(whole.depth.depth_mm) - abs(depth.depth_mm)
    widened = flattened(depth, here, surface, scene.seen_by.held, measurer.wall.ways_mm)
    without_them_mm = widened.sigma_mm
    if cut > 0 and whole.rings.may_be_a_pit:
        widened = replace(widened, sigma_mm=float(np.hypot(widened.sigma_mm, cut)))
    described = describe(here, widened, surface, scene)
    by_noise = replace(described, depth_sigma_mm=depth.sigma_mm)
    bead = measurer.chance_of_bead(region)
    if cut <= 0:
        return Found(region, described, by_noise, evidence, bead)
    return Found(region, described, by_noise, evidence, bead, whole.depth.depth_mm, without_them_mm)


def _lines(measurer: Measurer, found: Sequence[Found], scene: Scene, context: Context) -> Iterator[Defect]:
    """Yield dark lines that only the photo shows; one beside a finding of the rings belongs to it."""
    relief = measurer.wall.relief
    for region in dark_lines(scene.seen_by.texture, relief, context.scratch):
        beside = any(lies_beside(region, f.region, relief) for f in found)
        line = None if beside else measurer.measured(region, every_point=True)
        if line is not None:
            depth = _displaced(line.depth, region, measurer)
            yield describe_line(line.here, depth, line.surface, scene)


def _displaced(depth: Depth, region: Region, measurer: Measurer) -> Depth:
    """Return a depth whose σ includes what displaces the line from place to place in the region's rows."""
    rows = slice(region.row, region.row + len(region.mask))
    local_mm = measurer.wall.relief.radius_map.displaced_in(rows).max(initial=0.0)
    return replace(depth, sigma_mm=float(np.hypot(depth.sigma_mm, local_mm)))


def _fixed_in(region: Region, fixed: FixedToProbe | None, measurer: Measurer, seen_by: Witnesses) -> Float:
    """Return the displacement of the line that stays at one place of the image, over a region (H, W), mm.

    It is infinite where the region is as long as the run, and may be on the window for all that is known.
    """
    if _may_be_on_window(region, measurer, seen_by):
        return np.full(region.mask.shape, np.inf)
    if fixed is None:
        return np.zeros(region.mask.shape)
    rows = fixed.departure_mm[region.row : region.row + len(region.mask)].astype(float)
    return region.counted_from(region.row).cut(rows)


def _may_be_on_window(region: Region, measurer: Measurer, seen_by: Witnesses) -> bool:
    """Return whether a region may be as long as the run because it is on the window."""
    if seen_by.pictures is None:
        return False
    wall = measurer.wall
    return may_be_on_window(region, wall.relief, wall.cloud, seen_by.pictures.motion)


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
    on_wall = kept_by_roll(rings, trajectory)
    return find_defects(recording, wall, texture, parameters, context, on_wall, pictures)


DEFECTS = Stage(
    "defects", "80", DefectParameters, _defects_of_run, "defects as instances with depth, clock and kind"
)
