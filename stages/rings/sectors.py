"""The image cut into azimuth sectors: every pixel belongs to exactly one ring sample."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numba
import numpy as np

from pipeline.arrays import Byte, Float, Float32, Int, Int32
from pipeline.recording.base import FrameSource
from pipeline.recording.one_field import OneField
from stages.rings.kernels import first_at_least


@dataclass(frozen=True)
class Sectors:
    """Pixels sorted by azimuth sector, then by radius.

    Fitting the pixels where they are, instead of a resampled polar image, keeps their noise independent:
    no two samples share a pixel and no interpolation blurs the line.

    Attributes
    ----------
    azimuth_rad : (A,)
        Centres of the sectors, uniform, first −π.
    centre_px : (2,)
        Origin (u, v).
    image_size : (int, int)
        Width and height, px.
    start : (A + 1,) int64
        Sector a owns the entries ``start[a]:start[a + 1]`` of the arrays below.
    pixel : (N,) int32
        Index into the flattened image.
    radius_px, offset_rad : (N,) float32
        Distance from the centre, and azimuth relative to the sector's centre.
    taken : Sectors, optional
        The same without interpolated pixels (of interlaced pictures); None where every pixel was recorded.
    """

    azimuth_rad: Float
    centre_px: Float
    image_size: tuple[int, int]
    start: Int
    pixel: Int32
    radius_px: Float32
    offset_rad: Float32
    taken: Sectors | None = None

    @property
    def outermost_px(self) -> Float:
        """(A,) radius of each sector's outermost pixel."""
        return self.radius_px[self.start[1:] - 1].astype(float)

    def pixels_near(self, radius_px: Float, least_px: float, most_px: float) -> Int32:
        """Return flat indices of the pixels whose distance to the ring (A,) is in [least, most), px."""
        ring = radius_px.astype(np.float32)
        out = np.empty(_count_near(self.start, self.radius_px, ring, most_px), np.int32)
        return out[: _pick_near(self.start, self.pixel, self.radius_px, ring, least_px, most_px, out)]

    def colours_near(
        self, bgr: Byte, radius_px: Float, least_px: float, most_px: float
    ) -> tuple[Float, Float]:
        """Return mean (3,) and covariance (3, 3) of the colours of the same pixels of an image (H, W, 3)."""
        total = _sums_near(
            bgr.reshape(-1, 3), self.start, self.pixel, self.radius_px, radius_px.astype(np.float32),
            least_px, most_px,
        ).astype(float)  # fmt: skip
        mean = total[:3, 3] / total[3, 3]
        return mean, (total[:3, :3] - total[3, 3] * np.outer(mean, mean)) / (total[3, 3] - 1)


