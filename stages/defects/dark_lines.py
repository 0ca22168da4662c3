"""Find dark lines in the wall's photo, such as cracks: narrower than rings can measure, but visible.

1. Compute at every pixel how strong a valley of brightness is, from second derivatives across it, relative to
   what is usual around (after Frangi et al., Multiscale vessel enhancement filtering, MICCAI 1998).
2. Thin the result to lines one pixel wide; connected pixels are one line. Its weight is the sum of the
   strengths along it, so that an area, such as a seam of the photo, weighs no more than a line.
3. Bright and dark lines of the same photo show how heavy lines of the wall's own pattern get. Only dark lines
   heavier than that are reported: on a wall full of streaks a crack may be missed, but no streak becomes one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numba
import numpy as np

from pipeline.arrays import Bool, Float, Float32, Int
from pipeline.artefacts.measured import WallTexture
from pipeline.machine.scratch import Scratch
from stages.defects.along import stretches
from stages.defects.relief import WallRelief
from stages.defects.segment import Region, instances
from stages.defects.thinning import thinned

# 1 σ of the smoothing, the larger of mm and pixels: a wide crack is 0.5 mm or two pixels of a usual photo.
_LINE_MM, _LINE_PX = 0.25, 1.0
# The usual strength is the RMS over a square of wall of this size, mm, which no single line fills. Chosen.
_AROUND_MM = 25.0
# A line continues where it has 1.5 times the usual strength; strengths above 6 count as 6. Chosen.
_GOES_ON, _MOST = 1.5, 6.0
# Width left out along the edge of the photo and around places without a photo, mm.
_EDGE_MM = 2.0
# Lines across the photo's seam and across cuts along the pipe are found whole up to this length, mm.
_OVERLAP_MM = 30.0
# The 40 heaviest lines show how the weights of a pattern fall off; the limit is set so that a photo without
# cracks exceeds it in 5 % of cases; lines shorter than 5 mm are specks. Chosen.
_HEAVIEST, _BY_CHANCE, _SHORTEST_MM = 40, 0.05, 5.0
_MAY_BE_CRACKS = 5  # of the heaviest: these may be cracks and not part of the pattern
_LOOKED_AT = 400  # heaviest dark and bright lines; flanks and lines beyond the seam are then left out
_GAP_MM = 1.0  # parts of a line with a smaller gap are one line
# A bright line has dark flanks and a dark line bright ones, at 1.7 times the smoothing: lines within this
# distance of a heavier line of the other kind are left out, mm.
_FLANK_MM = 1.0
# The rim of a finding is dark, too: a line belongs to a finding if more than half of it lies this close, mm.
# Chosen.
_BESIDE_MM, _MOSTLY = 2.0, 0.5
_DARKEST = 4.0  # grey levels, added before the logarithm: below it a ratio of brightness is noise


@dataclass(frozen=True)
class _Line:
    """Rows and columns (N,) of the pixels of a line in the picture, and its weight, the sum of strengths."""

    row: Int
    column: Int
    weight: float


def dark_lines(texture: WallTexture, relief: WallRelief, scratch: Scratch) -> list[Region]:
    """Return the dark lines of a photo that its own pattern does not explain, as regions of the map."""
    overlap = round(_OVERLAP_MM / texture.mm_per_px)
    parts = stretches(len(texture.bgra), overlap)
    cells = scratch.zeros(relief.shape, np.bool_)
    for part in parts:
        strip = _Strip(texture, part.wide, relief.radius_mm)
        for line in strip.unexplained(_BY_CHANCE / len(parts)):
            if part.inner.start <= line.row.mean() < part.inner.stop:
                cells[strip.cells_of(line, relief)] = True
    return instances(cells, 1.0, relief.cell_mm, _GAP_MM, scratch)


class _Strip:
    """Some rows of a photo, continued on both sides by what lies beyond its seam."""

    def __init__(self, texture: WallTexture, rows: slice, radius_mm: float) -> None:
        self._texture, self._first = texture, rows.start
        self._cell = texture.mm_per_px, texture.rad_per_px * radius_mm
        self._around = round(2 * np.pi / texture.rad_per_px)
        picture = np.asarray(texture.bgra[rows])
        whole = picture.shape[1] >= self._around
        self._beyond = round(_OVERLAP_MM / self._cell[1]) if whole else 0
        self._picture = np.pad(picture, ((0, 0), (self._beyond, self._beyond), (0, 0)), "wrap")

    def unexplained(self, by_chance: float) -> Iterator[_Line]:
        """Yield dark lines heavier than the photo's own pattern makes with probability ``by_chance``."""
        valley, ridge = self._strengths()
        dark, bright = self._lines_but_flanks(valley, ridge), self._lines_but_flanks(ridge, valley)
        limit = limit_of_weight(np.sort([line.weight for line in dark + bright])[::-1], by_chance)
        for line in dark:
            size = np.hypot(np.ptp(line.row) * self._cell[0], np.ptp(line.column) * self._cell[1])
            if line.weight > limit and size >= _SHORTEST_MM:
                yield line

    def _lines_but_flanks(self, strength: Float32, other: Float32) -> list[_Line]:
        """Return lines, except those along a heavier line of the other kind and those beyond the seam."""
        reach = tuple(2 * round(_FLANK_MM / c) + 1 for c in self._cell)
        beside = cv2.dilate(other, np.ones(reach, np.uint8))
        own = (
            k
            for k in self._lines(strength)
            if beside[k.row, k.column].sum() < strength[k.row, k.column].sum()
        )
        return [k for k in own if self._beyond <= k.column.mean() < self._beyond + self._around]

    def _strengths(self) -> tuple[Float32, Float32]:
        """Return the strength of dark and bright lines (h, w) relative to the usual; 0 without a photo."""
        grey = cv2.cvtColor(self._picture, cv2.COLOR_BGRA2GRAY).astype(np.float32)
        smooth = self._blurred(np.log(grey + _DARKEST), max(_LINE_MM, _LINE_PX * max(self._cell)))
        ss, aa, sa = (cv2.Sobel(smooth, cv2.CV_32F, *n) for n in ((0, 2), (2, 0), (1, 1)))
        along, around = (1 / c**2 for c in self._cell)
        scale = np.array([along, around, np.sqrt(along * around)], np.float32)
        dark, bright, power = _valleys_and_ridges(ss, aa, sa, scale)
        window = tuple(max(1, round(_AROUND_MM / c)) for c in self._cell[::-1])
        _relative(dark, bright, cv2.blur(power, window), self._seen())
        return dark, bright

    def _blurred(self, image: Float32, sigma_mm: float) -> Float32:
        along, around = (sigma_mm / c for c in self._cell)
        return np.asarray(cv2.GaussianBlur(image, (0, 0), around, sigmaY=along), np.float32)

    def _seen(self) -> Bool:
        """Return where there is a photo (h, w), without a margin along its edges."""
        known = np.pad((self._picture[..., 3] > 0).astype(np.uint8), 1)
        height, width = (2 * round(_EDGE_MM / c) + 1 for c in self._cell)
        return np.asarray(cv2.erode(known, np.ones((height, width), np.uint8))[1:-1, 1:-1] > 0)

    def _lines(self, strength: Float32) -> list[_Line]:
        """Return the heaviest lines: connected pixels above the limit, thinned to a width of one pixel."""
        thin = thinned(strength > _GOES_ON)
        _, label = cv2.connectedComponents(thin.view(np.uint8))
        row, column = np.nonzero(thin)
        number = label[row, column]
        weight = np.bincount(number, np.minimum(strength[row, column], _MOST))
        if not len(weight):
            return []
        least = np.sort(weight)[-_LOOKED_AT:][0]
        kept = np.flatnonzero(weight[number] >= least)
        kept = kept[np.argsort(number[kept], kind="stable")]
        cuts = np.flatnonzero(np.diff(number[kept])) + 1
        return [_Line(row[k], column[k], float(weight[number[k[0]]])) for k in np.split(kept, cuts) if len(k)]

    def cells_of(self, line: _Line, relief: WallRelief) -> tuple[Int, Int]:
        """Return rows and columns of the map's cells that a line passes through."""
        texture, radius_map = self._texture, relief.radius_map
        s = texture.distance_from_mm + (self._first + line.row) * texture.mm_per_px
        psi = texture.azimuth_from_rad + (line.column - self._beyond) * texture.rad_per_px
        step = radius_map.azimuth_rad[1] - radius_map.azimuth_rad[0]
        i = np.rint((s - radius_map.distance_mm[0]) / relief.cell_mm[0]).astype(int)
        j = np.rint((psi - radius_map.azimuth_rad[0]) / step).astype(int) % relief.shape[1]
        on_map = (i >= 0) & (i < relief.shape[0])
        return i[on_map], j[on_map]


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _valleys_and_ridges(ss, aa, sa, scale):  # type: ignore[no-untyped-def]
    """Return curvature (h, w) across valleys and across ridges, and the square of their sum.

    ``ss``, ``aa`` and ``sa`` (h, w), times ``scale`` (3,), are the second derivatives along the pipe, around
    it and mixed. Across a line one principal curvature is large; the other one, whatever its sign, is not.
    """
    dark, bright, power = np.empty_like(ss), np.empty_like(ss), np.empty_like(ss)
    for i in range(ss.shape[0]):
        for j in range(ss.shape[1]):
            s, a, m = ss[i, j] * scale[0], aa[i, j] * scale[1], sa[i, j] * scale[2]
            middle, turn = (s + a) / np.float32(2), (s - a) / np.float32(2)
            half = np.hypot(turn, m)
            dark[i, j] = max(middle + half - abs(middle - half), np.float32(0))
            bright[i, j] = max(half - middle - abs(middle + half), np.float32(0))
            power[i, j] = (dark[i, j] + bright[i, j]) ** 2
    return dark, bright, power


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _relative(dark, bright, power, seen):  # type: ignore[no-untyped-def]
    """Divide strengths by the root of the mean ``power`` around, in place; 0 where no photo is ``seen``."""
    least = np.finfo(np.float32).tiny
    for i in range(dark.shape[0]):
        for j in range(dark.shape[1]):
            usual = np.sqrt(max(power[i, j], least))
            dark[i, j] = dark[i, j] / usual if seen[i, j] else np.float32(0)
            bright[i, j] = bright[i, j] / usual if seen[i, j] else np.float32(0)


