"""Limit a finding's depth to what the rings beside the deepest one allow: a glint on one ring is no depth.

From ring to ring, a wall seen along a line of sight gets shallower by at most the distance of the rings (45°,
the mean flank of a hemisphere); where the finding is steeper, by at most half of what it stands out of its
own surroundings. What one ring shows beyond that, no other ring shows: it may be a glint, or a pit so narrow
that no other ring crosses it.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.ndimage import label

from pipeline.arrays import Bool, Float, Int
from pipeline.artefacts.measured import RingSamples
from stages.defects.depth import SHARPENING, Depth
from stages.defects.marred import without_glints
from stages.defects.segment import Region
from stages.defects.surface import Surface, cells_of, chosen, of_usual_sigma

# Rings at most 1.6 median spacings apart are neighbours. A ring's departure is the 80 % quantile of its
# samples, as for the evidence that confirms a finding, and needs at least 3 samples.
_BESIDE, _TOP_QUANTILE, _LEAST_OF_RING = 1.6, 0.8, 3
_SHOWN_SIGMAS = 2.0  # of the wall's own unevenness, as for the evidence that confirms a finding
# A depth is a mean over 1 mm: that much of a ring, around a finding's peak, is compared with it.
MEAN_MM = 1.0
# If both neighbours of a ring miss a round pit, the pit is narrower than two ring spacings.
_NARROW, _HALF = 2.0, 0.5


def frames_at_peak(depth: Depth, region: Region, surface: Surface) -> Int:
    """Return the frames (n,) whose rings show half of a depth at its peak, with samples of usual σ.

    Only for a wide patch, where the 1 mm that a depth is averaged over is less than a fifth of a ring's
    samples. In a narrower finding the deepest fifth shows the same, and this test would mistake noise of
    single rings for it.
    """
    width = region.mask.any(0).sum() * surface.relief.cell_mm[1]
    if (1 - _TOP_QUANTILE) * width <= MEAN_MM:
        return np.zeros(0, np.int64)
    sure = replace(surface, near=chosen(surface.near, of_usual_sigma(surface.near)))
    rings = rings_at_peak(depth, region, sure)
    limit = max(_HALF * abs(depth.depth_mm), _SHOWN_SIGMAS * surface.relief.typical.sigma_mm)
    return rings.frame[rings.peak_mm > limit]


def shown_in_a_row(showing: Int, region: Region, surface: Surface, rings: RingSamples | None) -> int:
    """Return the most rings in a row along the pipe, of all passes, that show a finding: of ``showing`` (n,).

    A defect appears in every ring that crosses it. What appears before and behind a ring that misses it are
    two things. A ring with a glint there, or with samples of unusual σ, tells neither.
    """
    row, _, inside = cells_of(surface.near, surface.relief, region)
    inside &= of_usual_sigma(surface.near)
    frame, ring, count = np.unique(surface.near.frame[inside], return_inverse=True, return_counts=True)
    along = np.argsort(np.bincount(ring, row[inside]) / count, kind="stable")
    shown = np.isin(frame, showing)
    missing = frame[~shown & (count >= _LEAST_OF_RING)]
    tells = shown | np.isin(frame, without_glints(missing, region, surface, rings))
    runs, _ = label(shown[along][tells[along]])
    return int(np.bincount(runs[runs > 0]).max(initial=0))


@dataclass(frozen=True)
class RingsAtPeak:
    """How far each ring (n,) departs to a finding's side, and where along the pipe, mm.

    ``top_mm`` is the 80 % quantile over the finding's columns and ``foot_mm`` the median there; ``peak_mm``
    is the departure about the finding's peak and ``width_mm`` its width there. Neighbouring rings are
    ``spacing_mm`` apart, and ``noise_mm`` is 1 σ of the wall's own unevenness.
    """

    frame: Int
    at_mm: Float
    top_mm: Float
    foot_mm: Float
    peak_mm: Float
    width_mm: Float
    spacing_mm: float
    noise_mm: float

    def allow(self, depth: Depth, small: bool) -> Depth:
        """Return the depth, limited by what the rings beside the deepest one allow, and then with a larger σ.

        Unless it is ``small``, so that a bell is fitted between the rings, σ also grows by how much the depth
        falls off to the neighbouring rings: the deepest place of a narrow pit may lie between them.
        """
        if not len(self.frame):
            return depth
        if abs(depth.depth_mm) <= self.allowed_mm:
            falls = 0.0 if small else self.falls_mm
            return replace(depth, sigma_mm=float(np.hypot(depth.sigma_mm, SHARPENING * falls)))
        sigma = float(np.hypot(depth.sigma_mm, self.allowed_mm / 2))
        return replace(depth, depth_mm=float(np.sign(depth.depth_mm)) * self.allowed_mm, sigma_mm=sigma)

    def contradicted_frame(self, depth: Depth) -> int | None:
        """Return the frame whose ring alone shows more depth than its neighbours allow; None if none does."""
        if not len(self.frame) or abs(depth.depth_mm) <= self.allowed_mm:
            return None
        return int(self.frame[self.deepest])

    @property
    def shown_beside(self) -> bool:
        """Whether rings on both sides of the deepest one show the finding, too."""
        shown = self.top_mm[self.beside] >= _SHOWN_SIGMAS * self.noise_mm
        side = np.sign(self.at_mm[self.beside] - self.at_mm[self.deepest])
        return bool((side < 0).any() and (side > 0).any() and shown.all())

    @property
    def may_be_a_pit(self) -> bool:
        """Whether the deepest ring's departure is so narrow that a round pit fits between the others."""
        return not len(self.frame) or bool(self.width_mm[self.deepest] < _NARROW * self.spacing_mm)

    @property
    def deepest(self) -> int:
        """Index of the ring that departs most about the finding's peak."""
        return int(self.peak_mm.argmax())

    @property
    def beside(self) -> Int:
        """Indices (m,) of the rings beside the deepest one."""
        near = np.abs(self.at_mm - self.at_mm[self.deepest]) < _BESIDE * self.spacing_mm
        return np.flatnonzero(near & (np.arange(len(near)) != self.deepest))

    @property
    def falls_mm(self) -> float:
        """The largest fall from the deepest ring to one beside it, mm."""
        deepest = float(self.peak_mm[self.deepest])
        return deepest - float(self.peak_mm[self.beside].min(initial=deepest))

    @property
    def allowed_mm(self) -> float:
        """The depth that the rings beside the deepest one allow, mm."""
        shown = np.maximum(self.peak_mm, self.top_mm)[self.beside]
        steep = 2 * shown - np.maximum(self.foot_mm[self.beside], 0.0)
        gentle = max(float(shown.max(initial=0.0)), 0.0) + self.spacing_mm
        return max(gentle, float(steep.max(initial=0.0)))


