"""Whether lit pictures from other places bear a long finding out, or show the wall without it.

What a ring shows of the wall is at one place of the image in one frame only. A drop that slides down the
window moves the line for as long as it lies in its way, and looks like a groove or a ridge along the pipe. A
lit picture taken before or after shows the same wall at another place of the image, beside the drop. Laid on
the wall as the rings measured it, such pictures agree with each other where the depth is true, since they are
taken from places apart: a false depth shifts them against each other by its size times their distance over
the pipe's radius.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

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

# Asked of findings from here on that are at least as long as wide: no drop that passes the line is shorter.
_LONG_MM = 8.0
# Such a length of them is held against pictures taken from no farther off than this, and no nearer: beyond it
# the wall is seen too obliquely, nearer by it the line itself, and what moves it, would be in the picture.
_WINDOW_MM, _FARTHEST_MM, _CLEAR_MM = 8.0, 15.0, 2.0
# Of each part so many pictures are taken, and two are needed; its points lie as dense as its texture shows.
# What is broader than 2 mm is light, and so that it is known the flanks are taken in.
_PICTURES, _LEAST_PICTURES, _LEAST_PIXELS, _PIXEL_MM, _BROAD_PX, _BESIDE_MM = 8, 2, 60, 0.25, 8.0, 3.0
# Where the pictures disagree by so much more with the finding than without it, it is not on the wall. Debt:
# data/debts.md.
_DISAGREE = 1.5


@dataclass(frozen=True)
class LitPictures:
    """The lit frames of a recording whose pose is known, and what places a finding in them."""

    recording: Recording
    probe: Probe
    motion: Trajectory

    def contradict(self, region: Region, relief: Relief) -> bool:
        """Whether pictures show the wall without a finding; what no two of them show is not contradicted.

        ``region`` counts its rows from the first of ``relief``.
        """
        size = np.array(region.mask.shape) * relief.cell_mm
        if region.all_round or size[0] < max(_LONG_MM, size[1]):
            return False
        beside = round(_BESIDE_MM / relief.cell_mm[1])
        mask = np.pad(region.mask, ((0, 0), (beside, beside)))
        wide = Region(region.row, region.column - beside, mask, region.sign)
        rows = max(1, round(_WINDOW_MM / relief.cell_mm[0]))
        parts = [slice(k, min(k + rows, len(mask))) for k in range(0, len(mask), rows)]
        told = [t for part in parts if (t := self._disagreement(wide, relief, part)) is not None]
        pixels, logs = np.array(told, float).reshape(-1, 2).T
        return bool(pixels.sum() > 0 and np.exp(pixels @ logs / pixels.sum()) > _DISAGREE)

    def _disagreement(self, region: Region, relief: Relief, rows: slice) -> tuple[int, float] | None:
        """Return pixels of a part of a finding, and by how much more pictures disagree with it, as a log."""
        part = Region(region.row + rows.start, region.column, region.mask[rows], region.sign)
        height = np.nan_to_num(part.cut(relief.local_mm))
        core = part.mask & (np.abs(height) > np.abs(height[part.mask]).max(initial=0.0) / 2)
        bare, found = self._places(part, relief, height)
        size = bare.shape[1::-1]
        inside = cv2.resize(core.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0
        if inside.sum() < _LEAST_PIXELS:
            return None
        s = relief.distance_mm[part.row : part.row + len(part.mask)]
        seen = [
            (self._seen(bare, inside, pose, image), self._seen(found, inside, pose, image))
            for pose, image in self._near(s)
        ]
        both = [(one, other) for one, other in seen if one is not None and other is not None]
        if len(both) < _LEAST_PICTURES:
            return None
        without, with_it = (1 - _agreement(np.array(p)) for p in zip(*both, strict=True))
        return int(inside.sum()), float(np.log(with_it / without))

    def drove_through(self, region: Region, depth: Depth, relief: Relief) -> bool:
        """Whether the top of what stands inward is nearer to the camera's way than its own lamps are."""
        row, column = region.row + depth.peak[0], region.column + depth.peak[1]
        along = distance_along(self.motion.axis, self.motion.T_pc)
        s = relief.distance_mm[row]
        if depth.depth_mm >= 0 or not along.min() <= s <= along.max():
            return False
        psi = relief.azimuth_rad[column % len(relief.azimuth_rad)]
        radius = float(relief.shape_at(np.array([row]), np.array([column]))[0]) + depth.depth_mm
        top = from_pipe(self.motion.axis, np.array([s]), np.array([psi]), np.array([radius]))[0]
        camera = self.motion.T_pc[np.argmin(np.abs(along - s)), :3, 3]
        return bool(np.linalg.norm(top - camera) < self.probe.lighting.radius_mm)

    def _places(self, part: Region, relief: Relief, height: Float) -> tuple[Float, Float]:
        """Return the wall's points (n, m, 3) in P without and with a finding's ``height`` (H, W)."""
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
        """Yield pose (pipe to camera) and grey picture of lit frames whose line is beside ``s`` (H,)."""
        lit = np.isin(self.motion.frame, self.recording.frames.of(Illumination.LED, Illumination.BOTH))
        index = np.flatnonzero(lit)
        line = distance_along(self.motion.axis, self.motion.T_pc[index]) + self.probe.laser.baseline_mm
        off = np.abs(line - s.mean()) - np.ptp(s) / 2
        index = index[(off > _CLEAR_MM) & (off < _FARTHEST_MM)]
        some = index[np.unique(np.linspace(0, len(index) - 1, min(len(index), _PICTURES)).astype(int))]
        images = self.recording.read(self.motion.frame[some], "grey")
        for k, (_, image) in zip(some, images, strict=True):
            if image is not None:
                yield inverse(self.motion.T_pc[k]), np.asarray(image, np.float32)

    def _seen(self, xyz_p: Float, inside: Bool, T_cp: Float, image: Float) -> Float | None:
        """Return the fine texture (n,) of the wall's points in a picture; None where it does not show all."""
        uv, valid = self.probe.camera.project(transform(T_cp, xyz_p))
        u, v = (uv[..., k].astype(np.float32) for k in (0, 1))
        within = valid & (u > 1) & (v > 1) & (u < image.shape[1] - 2) & (v < image.shape[0] - 2)
        if not within[inside].all():
            return None
        grey = cv2.remap(image, u, v, cv2.INTER_LINEAR)
        fine = (grey - cv2.GaussianBlur(grey, (0, 0), _BROAD_PX))[inside]
        return np.asarray((fine - fine.mean()) / fine.std(), float) if fine.std() > 1 else None


def _agreement(pictures: Float) -> float:
    """Return the mean correlation of pictures (P, n) of unit variance with each other."""
    one, other = np.triu_indices(len(pictures), 1)
    return float(np.mean(pictures[one] * pictures[other]))
