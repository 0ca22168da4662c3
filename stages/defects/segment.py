"""From cells that stand out to instances, each with its own outline."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label

from stages.defects.detect import Detection
from stages.defects.parameters import DefectParameters
from stages.defects.relief import Relief

Float = NDArray[np.float64]
Mask = NDArray[np.bool_]

_EIGHT = np.ones((3, 3), int)
_REACH_MM = 80.0
_FOOT_MM = 10.0


@dataclass(frozen=True)
class Region:
    """Cells of one defect, in a window that is cut out of the map and never crosses its seam.

    Attributes
    ----------
    row, column : int
        Of the window's first cell in the map; the column may be negative.
    mask : (H, W) bool
    sign : float
        +1 into the wall, −1 inward.
    all_round : bool
        Whether it goes all round the pipe, as a weld does.
    """

    row: int
    column: int
    mask: Mask
    sign: float
    all_round: bool = False

    def cut(self, image: Float) -> Float:
        """Return the window (H, W) of a map (S, A)."""
        columns = np.arange(self.column, self.column + self.mask.shape[1]) % image.shape[1]
        return image[self.row : self.row + self.mask.shape[0]][:, columns]


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


def segment(relief: Relief, detection: Detection, parameters: DefectParameters) -> tuple[Region, ...]:
    """Grow every detection to its outline, join what belongs together, and add the welds."""
    smooth = millimetre_mean(relief.local_mm, relief.cell_mm)
    regions: list[Region] = []
    for sign, seeds in ((1.0, detection.into), (-1.0, detection.inward)):
        grown = _grown(sign * smooth, seeds, relief, parameters)
        regions += _instances(_joined(grown, relief, parameters.join_mm), grown, sign)
    return (*regions, *(_weld(relief, band) for band in relief.welds))


def footprint(relief: Relief, regions: tuple[Region, ...]) -> Mask:
    """Return the cells (S, A) of all local defects with a margin for their feet."""
    mask = np.zeros_like(relief.seen)
    for region in regions:
        if not region.all_round:
            i, j = np.nonzero(region.mask)
            mask[region.row + i, (region.column + j) % mask.shape[1]] = True
    return _joined(mask, relief, _FOOT_MM)


def _grown(height: Float, seeds: Mask, relief: Relief, parameters: DefectParameters) -> Mask:
    """Return all cells of all defects of one sign: hysteresis at a fraction of each one's own height."""
    spread = 1.4826 * float(np.nanmedian(np.abs(height)))
    out = np.zeros(seeds.shape, bool)
    foot = max(2.5 * spread, 0.5 * parameters.min_depth_mm)
    height = np.nan_to_num(height, nan=-1.0)
    left = seeds & (height > max(foot, 0.75 * parameters.min_depth_mm))
    rows_reach = round(_REACH_MM / relief.cell_mm[0])
    while left.any():
        peak = int(np.argmax(np.where(left, height, -np.inf)))
        i, j = divmod(peak, height.shape[1])
        turn = height.shape[1] // 2 - j
        window = slice(max(0, i - rows_reach), i + rows_reach + 1)
        near = np.roll(height[window], turn, 1)
        level = max(parameters.outline_fraction * height[i, j], foot)
        centre = (i - window.start, height.shape[1] // 2)
        region = _component(near > level, centre)
        skirt = _component(near > foot, centre) & (near <= level)
        out[window] |= np.roll(region, -turn, 1)
        left[window] &= ~np.roll(region | skirt, -turn, 1)
    return out


def _component(mask: Mask, cell: tuple[int, int]) -> Mask:
    labels, _ = label(mask, _EIGHT)
    return np.asarray(labels == labels[cell])


def _joined(mask: Mask, relief: Relief, gap_mm: float) -> Mask:
    """Return the mask closed over gaps of ``gap_mm``, by which cells are told to be of one defect."""
    reach = [max(0, round(gap_mm / 2 / c)) for c in relief.cell_mm]
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach[1] + 1, 2 * reach[0] + 1))
    pad = reach[1] + 1
    wide = np.concatenate([mask[:, -pad:], mask, mask[:, :pad]], 1).astype(np.uint8)
    return np.asarray(cv2.dilate(wide, kernel)[:, pad:-pad] > 0)


def _instances(joined: Mask, mask: Mask, sign: float) -> list[Region]:
    labels = _periodic_labels(joined)
    out = []
    for number in np.unique(labels[mask]):
        cells = mask & (labels == number)
        first = _widest_gap_end(cells.any(0))
        rolled = np.roll(cells, -first, 1)
        rows, columns = (np.flatnonzero(rolled.any(axis)) for axis in (1, 0))
        window = rolled[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
        out.append(Region(int(rows[0]), first + int(columns[0]), window, sign))
    return out


def _periodic_labels(mask: Mask) -> NDArray[np.int64]:
    """Label connected cells, across the seam too."""
    labels, _ = label(mask, _EIGHT)
    wide = np.concatenate([labels[:, -1:], labels[:, :1]], 1)
    for shift in (-1, 0, 1):
        ends = np.stack([wide[:, 0], np.roll(wide[:, 1], shift)], -1)
        for a, b in np.unique(ends[(ends > 0).all(1)], axis=0):
            a, b = labels[:, -1:][wide[:, 0] == a][0, 0], labels[:, :1][wide[:, 1] == b][0, 0]
            labels[labels == max(a, b)] = min(a, b)
    return np.asarray(labels, np.int64)


def _widest_gap_end(columns: Mask) -> int:
    """Return the column after the widest empty stretch of a periodic row, 0 when none is empty."""
    filled = np.flatnonzero(columns)
    gaps = np.diff(np.concatenate([filled, filled[:1] + len(columns)]))
    return int(filled[(int(np.argmax(gaps)) + 1) % len(filled)]) if gaps.max() > 1 else 0


def _weld(relief: Relief, band: slice) -> Region:
    rows = relief.all_mm[band]
    sign = float(np.sign(np.nanmedian(rows)))
    return Region(band.start, 0, np.isfinite(rows), sign, True)