def with_even_rows_taken(sectors: Sectors) -> Sectors:
    """Return sectors of pictures whose odd rows are interpolated; the line is then fitted in even rows.

    Below and above the centre the line runs along the rows: interpolation broadens it there, by an amount
    that depends on its place between two rows. Beside the centre, where the line crosses the rows, all rows
    are used, since a sector may contain odd rows alone.
    """
    upright = np.abs(np.sin(sectors.azimuth_rad)) > np.sqrt(0.5)
    of_sector = np.repeat(np.arange(len(upright)), np.diff(sectors.start))
    keep = ~upright[of_sector] | (sectors.pixel // sectors.image_size[0] % 2 == 0)
    start = np.concatenate([[0], np.cumsum(keep)])[sectors.start]
    pixels = (values[keep] for values in (sectors.pixel, sectors.radius_px, sectors.offset_rad))
    return replace(
        sectors, taken=Sectors(sectors.azimuth_rad, sectors.centre_px, sectors.image_size, start, *pixels)
    )


def sectors_of(source: FrameSource, centre_px: Float | tuple[float, float], azimuths: int) -> Sectors:
    """Return the sectors of pictures from a source; of interlaced ones with the rows that were taken."""
    sectors = cut_sectors(source.image_size, np.asarray(centre_px), azimuths)
    return with_even_rows_taken(sectors) if isinstance(source, OneField) else sectors


def cut_sectors(image_size: tuple[int, int], centre_px: Float, azimuths: int) -> Sectors:
    """Assign every pixel of an image (width, height) to the nearest of ``azimuths`` directions."""
    centre = np.asarray(centre_px, float)
    sector, radius, offset = _polar(*image_size, centre[0], centre[1], azimuths)
    start, order = _grouped(sector, radius, azimuths)
    azimuth: Float = -np.pi + 2 * np.pi / azimuths * np.arange(azimuths, dtype=np.float64)
    return Sectors(azimuth, centre, image_size, start, order, radius[order], offset[order])


@numba.njit(cache=True, nogil=True)
def _count_near(start, radius, ring, most):  # type: ignore[no-untyped-def]
    """Return how many pixels may be nearer to the ring (A,) than ``most``."""
    total = 0
    for a in range(ring.size):
        low = first_at_least(radius, start[a], start[a + 1], ring[a] - most)
        total += first_at_least(radius, low, start[a + 1], ring[a] + most) - low
    return total


@numba.njit(cache=True, nogil=True)
def _pick_near(start, pixel, radius, ring, least, most, out):  # type: ignore[no-untyped-def]
    """Fill ``out`` with the pixels at distances in [least, most) to the ring (A,); return their number."""
    count = 0
    for a in range(ring.size):
        low = first_at_least(radius, start[a], start[a + 1], ring[a] - most)
        for k in range(low, first_at_least(radius, low, start[a + 1], ring[a] + most)):
            if least <= abs(radius[k] - ring[a]) < most:
                out[count] = pixel[k]
                count += 1
    return count


@numba.njit(cache=True, nogil=True)
def _sums_near(bgr, start, pixel, radius, ring, least, most):  # type: ignore[no-untyped-def]
    """Return the sums (4, 4) of the products of blue, green, red and 1 over the pixels of `_pick_near`."""
    n = b = g = r = bb = bg = br = gg = gr = rr = np.int64(0)
    for a in range(ring.size):
        low = first_at_least(radius, start[a], start[a + 1], ring[a] - most)
        for k in range(low, first_at_least(radius, low, start[a + 1], ring[a] + most)):
            if least <= abs(radius[k] - ring[a]) < most:
                p = pixel[k]
                x, y, z = np.int64(bgr[p, 0]), np.int64(bgr[p, 1]), np.int64(bgr[p, 2])
                n, b, g, r = n + 1, b + x, g + y, r + z
                bb, bg, br = bb + x * x, bg + x * y, br + x * z
                gg, gr, rr = gg + y * y, gr + y * z, rr + z * z
    return np.array([[bb, bg, br, b], [bg, gg, gr, g], [br, gr, rr, r], [b, g, r, n]])


@numba.njit(cache=True, nogil=True)
def _polar(width, height, u, v, azimuths):  # type: ignore[no-untyped-def]
    """Sector, radius and azimuth from the sector's centre of every pixel, (height × width,) each."""
    step = 2 * np.pi / azimuths
    sector = np.empty(width * height, np.int32)
    radius = np.empty(width * height, np.float32)
    offset = np.empty(width * height, np.float32)
    k = 0
    for row in range(height):
        for column in range(width):
            turn = (np.arctan2(row - v, column - u) + np.pi) / step
            nearest = int(turn + 0.5)
            sector[k] = nearest % azimuths
            radius[k] = np.hypot(row - v, column - u)
            offset[k] = (turn - nearest) * step
            k += 1
    return sector, radius, offset


@numba.njit(cache=True, nogil=True)
def _grouped(group, value, groups):  # type: ignore[no-untyped-def]
    """Start (groups + 1,) of each group and the order (N,) by group, then by ``value``: a sort by counting.

    Sorting all pixels by rounded value first, then stably by group, leaves only neighbours to be swapped.
    """
    largest = np.float32(0)
    for x in value:
        largest = max(largest, x)
    rings = np.zeros(int(largest) + 2, np.int64)
    start = np.zeros(groups + 1, np.int64)
    for k in range(group.size):
        rings[int(value[k]) + 1] += 1
        start[group[k] + 1] += 1
    for k in range(1, rings.size):
        rings[k] += rings[k - 1]
    end = np.zeros(groups, np.int64)
    for k in range(groups):
        end[k] = start[k]
        start[k + 1] += start[k]
    by_value = np.empty(group.size, np.int32)
    for k in range(group.size):
        ring = int(value[k])
        by_value[rings[ring]] = k
        rings[ring] += 1
    order = np.empty(group.size, np.int32)
    for k in by_value:
        at = end[group[k]]
        while at > start[group[k]] and value[order[at - 1]] > value[k]:
            order[at] = order[at - 1]
            at -= 1
        order[at] = k
        end[group[k]] += 1
    return start, order
