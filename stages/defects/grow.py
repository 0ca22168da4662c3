"""Grow regions from the detected cells by hysteresis, over a map of any length."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.ndimage import label

from pipeline.adjustment.robust import robust_spread
from pipeline.arrays import Bool, Float, Float32
from pipeline.machine.scratch import Scratch
from stages.defects.along import stretches, widened
from stages.defects.detect import Detection
from stages.defects.parameters import DefectParameters
from stages.defects.relief import WallRelief

_EIGHT = np.ones((3, 3), int)
_REACH_MM = 80.0  # a defect is followed over at most this distance from its top in one step
_FOOT_MM = 10.0  # width of the margin that is taken to hold the foot of a defect
_BLOCK = 64  # rows per block in the search for the highest cell


@dataclass(frozen=True)
class Grown:
    """Cells (S, A) of all defects that go into the wall, and of all that stand inward."""

    into: Bool
    inward: Bool


def grown(relief: WallRelief, seeds: Detection, parameters: DefectParameters, scratch: Scratch) -> Grown:
    """Return all cells of all defects: each one extends down to a fraction of its own height.

    The highest cell of the whole wall is grown first, so that the result does not depend on how a long map is
    cut into stretches.
    """
    smooth = scratch.zeros(relief.shape, np.float32)
    for part in stretches(relief.shape[0], relief.rows_in(1.0)):
        smooth[part.own] = millimetre_mean(relief.rows(part.wide).local_mm, relief.cell_mm)[part.inner]
    spread = robust_spread(np.concatenate([smooth[rows] for rows in relief.sampled]))
    foot = max(2.5 * spread, 0.5 * parameters.min_depth_mm)
    reach = round(_REACH_MM / relief.cell_mm[0])
    hills = (Hills(sign, smooth, foot, reach) for sign in (1.0, -1.0))
    into, inward = (
        hill.grown(cells, parameters, scratch)
        for hill, cells in zip(hills, (seeds.into, seeds.inward), strict=True)
    )
    return Grown(into, inward)


def footprint(relief: WallRelief, cells: Grown, scratch: Scratch) -> Bool:
    """Return the cells (S, A) of all defects with a margin of 10 mm for their feet."""
    out = scratch.zeros(relief.shape, bool)
    for part in stretches(relief.shape[0], relief.rows_in(_FOOT_MM)):
        either = cells.into[part.wide] | cells.inward[part.wide]
        out[part.own] = joined(either, relief.cell_mm, _FOOT_MM)[part.inner]
    return out


def joined(mask: Bool, cell_mm: tuple[float, float], gap_mm: float) -> Bool:
    """Return the mask (rows, A) dilated by half of ``gap_mm``: cells of one defect then touch each other."""
    reach = [max(0, round(gap_mm / 2 / c)) for c in cell_mm]
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach[1] + 1, 2 * reach[0] + 1))
    pad = reach[1] + 1
    wide = np.concatenate([mask[:, -pad:], mask, mask[:, :pad]], 1).astype(np.uint8)
    return np.asarray(cv2.dilate(wide, kernel)[:, pad:-pad] > 0)


@dataclass(frozen=True)
class Hills:
    """What deviates from the wall to one side.

    Attributes
    ----------
    sign : float
        +1 for what goes into the wall, −1 for what stands inward.
    smooth_mm : (S, A)
        1 mm mean of the relief.
    foot_mm : float
        Height below which nothing belongs to a defect.
    reach : int
        Rows over which a defect is followed from its top in one step.
    """

    sign: float
    smooth_mm: Float32
    foot_mm: float
    reach: int

    def height(self, rows: slice) -> Float:
        """Return the height of some rows (rows, A), mm; −1 where nothing was measured."""
        return np.nan_to_num(self.sign * self.smooth_mm[rows].astype(float), nan=-1.0)

    def grown(self, seeds: Bool, parameters: DefectParameters, scratch: Scratch) -> Bool:
        """Return the cells (S, A) of all hills that hold one of ``seeds``, grown from the highest down."""
        out, left = (scratch.zeros(seeds.shape, bool) for _ in range(2))
        least = max(self.foot_mm, 0.75 * parameters.min_depth_mm)
        for part in stretches(len(seeds)):
            left[part.own] = seeds[part.own] & (self.height(part.own) > least)
        tops = np.array([self._top(left, k) for k in range(-(-len(seeds) // _BLOCK))])
        while tops.max() > 0:
            rows = self._grow(self._place(left, int(np.argmax(tops))), out, left, parameters)
            for k in range(rows.start // _BLOCK, (rows.stop - 1) // _BLOCK + 1):
                tops[k] = self._top(left, k)
        return out

    def _top(self, left: Bool, block: int) -> float:
        """Return the greatest height, mm, of a block's remaining cells; 0 when none remains."""
        rows = slice(block * _BLOCK, min((block + 1) * _BLOCK, len(left)))
        return float(np.where(left[rows], self.height(rows), 0.0).max()) if left[rows].any() else 0.0

    def _place(self, left: Bool, block: int) -> tuple[int, int]:
        """Return row and column of the highest remaining cell of a block."""
        rows = slice(block * _BLOCK, min((block + 1) * _BLOCK, len(left)))
        i, j = divmod(int(np.argmax(np.where(left[rows], self.height(rows), 0.0))), left.shape[1])
        return rows.start + i, j

    def _grow(self, top: tuple[int, int], out: Bool, left: Bool, parameters: DefectParameters) -> slice:
        """Add the hill below a top to ``out``, remove it and its skirt from ``left``; return the rows."""
        i, j = top
        window = widened(slice(i, i + 1), len(left), self.reach).wide
        turn = left.shape[1] // 2 - j
        near = np.roll(self.height(window), turn, 1)
        centre = (i - window.start, left.shape[1] // 2)
        level = max(parameters.outline_fraction * near[centre], self.foot_mm)
        region = _component(near > level, centre)
        skirt = _component(near > self.foot_mm, centre) & (near <= level)
        out[window] |= np.roll(region, -turn, 1)
        left[window] &= ~np.roll(region | skirt, -turn, 1)
        return window


def _component(mask: Bool, cell: tuple[int, int]) -> Bool:
    labels, _ = label(mask, _EIGHT)
    return np.asarray(labels == labels[cell])


def millimetre_mean(image: Float, cell_mm: tuple[float, float]) -> Float:
    """Return the mean over 1 mm × 1 mm, periodic in azimuth; NaN where less than half of it was seen."""
    size = tuple(max(1, round(1.0 / c)) for c in cell_mm)
    pad = size[1]
    wide = np.concatenate([image[:, -pad:], image, image[:, :pad]], 1)
    seen = np.isfinite(wide).astype(float)
    mean = cv2.blur(np.nan_to_num(wide), size[::-1], borderType=cv2.BORDER_REPLICATE)
    share = cv2.blur(seen, size[::-1], borderType=cv2.BORDER_REPLICATE)
    with np.errstate(invalid="ignore", divide="ignore"):
        out = np.where(share >= 0.5, mean / share, np.nan)
    return np.asarray(out[:, pad:-pad])
