"""What the rings beside the deepest one allow a finding's depth to be: a glint on one ring is no depth.

A wall seen along a line of sight falls off from ring to ring by no more than their distance (45°, the mean
flank of a hemisphere), or by half of what it stands out of the finding about it, where it is steeper. What
one ring shows beyond that, no other does: it may be a glint, or a pit so narrow that no other crosses it.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from pipeline.arrays import Bool, Float, Int
from stages.defects.depth import SHARPENING, Depth, is_small
from stages.defects.segment import Region
from stages.defects.surface import Surface, cells_of, chosen, sure_of_themselves

# Rings beside each other are no further apart than this many of their distances; a ring's departure is that
# of the fifth of its samples that depart most, as for what confirms a finding.
_BESIDE, _TOP_QUANTILE, _LEAST_OF_RING = 1.6, 0.8, 3
_SHOWN_SIGMAS = 2.0  # of the wall's own unevenness, as for what confirms a finding
# A depth is a mean over a millimetre: so much of a ring about a finding's peak tells what it shows of it.
_MEAN_MM = 1.0
# A round pit that the rings on both sides of one miss is narrower than so many of their distances.
_NARROW, _HALF = 2.0, 0.5


def allowed_by_neighbours(depth: Depth, region: Region, surface: Surface) -> Depth:
    """Return the depth, limited by what the rings beside the deepest one allow, with a larger σ if it is.

    Where no bell tells what lies between rings, as in a wide patch, σ also grows by how far it falls off to
    those beside: the deepest place of a narrow pit lies between them.
    """
    rings = _rings(depth, region, surface)
    if not len(rings.frame):
        return depth
    if abs(depth.depth_mm) <= rings.allowed_mm:
        falls = 0.0 if is_small(surface.relief, region, surface.points) else rings.falls_mm
        return replace(depth, sigma_mm=float(np.hypot(depth.sigma_mm, SHARPENING * falls)))
    sigma = float(np.hypot(depth.sigma_mm, rings.allowed_mm / 2))
    return replace(depth, depth_mm=float(np.sign(depth.depth_mm)) * rings.allowed_mm, sigma_mm=sigma)


def contradicted_frame(depth: Depth, region: Region, surface: Surface) -> int | None:
    """Return the frame whose ring alone makes a depth that those beside do not allow, None where none does.

    The rings on both sides of it show the finding themselves: its depth is theirs without that one.
    """
    rings = _rings(depth, region, surface)
    if not len(rings.frame) or abs(depth.depth_mm) <= rings.allowed_mm:
        return None
    shown = rings.top_mm[rings.beside] >= _SHOWN_SIGMAS * surface.relief.typical.sigma_mm
    side = np.sign(rings.at_mm[rings.beside] - rings.at_mm[rings.deepest])
    both = bool((side < 0).any() and (side > 0).any())
    return int(rings.frame[rings.deepest]) if both and shown.all() else None


def frames_at_peak(depth: Depth, region: Region, surface: Surface) -> Int:
    """Return the frames (n,) whose rings show half of a depth about its peak, by samples that are sure.

    Only of a wide patch, of which what a depth is the mean of is less than the fifth that departs most: of a
    narrower finding that fifth tells the same, and this would take noise of single rings for the finding.
    """
    width = region.mask.any(0).sum() * surface.relief.cell_mm[1]
    if (1 - _TOP_QUANTILE) * width <= _MEAN_MM:
        return np.zeros(0, np.int64)
    sure = replace(surface, near=chosen(surface.near, sure_of_themselves(surface.near)))
    rings = _rings(depth, region, sure)
    limit = max(_HALF * abs(depth.depth_mm), _SHOWN_SIGMAS * surface.relief.typical.sigma_mm)
    return rings.frame[rings.peak_mm > limit]


def reaching(depth: Depth, uncut: Depth, region: Region, surface: Surface) -> Depth:
    """Return a depth with a σ that reaches the one of which a lone ring was cut, where that may be a pit."""
    cut = max(abs(uncut.depth_mm) - abs(depth.depth_mm), 0.0)
    if not _may_be_a_pit(uncut, region, surface):
        return depth
    return replace(depth, sigma_mm=float(np.hypot(depth.sigma_mm, cut)))


def _may_be_a_pit(depth: Depth, region: Region, surface: Surface) -> bool:
    """Return whether what the deepest ring shows is so narrow that a round pit may lie between the others."""
    rings = _rings(depth, region, surface)
    return not len(rings.frame) or rings.width_mm[rings.deepest] < _NARROW * surface.points.spacing_mm


@dataclass(frozen=True)
class _Rings:
    """What each ring (n,) of a ``frame`` shows to a finding's side, at which place along the pipe.

    ``top_mm`` is how far it departs over all of the finding's columns, ``foot_mm`` the median there,
    ``peak_mm`` how far about the finding's peak, and ``width_mm`` how wide it stands out there.
    """

    frame: Int
    at_mm: Float
    top_mm: Float
    foot_mm: Float
    peak_mm: Float
    width_mm: Float
    spacing_mm: float

    @property
    def deepest(self) -> int:
        """Which shows the most about the finding's peak."""
        return int(self.peak_mm.argmax())

    @property
    def beside(self) -> Int:
        """Which (m,) are beside the deepest."""
        near = np.abs(self.at_mm - self.at_mm[self.deepest]) < _BESIDE * self.spacing_mm
        return np.flatnonzero(near & (np.arange(len(near)) != self.deepest))

    @property
    def falls_mm(self) -> float:
        """How far it falls off at most from the deepest to one beside."""
        deepest = float(self.peak_mm[self.deepest])
        return deepest - float(self.peak_mm[self.beside].min(initial=deepest))

    @property
    def allowed_mm(self) -> float:
        """How deep the rings beside the deepest allow the finding to be."""
        shown = np.maximum(self.peak_mm, self.top_mm)[self.beside]
        steep = 2 * shown - np.maximum(self.foot_mm[self.beside], 0.0)
        gentle = max(float(shown.max(initial=0.0)), 0.0) + self.spacing_mm
        return max(gentle, float(steep.max(initial=0.0)))