def rings_at_peak(depth: Depth, region: Region, surface: Surface) -> RingsAtPeak:
    """Return each ring's departure about a finding's peak, without frames that the surface left out."""
    samples = _samples(depth, region, surface)
    spacing = surface.points.spacing_mm
    near = ~np.isin(samples.frame, surface.left_out) & (np.abs(samples.along_mm) <= 2 * spacing)
    rings = [(k, samples.of(near & (samples.frame == k))) for k in np.unique(samples.frame[near])]
    rings = [(k, ring) for k, ring in rings if ring.about.sum() >= _LEAST_OF_RING]
    at, top, foot, peak, width = np.array([ring.summary(spacing) for _, ring in rings]).reshape(-1, 5).T
    frame = np.array([k for k, _ in rings], np.int64)
    noise = surface.relief.typical.sigma_mm
    return RingsAtPeak(frame, at, top, foot, peak, width, spacing, noise)


@dataclass(frozen=True)
class _Samples:
    """Samples (m,) of rings: frame, departure to a finding's side, and place relative to its peak, mm.

    ``inside`` marks those in the columns of the finding.
    """

    frame: Int
    out_mm: Float
    along_mm: Float
    around_mm: Float
    inside: Bool

    def of(self, which: Bool) -> _Samples:
        """Return the samples that ``which`` (m,) marks."""
        return _Samples(*(getattr(self, f.name)[which] for f in fields(self)))

    @property
    def about(self) -> Bool:
        """Which samples are near the peak; a finding may lie askew by up to 45° to the pipe's axis."""
        return np.abs(self.around_mm) <= MEAN_MM + np.abs(self.along_mm)

    def summary(self, spacing_mm: float) -> tuple[float, ...]:
        """Return at, top, foot, peak and width of `RingsAtPeak` for samples that are all of one ring, mm."""
        about = np.sort(self.out_mm[self.about])
        pitch = float(np.ptp(self.around_mm[self.about])) / (len(about) - 1)
        peak = float(about[-max(round(MEAN_MM / max(pitch, 1e-9)), 1) :].mean())
        own = self.out_mm[self.inside] if self.inside.sum() >= _LEAST_OF_RING else about
        foot = float(np.median(own))
        high = (self.out_mm > (peak + foot) / 2) & (np.abs(self.around_mm) <= _NARROW * spacing_mm)
        at = float(self.along_mm.mean())
        return at, float(np.quantile(own, _TOP_QUANTILE)), foot, peak, float(high.sum()) * pitch


def _samples(depth: Depth, region: Region, surface: Surface) -> _Samples:
    """Return the samples of all rings near a surface, relative to a finding."""
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