def lies_beside(line: Region, found: Region, relief: WallRelief) -> bool:
    """Return whether more than half of a line's cells lie in the window of a finding or within 2 mm of it."""
    columns = relief.shape[1]
    along, around = (round(_BESIDE_MM / c) for c in relief.cell_mm)
    i, j = np.nonzero(line.mask)
    row = i + line.row - found.row
    column = (j + line.column - found.column + around) % columns
    height, width = found.mask.shape
    inside = (row >= -along) & (row < height + along) & (column < width + 2 * around)
    return bool(inside.mean() > _MOSTLY)


def limit_of_weight(weight: Float, by_chance: float) -> float:
    """Return the weight that the lines of a photo's own pattern exceed with a given probability.

    ``weight`` (N,) are the weights of all lines, falling. Above some weight their number falls off as a power
    (Pareto), so that the logarithms are exponential. The heaviest few may be cracks and enter only as
    "heavier than the rest"; the limit includes the uncertainty of the fitted power (predictive distribution
    of an exponential law with censored data: Lawless, Statistical Models and Methods for Lifetime Data, 2003,
    ch. 4). With fewer than 40 lines nothing is known and the limit is infinite.
    """
    if len(weight) < _HEAVIEST or weight[_HEAVIEST - 1] <= 0:
        return np.inf
    beyond = np.log(weight[: _HEAVIEST - 1] / weight[_HEAVIEST - 1])
    known = len(beyond) - _MAY_BE_CRACKS
    fall = (beyond[_MAY_BE_CRACKS:].sum() + _MAY_BE_CRACKS * beyond[_MAY_BE_CRACKS]) / known
    most = known * fall * ((len(beyond) / by_chance) ** (1 / known) - 1)
    return float(weight[_HEAVIEST - 1] * np.exp(most))
