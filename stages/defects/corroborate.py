"""Evidence for a defect beyond the one ring that shows it: a second ring, or the photo of the wall.

A glint, a splash or a patch of texture that is taken for the line appears in one ring. A real defect appears
in every ring that crosses it, on every pass of the probe, and often in the photo, which is taken under other
light. What stays at one place of the image while the wall goes by (`stages.accumulate.fixed`) appears in
every ring and is not on the wall. Where a cable or water hides the wall, the line ends; what lies at its end
may in every ring be an effect of that end.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.ndimage import label

from pipeline.adjustment.shared_light import NOTHING_HELD, HeldOver
from pipeline.arrays import Bool, Float, Int
from pipeline.artefacts.measured import PointCloud, RingSamples, RingValidity, WallTexture
from stages.defects import reasons
from stages.defects.behind_drop import shows_drop
from stages.defects.depth import Depth
from stages.defects.marred import without_glints
from stages.defects.neighbours import frames_at_peak, shown_in_a_row
from stages.defects.parallax import LitPictures
from stages.defects.photo import photo_stands_out
from stages.defects.relief import Relief
from stages.defects.segment import Region
from stages.defects.shining_spot import frames_with_spots
from stages.defects.static_places import StaticPlaces
from stages.defects.surface import Surface, cells_of, of_usual_sigma

LEAST_RINGS = 2
# A ring shows a defect if a fifth of its samples there deviate by a quarter of the depth, as they do beside
# the deepest place of a bell, and by two σ of the wall's own unevenness.
_TOP_SHARE, DEPTH_SHARE, NOISE_SIGMAS = 0.2, 0.25, 2.0
LEAST_SAMPLES = 3
# Bright means brighter than nine of ten places of the ring.
_BRIGHT = 0.9
# Half of the asked rings must be bright there. A codec repeats a glint in one or two pictures before and
# after it, so that up to five rings show it; six or more rings are asked one by one.
_MOST, MANY_RINGS = 0.5, 6
# A finding counts as fixed to the image if what is fixed makes up half of its depth in half of its cells.
# Chosen: for a droplet's own finding it does in nine of ten cells, for a defect beside a droplet in none.
_FIXED_SHARE = 0.5
# A row of a finding is at the edge of the seen wall if it is deepest within 1 mm of it, the length over which
# a depth is averaged. All rows of a finding that the edge causes are, few of one that only touches it: more
# than half of the rows decides.
_EDGE_MM, _EDGE_SHARE = 1.0, 0.5


@dataclass(frozen=True)
class Evidence:
    """Evidence for and against a finding.

    Attributes
    ----------
    rings : int
        Number of independent rings in a row that show it, without a glint; those with the same light are one.
    photo : bool, optional
        Whether the photo shows it; None where the photo cannot decide.
    score : float
        Largest matched-filter response, σ.
    fixed : bool
        Whether it stays at one place of the image while the wall goes by, or may: it is as long as the run.
    edge : bool
        Whether it is deepest beside hidden wall.
    bright : bool
        Whether the line is brighter there than at nine of ten places of the ring that shows it deepest; where
        six or more rings show it, of most of them.
    contradicted : bool
        Whether lit pictures, taken when the line was elsewhere, show the wall without it.
    spot : bool
        Whether its depth is that of rings in which a spot of the wall shines beside the line.
    in_probe_path, behind_drop : bool
        Whether the probe would have collided with it; whether lit pictures show the wall displaced there, but
        only while the line passed it.
    behind_static : bool
        Whether something stays in the picture there while the wall moves.
    """

    rings: int
    photo: bool | None
    score: float
    fixed: bool = False
    edge: bool = False
    bright: bool = False
    contradicted: bool = False
    in_probe_path: bool = False
    behind_drop: bool = False
    spot: bool = False
    behind_static: bool = False

    @property
    def on_wall(self) -> bool:
        """Whether it belongs to the wall, and is not explained by the probe or by the end of the line."""
        at_camera = self.fixed or self.behind_static or self.moved_over
        return not (at_camera or self.edge or self.in_probe_path or self.spot)

    @property
    def moved_over(self) -> bool:
        """Whether lit pictures tell that something moved over the window while the line passed."""
        return self.contradicted or self.behind_drop

    @property
    def corroborated(self) -> bool:
        """Whether two rings, or one and the photo, show it on the wall."""
        return self.on_wall and (self.rings >= LEAST_RINGS or (self.photo is True and self.rings > 0))

    @property
    def doubt(self) -> str:
        """Why it is not counted, as a sentence without its full stop."""
        told = (
            (self.fixed, reasons.STAYS_IN_IMAGE),
            (self.spot, reasons.BESIDE_LINE),
            (self.behind_static, reasons.BEHIND_STATIC),
            (self.contradicted, reasons.SHOWN_WITHOUT),
            (self.behind_drop, reasons.SHOWN_DISPLACED),
            (self.in_probe_path, reasons.DROVE_THROUGH),
            (self.edge, reasons.AT_EDGE),
            (not self.corroborated, reasons.ALONE),
            (self.bright, reasons.LIKE_GLINT),
        )
        return next((why for holds, why in told if holds), reasons.WEAK)


@dataclass(frozen=True)
class Witnesses:
    """What findings are compared with: the wall's photo, and rings and lit pictures where they are known.

    Rings to which a codec gave the same light (``held``) do not count as independent.
    """

    texture: WallTexture
    rings: RingSamples | None = None
    pictures: LitPictures | None = None
    held: HeldOver = NOTHING_HELD

    @cached_property
    def static(self) -> StaticPlaces | None:
        """Where pictures show something that stays while the wall moves; None where that is not known."""
        if self.rings is None or self.pictures is None:
            return None
        return StaticPlaces.of(self.pictures.recording, self.rings)

    def spots_in(self, region: Region, depth: Depth, surface: Surface) -> list[int]:
        """Return the frames whose rings show a spot beside the line; none without rings and poses."""
        if self.rings is None or self.pictures is None:
            return []
        return frames_with_spots(region, depth.depth_mm, surface.relief, self.rings, self.pictures)


def evidence_for(
    region: Region,
    depth: Depth,
    surface: Surface,
    seen_by: Witnesses,
    fixed_mm: Float,
    score: float,
    spots: Sequence[int] = (),
) -> Evidence:
    """Return the evidence for and against a finding.

    ``fixed_mm`` (H, W) is the displacement that stays at one place of the image, ``score`` the largest
    matched-filter response, σ. Rings of the frames ``spots`` show a spot beside the line and do not count.
    """
    relief, pictures = surface.relief, seen_by.pictures
    evidence = Evidence(
        _independent_rings(region, depth, surface, seen_by, spots),
        _by_photo(region, depth, relief, seen_by.texture),
        score,
        _is_fixed(region, surface, fixed_mm),
        lies_at_edge(region, relief),
        seen_by.rings is not None and line_is_bright(region, depth.depth_mm, surface, seen_by.rings),
        in_probe_path=pictures is not None and pictures.drove_through(region, depth, relief),
        behind_static=bool(seen_by.static and seen_by.static.explain(region, depth.depth_mm, surface)),
    )
    # Pictures are read only for what would count without them: with glints there may be hundreds of others.
    if pictures is None or not evidence.corroborated:
        return evidence
    contradicted = pictures.contradict(region, relief)
    behind_drop = not contradicted and shows_drop(pictures, region, relief)
    return replace(evidence, contradicted=contradicted, behind_drop=behind_drop)


def _independent_rings(
    region: Region, depth: Depth, surface: Surface, seen_by: Witnesses, spots: Sequence[int]
) -> int:
    """Return how many independent rings in a row show a finding, without those with glints or spots.

    A pit inside a wide patch covers less than a fifth of any ring's samples: its peak is examined, too.
    """
    frames = frames_behind(region, depth.depth_mm, surface), frames_at_peak(depth, region, surface)
    clear = np.setdiff1d(np.union1d(*frames), np.asarray(spots, np.int64))
    showing = without_glints(clear, region, surface, seen_by.rings)
    return seen_by.held.independent(shown_in_a_row(showing, region, surface, seen_by.rings))


def _by_photo(region: Region, depth: Depth, relief: Relief, texture: WallTexture) -> bool | None:
    """Return whether the photo shows a finding; None where it is no independent evidence.

    The photo is projected onto the measured wall: where the depth shifts it by more than the finding's size,
    it differs there because of the depth.
    """
    size = min(n * c for n, c in zip(region.mask.shape, relief.cell_mm, strict=True))
    return None if abs(depth.depth_mm) > size else photo_stands_out(texture, relief, region)


def line_is_bright(region: Region, depth_mm: float, surface: Surface, rings: RingSamples) -> bool:
    """Whether the line is brighter in the region than at nine of ten places of the deepest ring there.

    A glint or a reflection that is taken for the line is; of defects one in ten is, by chance. Where more
    rings show the finding than a codec spreads a glint over, most of them must be bright: a single glint on a
    defect does not make it one.
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
    brightness = [_is_bright(height, inside, points, rings, int(k)) for k in showing]
    known = [bright for bright in brightness if bright is not None]
    return not known or float(np.mean(known)) >= _MOST


