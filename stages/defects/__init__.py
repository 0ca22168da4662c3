"""Wall to defects: what stands off the pipe's own smooth shape, told from noise, measured, named.

1. Take the pipe's own slowly varying shape out (`relief`), and the motion of single rings; once more when it
   is known where the defects are.
2. Matched filters over scales, threshold from a wished number of false alarms (`detect`).
3. Hysteresis (`grow`) to instances with outlines; all-round beads are welds (`segment`).
4. Depth as the extreme of a 1 mm mean (`surface`), without what noise adds, ± 1 σ (`depth`, `smear`).
5. What neither a second ring nor the photo confirms, stays at one place of the image, lies where the line
ends, or is rather false than real by what the same recording shows where nothing is, is set apart with the
reason (`corroborate`, `credibility`).
6. Kind from named features as a probability, with codes and words (`describe`).
7. Dark lines that the photo alone shows, as cracks are, are set apart, too (`dark_lines`).

A long wall is gone through in stretches with overlap; what is found does not depend on where they are cut.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtri

from pipeline.arrays import Float, Float32
from pipeline.artefacts.cloud_along import cloud_along
from pipeline.artefacts.findings import Defect, Defects
from pipeline.artefacts.measured import RingSamples, Trajectory, Wall, WallTexture
from pipeline.artefacts.wall_map import FixedToProbe
from pipeline.errors import UnusableError
from pipeline.instrument.probe import Probe
from pipeline.machine.stage import Context, Stage
from pipeline.recording.base import Recording
from pipeline.recording.checks import CheckedFrames
from stages.defects.along import stretches
from stages.defects.clean import CleanWall, clean_wall
from stages.defects.corroborate import Evidence, Witnesses, evidence_for
from stages.defects.credibility import (
    COUNTED,
    MOST_SURE,
    Credibility,
    chance_of_depth,
    credibility_of,
    is_depth_known,
)
from stages.defects.dark_lines import dark_lines, lies_beside
from stages.defects.depth import allowed_by_neighbours, measure_depth
from stages.defects.describe import Scene, describe, describe_line
from stages.defects.detect import Detection, detect
from stages.defects.grow import footprint, grown
from stages.defects.noise_tail import NoiseTail, noise_tail
from stages.defects.parallax import LitPictures
from stages.defects.parameters import DefectParameters
from stages.defects.relief import smooth_shape_removed
from stages.defects.segment import Region, regions_of
from stages.defects.smear import flattened
from stages.defects.steps import IS_STEP, is_step
from stages.defects.surface import MeasuredWall, Surface
from stages.defects.told import report_found, report_unconfirmed, warn_of_missed, warn_of_short_ones

__all__ = ["DEFECTS", "DefectParameters", "find_defects"]

_MIN_CELLS, _MIN_CIRCLES, _HALF = 1000, 8, 0.5
# Nothing says that what stays at one place of the image, or lies where the line ends, is rather the wall.
_WALL_OR_NOT = 0.5
_UNSURE = "Its depth is not known to twice its σ"
_AT_LEAST = (
    "It is at least so deep, to ± {:.2f} mm by noise, which does not make it: the rest of σ is what pictures "
    "that hold some of those before them may have taken off."
)


def find_defects(
    recording: Recording,
    wall: Wall,
    texture: WallTexture,
    parameters: DefectParameters,
    context: Context,
    rings: RingSamples | None = None,
    pictures: LitPictures | None = None,
) -> Defects:
    """Find, outline, measure and name the defects of a wall.

    Its ``rings`` tell how bright the line was, ``pictures`` whether the wall looks as it was measured.

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
    credibility = _credibility(found, tail, measured)
    context.report("peaks of noise expected above the threshold", tail.above(seeds.threshold), "")
    confirmed, unconfirmed = _judged(found, credibility, parameters.min_depth_mm)
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


@dataclass(frozen=True)
class _Found:
    """A region that is deep enough to be reported, described as if it were surely there.

    ``by_noise`` is the same with the σ that noise alone makes. It may be a ``step`` of the bore.
    """

    region: Region
    defect: Defect
    by_noise: Defect
    evidence: Evidence
    step: bool

    @property
    def flattened(self) -> bool:
        """Whether it is deeper than noise makes it, and may have been flattened by about its depth."""
        return is_depth_known(self.by_noise) and not is_depth_known(self.defect)

    def told(self, probability: float, counts: bool) -> Defect:
        """Return it with its probability, and if it counts in words whether its depth is a lower bound.

        Of what goes all round it is none: the deepest place of so many may be a glint's on it.
        """
        words = _AT_LEAST.format(self.by_noise.depth_sigma_mm)
        bound = counts and self.flattened and not self.region.all_round
        told = f"{self.defect.statement} {words}" if bound else self.defect.statement
        sure = self.defect.confidence * probability
        return replace(self.defect, probability=probability, confidence=sure, statement=told)


