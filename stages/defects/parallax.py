"""Check a finding against lit pictures taken from other places.

A ring shows one place of the wall at one place of the image, in one frame only. A drop that runs down the
window displaces the line as long as it is in front of it; the result looks like a pit, a deposit or a groove,
the longer the slower the drop. A lit picture taken before or after shows the same wall at another place of
the image, beside the drop. Projected onto the wall as the rings measured it, such pictures agree with each
other where the depth is true. A false depth shifts them against each other by its size times the distance
between the camera positions over the pipe's radius. Where that is less than the texture shows, with and
without the finding they agree equally well, and nothing is concluded; nor is it where they do not agree
without the finding as on the wall beside it, as in front of a steep pit.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from pipeline.arrays import Bool, Float
from pipeline.artefacts.measured import Trajectory
from pipeline.geometry.axis import distance_along, from_pipe
from pipeline.geometry.rigid import inverse, transform
from pipeline.instrument.probe import Probe
from pipeline.recording.base import Illumination, Recording
from stages.defects.depth import Depth
from stages.defects.relief import Relief
from stages.defects.segment import Region

# The finding is cut into parts of 8 mm, each compared in pictures whose line is 2 to 15 mm away: farther off
# the wall is seen too obliquely, and nearer by, the line and what displaces it would be in the picture.
_WINDOW_MM, _FARTHEST_MM, _CLEAR_MM = 8.0, 15.0, 2.0
# Up to 8 pictures are taken per part, at least 2 and 60 pixels of texture are needed; points lie 0.25 mm
# apart. What is broader than 2 mm (8 points) is taken to be light and removed; 3 mm on either side are read
# for that.
_PICTURES, _LEAST_PICTURES, _LEAST_PIXELS, _PIXEL_MM, _BROAD_PX, _BESIDE_MM = 8, 2, 60, 0.25, 8.0, 3.0
# If the disagreement is larger by this factor with the finding than without it, the finding is not on the
# wall, provided that pictures agree without it nearly as on the wall beside. Into a steep pit every picture
# looks differently, so that they agree nowhere, and by chance better at its opening. Debt: data/debts.md.
_DISAGREE, _AS_BESIDE = 1.5, 1.3
# Variance of rounding to grey levels.
_ROUNDING = 1 / 12


@dataclass(frozen=True)
class LitPictures:
    """The LED-lit frames of a recording with known pose, and the camera that projects a finding into them."""

    recording: Recording
    probe: Probe
    motion: Trajectory

    @cached_property
    def line_mm(self) -> Float:
        """Distances along the pipe (N,), mm, of the laser line in all poses."""
        return distance_along(self.motion.axis, self.motion.T_pc) + self.probe.laser.baseline_mm

    def contradict(self, region: Region, relief: Relief) -> bool:
        """Whether pictures show the wall without a finding; False where fewer than two pictures show it.

        The rows of ``region`` count from the first row of ``relief``.
        """
        if region.all_round:
            return False
        beside = round(_BESIDE_MM / relief.cell_mm[1])
        mask = np.pad(region.mask, ((0, 0), (beside, beside)))
        wide = Region(region.row, region.column - beside, mask, region.sign)
        rows = max(1, round(_WINDOW_MM / relief.cell_mm[0]))
        parts = [slice(k, min(k + rows, len(mask))) for k in range(0, len(mask), rows)]
        compared = [t for part in parts if (t := self._disagreement(wide, relief, part)) is not None]
        if not compared:
            return False
        pixels, with_it, without = np.array(compared, float).T
        falser, rougher = (np.exp(np.average(logs, weights=pixels)) for logs in (with_it, without))
        return bool(falser > _DISAGREE and rougher < _AS_BESIDE)

    def _disagreement(self, region: Region, relief: Relief, rows: slice) -> tuple[int, float, float] | None:
        """Return a part's pixels and ln of two ratios of disagreement; None if unseen.

        The first is that with the finding over that without it, as parts of the texture's variance; the
        second that without it over that of the wall beside it, in grey levels.
        """
        part = Region(region.row + rows.start, region.column, region.mask[rows], region.sign)
        height = np.nan_to_num(part.cut(relief.local_mm))
        core = part.mask & (np.abs(height) > np.abs(height[part.mask]).max(initial=0.0) / 2)
        bare, found = self._places(part, relief, height)
        size = bare.shape[1::-1]
        inside, own = (
            cv2.resize(cells.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0
            for cells in (core, part.mask)
        )
        if inside.sum() < _LEAST_PIXELS:
            return None
        s = relief.distance_mm[part.row : part.row + len(part.mask)]
        places = ((bare, inside), (found, inside), (bare, ~own))
        seen = [
            [self._seen(xyz_p, cells, pose, image) for xyz_p, cells in places]
            for pose, image in self._near(s)
        ]
        shown = [textures for textures in seen if not any(t is None for t in textures)]
        if len(shown) < _LEAST_PICTURES:
            return None
        without, with_it, beside = (np.array(p, float) for p in zip(*shown, strict=True))
        falser = (1 - _agreement(with_it)) / (1 - _agreement(without))
        return int(inside.sum()), float(np.log(falser)), float(np.log(_misfit(without) / _misfit(beside)))

    def drove_through(self, region: Region, depth: Depth, relief: Relief) -> bool:
        """Whether the camera passed the top of an inward finding at less than the radius of its own lamps."""
        row, column = region.row + depth.peak[0], region.column + depth.peak[1]
        along = self.line_mm - self.probe.laser.baseline_mm
        s = relief.distance_mm[row]
        if depth.depth_mm >= 0 or not along.min() <= s <= along.max():
            return False
        psi = relief.azimuth_rad[column % len(relief.azimuth_rad)]
        radius = float(relief.shape_at(np.array([row]), np.array([column]))[0]) + depth.depth_mm
        top = from_pipe(self.motion.axis, np.array([s]), np.array([psi]), np.array([radius]))[0]
        camera = self.motion.T_pc[np.argmin(np.abs(along - s)), :3, 3]
        return bool(np.linalg.norm(top - camera) < self.probe.lighting.radius_mm)

    def _places(self, part: Region, relief: Relief, height: Float) -> tuple[Float, Float]:
        """Return the wall's points (n, m, 3) in P, mm, without and with a finding's ``height`` (H, W), mm."""
        i, j = (np.arange(n) for n in part.mask.shape)
        s = relief.distance_mm[part.row + i]
        psi = relief.azimuth_rad[0] + (part.column + j) * (relief.azimuth_rad[1] - relief.azimuth_rad[0])
        row, column = np.meshgrid(part.row + i.astype(float), part.column + j.astype(float), indexing="ij")
        shape = relief.shape_at(row.ravel(), column.ravel())
        size = [max(2, round(n * c / _PIXEL_MM)) for n, c in zip(height.shape, relief.cell_mm, strict=True)]
        grids = (*np.meshgrid(s, psi, indexing="ij"), shape.reshape(height.shape), height)
        along, around, radius, more = (
            np.asarray(cv2.resize(np.asarray(g, float), size[::-1]), float) for g in grids
        )
        bare = from_pipe(self.motion.axis, along, around, radius)
        return bare, from_pipe(self.motion.axis, along, around, radius + more)

    def _near(self, s: Float) -> Iterator[tuple[Float, Float]]:
        """Yield pose (P to C) and grey picture of lit frames whose line is near but off ``s`` (H,), mm."""
        lit = np.isin(self.motion.frame, self.recording.frames.of(Illumination.LED, Illumination.BOTH))
        index = np.flatnonzero(lit)
        off = np.abs(self.line_mm[index] - s.mean()) - np.ptp(s) / 2
        index = index[(off > _CLEAR_MM) & (off < _FARTHEST_MM)]
        some = index[np.unique(np.linspace(0, len(index) - 1, min(len(index), _PICTURES)).astype(int))]
        images = self.recording.read(self.motion.frame[some], "grey")
        for k, (_, image) in zip(some, images, strict=True):
            if image is not None:
                yield inverse(self.motion.T_pc[k]), np.asarray(image, np.float32)

    def _seen(self, xyz_p: Float, inside: Bool, T_cp: Float, image: Float) -> Float | None:
        """Return the fine texture (n,) of wall points in a picture, of mean 0; None unless it shows all."""
        uv, valid = self.probe.camera.project(transform(T_cp, xyz_p))
        u, v = (uv[..., k].astype(np.float32) for k in (0, 1))
        within = valid & (u > 1) & (v > 1) & (u < image.shape[1] - 2) & (v < image.shape[0] - 2)
        if not within[inside].all():
            return None
        grey = cv2.remap(image, u, v, cv2.INTER_LINEAR)
        fine = (grey - cv2.GaussianBlur(grey, (0, 0), _BROAD_PX))[inside]
        return np.asarray(fine - fine.mean(), float) if fine.std() > 1 else None


def _agreement(pictures: Float) -> float:
    """Return the median correlation between pairs of pictures (P, n), each of zero mean.

    A single picture in which a strut, a glint or dirt is in front of the wall agrees with no other.
    """
    one, other = np.triu_indices(len(pictures), 1)
    unit = pictures / pictures.std(1, keepdims=True)
    return float(np.median(np.mean(unit[one] * unit[other], axis=1)))


def _misfit(pictures: Float) -> float:
    """Return the variance that pictures (P, n) do not share, with that of rounding; grey levels²."""
    return (1 - _agreement(pictures)) * float(pictures.var(axis=1).mean()) + _ROUNDING
