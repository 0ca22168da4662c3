"""Evidence for a defect besides the ring that shows it: a second ring, or the photo of the wall.

A glint, a splash or a piece of texture taken for the line shows in one ring. A place of the wall shows in
every ring that crosses it, whichever pass of the probe that ring is of, and often in the photo, which is
taken under another light. What stays at one place of the image while the wall goes by
(`stages.accumulate.fixed`) shows in every ring and is no wall. Where a cable or water hides the wall the line
ends, and what lies at its end is as much the end's as the wall's, in every ring.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import label

from pipeline.adjustment.shared_light import NOTHING_HELD, HeldOver
from pipeline.arrays import Bool, Float, Int
from pipeline.artefacts.measured import PointCloud, RingSamples, RingValidity, WallTexture
from stages.defects.depth import Depth
from stages.defects.neighbours import frames_at_peak
from stages.defects.parallax import LitPictures
from stages.defects.relief import Relief
from stages.defects.segment import Region
from stages.defects.surface import Surface, cells_of, sure_of_themselves

LEAST_RINGS = 2
# A ring speaks for a defect where a fifth of its samples there are off the wall by a quarter of the depth, as
# beside the deepest place of a bell, and by two σ of the wall's own unevenness.
_TOP_SHARE, _DEPTH_SHARE, _NOISE_SIGMAS = 0.2, 0.25, 2.0
_LEAST_SAMPLES = 3
# Of any ten places of a ring one is as bright as this.
_BRIGHT = 0.9
# Most are half of the rings. A codec hands a glint on to a picture or two after it and before it: up to four
# or five rings show it.
_MOST, MANY_RINGS = 0.5, 6
# The photo speaks for it where it is darker or brighter there than at all of so many places beside it: by
# chance once in 41 times for either.
_PLACES = 40
# A finding is what is fixed to the image where that makes up half of its depth in half of its cells. Chosen:
# a droplet's own finding has it in nine of ten cells, a defect beside one in none.
_FIXED_SHARE = 0.5
# A row of a finding lies at the edge of what was seen where it is deepest within the millimetre of a depth's
# mean. Of a finding beside hidden wall all rows do, of one that merely touches it few: more than half counts.
_EDGE_MM, _EDGE_SHARE = 1.0, 0.5


@dataclass(frozen=True)
class Evidence:
    """Evidence for and against a finding.

    Attributes
    ----------
    rings : int
        How many show it; rings that share light of a codec count together.
    photo : bool, optional
        Whether the photo does; None where it cannot tell.
    score : float
        How far the search for it stands out, σ.
    fixed : bool
        Whether it stays at one place of the image while the wall goes by.
    edge : bool
        Whether it is deepest beside hidden wall.
    bright : bool
        Whether the line is brighter there than at nine of ten places of the ring that shows it deepest, and
        where many show it of most.
    contradicted : bool
        Whether lit pictures, taken when the line was elsewhere, show the wall without it.
    in_the_way : bool
        Whether the probe would have driven through it.
    """

    rings: int
    photo: bool | None
    score: float
    fixed: bool = False
    edge: bool = False
    bright: bool = False
    contradicted: bool = False
    in_the_way: bool = False

    @property
    def on_wall(self) -> bool:
        """Whether it is the wall's, and not as likely of the probe or of where the line ends."""
        return not (self.fixed or self.edge or self.contradicted or self.in_the_way)

    @property
    def corroborated(self) -> bool:
        """Whether two rings, or one and the photo, show it on the wall."""
        return self.on_wall and (self.rings >= LEAST_RINGS or (self.photo is True and self.rings > 0))

    @property
    def doubt(self) -> str:
        """Why it is not counted, in words."""
        if self.fixed:
            return (
                "It stays at one place of the image while the wall goes by, as something on the window or on "
                "the probe does: see the warnings of accumulate"
            )
        if self.contradicted:
            return (
                "Lit pictures taken before and after, when the line was elsewhere, show the wall without it: "
                "a drop or dirt on the window may have moved the line while it passed"
            )
        if self.in_the_way:
            return (
                "The probe drove past it, and its lamps would have struck it there: a reflection or stray "
                "light was taken for the line"
            )
        if self.edge:
            return (
                "It is deepest where the wall ceases to be seen: the line ends there, and what hides the "
                "wall may have drawn it aside"
            )
        if not self.corroborated:
            return "No second ring shows it by light of its own, nor do one ring and the photo"
        if self.bright:
            return (
                "The line is brighter there than at nine of ten places of its ring, as of a glint or a "
                "reflection, and more findings are so than defects are by chance"
            )
        return "Of findings like it, more are false than real in such footage"


