"""Dark lines in the wall's photo, as cracks are: narrower than the rings can measure, plain to the eye.

1. Strength of a valley of brightness at every pixel, by the second derivatives across it, over what is usual
   around (after Frangi et al., Multiscale vessel enhancement filtering, MICCAI 1998).
2. Thinned to lines of one pixel; what is connected is one line. Its weight is the sum of its strengths: an
   area, as a seam of the photo, weighs no more than a line.
3. Bright and dark lines of the same photo tell how heavy lines of the wall's own pattern get. Only what this
   does not explain is told: a wall full of streaks may hide a crack, but none is invented there.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np

from pipeline.arrays import Bool, Float, Float32, Int
from pipeline.artefacts.measured import WallTexture
from stages.defects.along import stretches
from stages.defects.relief import WallRelief
from stages.defects.segment import Region

# Half a millimetre is a wide crack and two pixels of a usual photo; mm and pixels, 1 σ of the smoothing.
_LINE_MM, _LINE_PX = 0.25, 1.0
# The usual strength is that of a square of wall around, which no single line fills, mm. Chosen.
_AROUND_MM = 25.0
# A line goes on where it is so many times as strong as usual; more than the second says no more. Chosen.
_GOES_ON, _MOST = 1.5, 6.0
# So much of the photo's edge, and of that of places without a photo, is left out, mm.
_EDGE_MM = 2.0
# Lines over the seam of the picture and over cuts along the pipe are whole up to this length, mm.
_OVERLAP_MM = 30.0
# So many of the heaviest lines tell how the weights of a pattern fall off; a photo has a line by chance in so
# many cases; shorter ones are specks, mm. Chosen.
_HEAVIEST, _BY_CHANCE, _SHORTEST_MM = 40, 0.01, 5.0
# A bright line is dark on both sides, at 1.7 times the smoothing: so far away a heavier bright one is looked
# for, mm.
_FLANK_MM = 1.0
# The rim of a finding is dark as well, so far from it, mm: of its lines more than half lies there. Chosen.
_BESIDE_MM, _MOSTLY = 2.0, 0.5
_DARKEST = 4.0  # grey levels: below it a ratio of brightness is noise of the darkness


@dataclass(frozen=True)
class _Line:
    """Rows and columns (N,) of a line in the picture, and its weight."""

    row: Int
    column: Int
    weight: float


def dark_lines(texture: WallTexture, relief: WallRelief) -> tuple[Region, ...]:
    """Return the dark lines of a photo that its own pattern does not explain, as cells of the map."""
    rows = len(texture.bgra)
    overlap = round(_OVERLAP_MM / texture.mm_per_px)
    parts = stretches(rows, overlap)
    cells: list[Region] = []
    for part in parts:
        strip = _Strip(texture, part.wide, relief.radius_mm)
        lines = (line for line in strip.unexplained(_BY_CHANCE / len(parts)))
        own = (k for k in lines if part.inner.start <= k.row.mean() < part.inner.stop)
        cells += [strip.cells_of(line, relief) for line in own]
    return tuple(cells)


class _Strip:
    """Some rows of a photo, with a part of it repeated beyond its seam."""

    def __init__(self, texture: WallTexture, rows: slice, radius_mm: float) -> None:
        self._texture, self._first = texture, rows.start
        self._cell = texture.mm_per_px, texture.rad_per_px * radius_mm
        self._around = round(2 * np.pi / texture.rad_per_px)
        picture = np.asarray(texture.bgra[rows])
        whole = picture.shape[1] >= self._around
        self._beyond = round(_OVERLAP_MM / self._cell[1]) if whole else 0
        self._picture = np.pad(picture, ((0, 0), (self._beyond, self._beyond), (0, 0)), "wrap")

    def unexplained(self, by_chance: float) -> Iterator[_Line]:
        """Yield the dark lines that are heavier than the photo's pattern makes lines, but by this chance."""
        valley, ridge = self._strengths()
        dark, bright = self._lines(valley), self._lines(ridge)
        reach = tuple(2 * round(_FLANK_MM / c) + 1 for c in self._cell)
        beside = cv2.dilate(ridge, np.ones(reach, np.uint8))
        weight = np.sort([line.weight for line in dark + bright])[::-1]
        limit = limit_of_weight(weight, by_chance)
        for line in dark:
            size = np.hypot(np.ptp(line.row) * self._cell[0], np.ptp(line.column) * self._cell[1])
            middle = self._beyond <= line.column.mean() < self._beyond + self._around
            flank = beside[line.row, line.column].sum() > valley[line.row, line.column].sum()
            if line.weight > limit and size >= _SHORTEST_MM and middle and not flank:
                yield line

    def _strengths(self) -> tuple[Float32, Float32]:
        """Return how strong dark and bright lines are (h, w), over what is usual; 0 without a photo."""
        grey = cv2.cvtColor(self._picture[..., :3], cv2.COLOR_BGR2GRAY).astype(np.float32)
        smooth = self._blurred(np.log(grey + _DARKEST), max(_LINE_MM, _LINE_PX * max(self._cell)))
        along, around = (1 / c**2 for c in self._cell)
        ss = cv2.Sobel(smooth, cv2.CV_32F, 0, 2) * along
        aa = cv2.Sobel(smooth, cv2.CV_32F, 2, 0) * around
        sa = cv2.Sobel(smooth, cv2.CV_32F, 1, 1) * np.sqrt(along * around)
        middle, half = (ss + aa) / 2, np.hypot((ss - aa) / 2, sa)
        dark = np.maximum(middle + half - np.abs(middle - half), 0)
        bright = np.maximum(half - middle - np.abs(middle + half), 0)
        window = tuple(max(1, round(_AROUND_MM / c)) for c in self._cell[::-1])
        usual = np.sqrt(np.maximum(cv2.blur((dark + bright) ** 2, window), np.finfo(np.float32).tiny))
        seen = self._seen()
        return dark / usual * seen, bright / usual * seen

    def _blurred(self, image: Float32, sigma_mm: float) -> Float32:
        along, around = (sigma_mm / c for c in self._cell)
        return np.asarray(cv2.GaussianBlur(image, (0, 0), around, sigmaY=along), np.float32)

    def _seen(self) -> Bool:
        """Return where there is a photo (h, w), its edges left out."""
        known = np.pad((self._picture[..., 3] > 0).astype(np.uint8), 1)
        height, width = (2 * round(_EDGE_MM / c) + 1 for c in self._cell)
        return np.asarray(cv2.erode(known, np.ones((height, width), np.uint8))[1:-1, 1:-1] > 0)

    def _lines(self, strength: Float32) -> list[_Line]:
        """Return the heaviest of what is connected, thinned to one pixel."""
        thin = cv2.ximgproc.thinning(np.where(strength > _GOES_ON, 255, 0).astype(np.uint8))
        _, label = cv2.connectedComponents(thin)
        row, column = np.nonzero(thin)
        number = label[row, column]
        weight = np.bincount(number, np.minimum(strength[row, column], _MOST))
        heaviest = np.argsort(weight)[::-1][:_HEAVIEST]
        return [_Line(row[number == k], column[number == k], float(weight[k])) for k in heaviest if weight[k]]

    def cells_of(self, line: _Line, relief: WallRelief) -> Region:
        """Return the cells of the map through which a line goes."""
        texture, radius_map = self._texture, relief.radius_map
        s = texture.distance_from_mm + (self._first + line.row) * texture.mm_per_px
        psi = texture.azimuth_from_rad + (line.column - self._beyond) * texture.rad_per_px
        step = radius_map.azimuth_rad[1] - radius_map.azimuth_rad[0]
        i = np.rint((s - radius_map.distance_mm[0]) / relief.cell_mm[0]).astype(int)
        j = np.rint((psi - radius_map.azimuth_rad[0]) / step).astype(int)
        i = np.clip(i, 0, len(radius_map.distance_mm) - 1)
        mask = np.zeros((np.ptp(i) + 1, np.ptp(j) + 1), np.uint8)
        mask[i - i.min(), j - j.min()] = 1
        return Region(int(i.min()), int(j.min()), mask > 0, 1.0)


def lies_beside(line: Region, found: Region, relief: WallRelief) -> bool:
    """Return whether most of a line lies in the window of a finding or within some millimetres of it."""
    columns = relief.shape[1]
    along, around = (round(_BESIDE_MM / c) for c in relief.cell_mm)
    i, j = np.nonzero(line.mask)
    row = i + line.row - found.row
    column = (j + line.column - found.column + around) % columns
    height, width = found.mask.shape
    inside = (row >= -along) & (row < height + along) & (column < width + 2 * around)
    return bool(inside.mean() > _MOSTLY)


def limit_of_weight(weight: Float, by_chance: float) -> float:
    """Return the weight above which a pattern whose lines weigh so much (N,), falling, has one by chance.

    Above some weight they fall off as a power (Pareto), whose exponent their median gives, which a few cracks
    hardly move. Of too few lines nothing is known, and the limit is endless.
    """
    if len(weight) < _HEAVIEST:
        return np.inf
    least = weight[_HEAVIEST - 1]
    fall = float(np.median(np.log(weight[:_HEAVIEST] / least))) / np.log(2)
    return float(least * (_HEAVIEST / by_chance) ** fall)