def _credibility(found: Sequence[_Found], tail: NoiseTail, wall: MeasuredWall) -> Credibility:
    """Return what is to be expected by the findings on the wall; welds and steps are left out."""
    used = [f for f in found if f.evidence.on_wall and not (f.region.all_round or f.step)]
    column = 2 * np.pi / wall.relief.shape[1]
    widths = [f.region.mask.shape[1] * column for f in used]
    rings = len(np.unique(wall.cloud.cloud.frame))
    return credibility_of([f.evidence for f in used], widths, rings, tail)


def _measured(
    wall: MeasuredWall,
    regions: tuple[Region, ...],
    clean: CleanWall,
    score: Float32,
    scene: Scene,
    fixed: FixedToProbe | None,
    parameters: DefectParameters,
    context: Context,
) -> Iterator[_Found]:
    """Yield the regions that were measured and are as deep as is worth reporting."""
    for done, region in enumerate(regions, 1):
        # A region that the sure points do not show is measured once more with all points.
        for every_point in (False, True):
            surface, here = wall.surface_about(region, every_point)
            if not _is_measured(surface, here):
                continue
            depth = measure_depth(here, surface, clean, parameters.draws, context.random)
            depth = allowed_by_neighbours(depth, here, surface)
            if region.sign * depth.depth_mm >= parameters.min_depth_mm:
                top = float(region.cut(score.astype(float))[region.mask].max())
                evidence = evidence_for(here, depth, surface, scene.seen_by, _fixed_in(region, fixed), top)
                step = is_step(region, depth.depth_mm, wall.relief.radius_map)
                widened = flattened(depth, here, surface, scene.seen_by.held, wall.ways_mm)
                told = describe(here, widened, surface, scene)
                yield _Found(region, told, replace(told, depth_sigma_mm=depth.sigma_mm), evidence, step)
                break
        context.progress(len(regions) + done, 2 * len(regions))


def _lines(
    wall: MeasuredWall,
    found: Sequence[_Found],
    clean: CleanWall,
    scene: Scene,
    parameters: DefectParameters,
    context: Context,
) -> Iterator[Defect]:
    """Yield the dark lines that the photo alone shows; one beside what rings show is a part of it."""
    for region in dark_lines(scene.seen_by.texture, wall.relief, context.scratch):
        beside = any(lies_beside(region, f.region, wall.relief) for f in found)
        surface, here = wall.surface_about(region, every_point=True)
        if not beside and _is_measured(surface, here):
            depth = measure_depth(here, surface, clean, parameters.draws, context.random)
            yield describe_line(here, depth, surface, scene)


def _fixed_in(region: Region, fixed: FixedToProbe | None) -> Float:
    """Return by how much the line departs in a region (H, W) at one place of the image, mm."""
    if fixed is None:
        return np.zeros(region.mask.shape)
    rows = fixed.departure_mm[region.row : region.row + len(region.mask)].astype(float)
    return region.counted_from(region.row).cut(rows)


def _judged(
    found: Sequence[_Found], credibility: Credibility, min_depth_mm: float
) -> tuple[list[Defect], list[Defect]]:
    """Return what is confirmed, and what is not, with the reason."""
    confirmed: list[Defect] = []
    unconfirmed: list[Defect] = []
    for f in found:
        deep = chance_of_depth(f.by_noise, min_depth_mm)
        real = deep if f.region.all_round else deep * credibility.chance_against_clutter(f.evidence)
        real = min(real, MOST_SURE) * (1.0 if f.evidence.on_wall else _WALL_OR_NOT)
        real = 0.0 if f.step else real
        counts = f.evidence.corroborated and real >= COUNTED and is_depth_known(f.by_noise)
        defect = f.told(real, counts)
        if counts:
            confirmed.append(defect)
        else:
            doubt = f.evidence.doubt if is_depth_known(f.by_noise) or not f.evidence.corroborated else _UNSURE
            doubt = IS_STEP if f.step else doubt
            words = f"{defect.statement} Not confirmed. {doubt}."
            unconfirmed.append(replace(defect, statement=words))
    return confirmed, unconfirmed


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
    """Find the defects of a run, with all that its rings and lit pictures say of them."""
    pictures = LitPictures(frames.applied_to(recording), probe.as_found_in(trajectory), trajectory)
    return find_defects(recording, wall, texture, parameters, context, rings, pictures)


DEFECTS = Stage(
    "defects", "34", DefectParameters, _defects_of_run, "defects as instances with depth, clock and kind"
)