@dataclass(frozen=True)
class Witnesses:
    """What findings are compared with: the wall's photo, and rings and lit pictures where they are known.

    Rings that a codec ``held`` alike are no witnesses of their own.
    """

    texture: WallTexture
    rings: RingSamples | None = None
    pictures: LitPictures | None = None
    held: HeldOver = NOTHING_HELD


def evidence_for(
    region: Region, depth: Depth, surface: Surface, seen_by: Witnesses, fixed_mm: Float, score: float
) -> Evidence:
    """Return the evidence of rings and photo, and whether a finding is ``fixed_mm`` (H, W) to the image.

    The photo is laid on the wall as it was measured: where the depth itself shifts the picture by more than
    the finding's size, the picture differs there because of the depth and is no second witness.
    """
    relief = surface.relief
    size = min(n * c for n, c in zip(region.mask.shape, relief.cell_mm, strict=True))
    shifted = abs(depth.depth_mm) > size
    # A pit in a wider patch makes up less than a fifth of any ring in it.
    showing = np.union1d(
        frames_behind(region, depth.depth_mm, surface), frames_at_peak(depth, region, surface)
    )
    return Evidence(
        seen_by.held.independent(len(showing)),
        None if shifted else photo_stands_out(seen_by.texture, relief, region),
        score,
        _is_fixed(region, surface, fixed_mm),
        lies_at_edge(region, relief),
        seen_by.rings is not None and line_is_bright(region, depth.depth_mm, surface, seen_by.rings),
        seen_by.pictures is not None and seen_by.pictures.contradict(region, relief),
        seen_by.pictures is not None and seen_by.pictures.drove_through(region, depth, relief),
    )


def line_is_bright(region: Region, depth_mm: float, surface: Surface, rings: RingSamples) -> bool:
    """Whether the line is brighter in the region than at nine of ten places of the deepest ring there.

    A glint or a reflection that was taken for the line is; a defect is one time in ten. Where more rings show
    it than a codec hands a glint on to, most of them are asked: a glint on a defect makes it none.
    """
    points = surface.near
    i, j, inside = cells_of(points, surface.relief, region)
    height = np.sign(depth_mm) * (points.radius_mm - surface.relief.shape_at(i, j))
    if not inside.any():
        return False
    deepest = int(points.frame[np.argmax(np.where(inside, height, -np.inf))])
    if not _is_bright(height, inside, points, rings, deepest):
        return False
    showing = frames_behind(region, depth_mm, surface)
    if len(showing) < MANY_RINGS:
        return True
    told = [_is_bright(height, inside, points, rings, int(k)) for k in showing]
    known = [bright for bright in told if bright is not None]
    return not known or float(np.mean(known)) >= _MOST


def _is_bright(
    height: Float, inside: Bool, points: PointCloud, rings: RingSamples, frame: int
) -> bool | None:
    """Whether a frame's line is bright where it stands highest ``inside``; None where that is not known."""
    its = points.frame == frame
    ring = np.flatnonzero(rings.frame == frame)
    used = np.flatnonzero(rings.validity[ring[0]] == RingValidity.VALID) if len(ring) else ring
    if len(used) != its.sum():  # a part of the ring lies beyond these rows
        return None
    # points lie in the order of their ring's samples
    line, there = rings.amplitude[ring[0], used], inside[its]
    highest = float(height[its][there].max())
    if highest <= 0:  # the ring lies to the other side of the wall
        return None
    top = there & (height[its] >= highest / 2)
    return float(np.mean(line < np.median(line[top]))) > _BRIGHT