def _is_bright(
    height: Float, inside: Bool, points: PointCloud, rings: RingSamples, frame: int
) -> bool | None:
    """Whether a frame's line is bright where it deviates most ``inside``; None where that is not known."""
    its = points.frame == frame
    ring = np.flatnonzero(rings.frame == frame)
    used = np.flatnonzero(rings.validity[ring[0]] == RingValidity.VALID) if len(ring) else ring
    if len(used) != its.sum():  # a part of the ring lies beyond these rows
        return None
    # points are in the order of their ring's samples
    line, there = rings.amplitude[ring[0], used], inside[its]
    highest = float(height[its][there].max())
    if highest <= 0:  # the ring deviates to the other side there
        return None
    top = there & (height[its] >= highest / 2)
    return float(np.mean(line < np.median(line[top]))) > _BRIGHT


def lies_at_edge(region: Region, relief: Relief) -> bool:
    """Whether most rows of a finding are deepest beside hidden wall that is wider than they are.

    Narrower gaps belong to the finding itself: a steep flank hides a part of what lies behind it.
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
    """Whether a row (n,) is deepest within ``reach`` cells of an unseen gap that is wider than its inside."""
    shown = inside & np.isfinite(height)
    deepest = int(np.argmax(np.where(shown, height, -1.0)))
    runs, _ = label(np.isnan(height))
    near = runs[max(deepest - reach, 0) : deepest + reach + 1]
    return any(np.sum(runs == k) > shown.sum() for k in np.unique(near[near > 0]))


def _is_fixed(region: Region, surface: Surface, fixed_mm: Float) -> bool:
    """Whether what stays at one place of the image explains a finding."""
    height = np.abs(region.cut(surface.local_mm))[region.mask]
    explained = fixed_mm[region.mask] > np.maximum(_FIXED_SHARE * np.nan_to_num(height), 0.0)
    return bool(explained.mean() > _FIXED_SHARE)


def frames_behind(region: Region, depth_mm: float, surface: Surface) -> Int:
    """Return the frames (n,) whose rings show a defect of this depth, mm, with samples of usual σ."""
    relief, points = surface.relief, surface.near
    i, j, inside = cells_of(points, relief, region)
    inside &= of_usual_sigma(points)
    deviation = points.radius_mm[inside] - relief.shape_at(i[inside], j[inside])
    limit = max(DEPTH_SHARE * abs(depth_mm), NOISE_SIGMAS * relief.typical.sigma_mm)
    frame, ring, count = np.unique(points.frame[inside], return_inverse=True, return_counts=True)
    showing = np.bincount(ring, np.sign(depth_mm) * deviation > limit, len(frame))
    return np.asarray(frame[showing >= np.maximum(_TOP_SHARE * count, LEAST_SAMPLES)])