def _rings(depth: Depth, region: Region, surface: Surface) -> _Rings:
    """Return what each ring about a finding's peak, by which the surface goes, shows of it."""
    samples = _samples(depth, region, surface)
    spacing = surface.points.spacing_mm
    near = ~np.isin(samples.frame, surface.left_out) & (np.abs(samples.along_mm) <= 2 * spacing)
    rings = [(k, samples.of(near & (samples.frame == k))) for k in np.unique(samples.frame[near])]
    rings = [(k, ring) for k, ring in rings if ring.about.sum() >= _LEAST_OF_RING]
    at, top, foot, peak, width = np.array([ring.told(spacing) for _, ring in rings]).reshape(-1, 5).T
    frame = np.array([k for k, _ in rings], np.int64)
    return _Rings(frame, at, top, foot, peak, width, spacing)


@dataclass(frozen=True)
class _Samples:
    """Samples (m,) of rings: their frame, how far they depart to a finding's side, and where from its peak.

    ``inside`` are those in the columns of the finding.
    """

    frame: Int
    out_mm: Float
    along_mm: Float
    around_mm: Float
    inside: Bool

    def of(self, which: Bool) -> _Samples:
        """Return some of the samples."""
        return _Samples(*(getattr(self, f.name)[which] for f in fields(self)))

    @property
    def about(self) -> Bool:
        """Which are about the peak; what lies askew by up to 45° moves on around from ring to ring."""
        return np.abs(self.around_mm) <= _MEAN_MM + np.abs(self.along_mm)

    def told(self, spacing_mm: float) -> tuple[float, ...]:
        """Return what the samples, all of one ring, give to `_Rings`."""
        about = np.sort(self.out_mm[self.about])
        pitch = float(np.ptp(self.around_mm[self.about])) / (len(about) - 1)
        peak = float(about[-max(round(_MEAN_MM / max(pitch, 1e-9)), 1) :].mean())
        own = self.out_mm[self.inside] if self.inside.sum() >= _LEAST_OF_RING else about
        foot = float(np.median(own))
        high = (self.out_mm > (peak + foot) / 2) & (np.abs(self.around_mm) <= _NARROW * spacing_mm)
        at = float(self.along_mm.mean())
        return at, float(np.quantile(own, _TOP_QUANTILE)), foot, peak, float(high.sum()) * pitch


def _samples(depth: Depth, region: Region, surface: Surface) -> _Samples:
    """Return the samples on a surface as a finding sees them."""
    relief, points = surface.relief, surface.near
    columns = Region(
        0,
        region.column,
        np.broadcast_to(region.mask.any(0), (len(relief.distance_mm), region.mask.shape[1])),
        0.0,
    )
    row, column, inside = cells_of(points, relief, columns)
    turn = len(relief.azimuth_rad)
    off = column - region.column - depth.peak[1]
    return _Samples(
        points.frame,
        np.sign(depth.depth_mm) * (points.radius_mm - relief.shape_at(row, column)),
        (row - region.row - depth.peak[0]) * relief.cell_mm[0],
        (off - turn * np.rint(off / turn)) * relief.cell_mm[1],
        inside,
    )