def lies_at_edge(region: Region, relief: Relief) -> bool:
    """Whether most of a finding's rows are deepest at the edge of hidden wall that is wider than they are.

    Narrower gaps are the finding's own: a steep flank hides a part of what is behind it.
    """
    columns, reach = region.mask.shape[1], int(np.ceil(_EDGE_MM / relief.cell_mm[1]))
    margin = columns + reach
    wide = Region(region.row, region.column - margin, np.pad(region.mask, ((0, 0), (margin, margin))), 0.0)
    height = np.abs(wide.cut(relief.local_mm))
    rows = np.flatnonzero((wide.mask & np.isfinite(height)).any(1))
    if region.all_round or not len(rows):
        return False
    return float(np.mean([_ends(height[k], wide.mask[k], reach) for k in rows])) > _EDGE_SHARE


def _ends(height: Float, inside: Bool, reach: int) -> bool:
    """Whether a row (n,) is deepest within reach of unseen cells, more of them than it has inside."""
    shown = inside & np.isfinite(height)
    deepest = int(np.argmax(np.where(shown, height, -1.0)))
    runs, _ = label(np.isnan(height))
    near = runs[max(deepest - reach, 0) : deepest + reach + 1]
    return any(np.sum(runs == k) > shown.sum() for k in np.unique(near[near > 0]))


def _is_fixed(region: Region, surface: Surface, fixed_mm: Float) -> bool:
    """Whether what stays at one place of the image makes up a finding."""
    height = np.abs(region.cut(surface.local_mm))[region.mask]
    explained = fixed_mm[region.mask] > np.maximum(_FIXED_SHARE * np.nan_to_num(height), 0.0)
    return bool(explained.mean() > _FIXED_SHARE)


def frames_behind(region: Region, depth_mm: float, surface: Surface) -> Int:
    """Return the frames (n,) whose rings show a defect of this depth by samples that are sure."""
    relief, points = surface.relief, surface.near
    i, j, inside = cells_of(points, relief, region)
    inside &= sure_of_themselves(points)
    deviation = points.radius_mm[inside] - relief.shape_at(i[inside], j[inside])
    limit = max(_DEPTH_SHARE * abs(depth_mm), _NOISE_SIGMAS * relief.typical.sigma_mm)
    frame, ring, count = np.unique(points.frame[inside], return_inverse=True, return_counts=True)
    showing = np.bincount(ring, np.sign(depth_mm) * deviation > limit, len(frame))
    return np.asarray(frame[showing >= np.maximum(_TOP_SHARE * count, _LEAST_SAMPLES)])


def photo_stands_out(texture: WallTexture, relief: Relief, region: Region) -> bool | None:
    """Whether the photo differs in the region more from what is around than at all places beside it.

    It cannot tell, None, of what goes all round, and where it is not known.
    """
    if region.all_round:
        return None
    turns = np.arange(1, _PLACES + 1) * len(relief.azimuth_rad) // (_PLACES + 1)
    here = abs(darkness(texture, relief, region))
    beside = [abs(darkness(texture, relief, region.turned(int(turn)))) for turn in turns]
    return bool(here > np.nanmax(beside, initial=0.0)) if np.isfinite(here) else None


def darkness(texture: WallTexture, relief: Relief, region: Region) -> float:
    """Return by which fraction the photo is darker inside than in a frame around; NaN where unknown."""
    margin = max(4, min(region.mask.shape) // 2)
    rows = np.arange(region.row - margin, region.row + region.mask.shape[0] + margin)
    columns = np.arange(region.column - margin, region.column + region.mask.shape[1] + margin)
    s = relief.distance_mm[0] + rows * relief.cell_mm[0]
    psi = relief.azimuth_rad[0] + columns * (relief.azimuth_rad[1] - relief.azimuth_rad[0])
    i = np.rint((s - texture.distance_from_mm) / texture.mm_per_px).astype(int)
    j = np.rint((psi - texture.azimuth_from_rad) / texture.rad_per_px).astype(int)
    j %= max(1, round(2 * np.pi / texture.rad_per_px))
    known = np.ix_((i >= 0) & (i < texture.bgra.shape[0]), j < texture.bgra.shape[1])
    photo = texture.bgra[np.ix_(i[known[0][:, 0]], j[known[1][0]])]
    inside = np.pad(region.mask, margin)[known]
    grey, seen = photo[..., :3].mean(-1), photo[..., 3] > 0
    if not (inside & seen).any() or not (~inside & seen).any():
        return float("nan")
    return float(1 - grey[inside & seen].mean() / max(1.0, float(grey[~inside & seen].mean())))
