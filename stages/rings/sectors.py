"""The image cut into azimuth sectors: every pixel belongs to exactly one ring sample."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.artefacts import Float


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
    """

    azimuth_rad: Float
    centre_px: Float
    image_size: tuple[int, int]
    start: NDArray[np.int64]
    pixel: NDArray[np.int32]
    radius_px: NDArray[np.float32]
    offset_rad: NDArray[np.float32]

    def pixels_near(self, radius_px: Float, least_px: float, most_px: float) -> NDArray[np.int32]:
        """Return flat indices of the pixels whose distance to the ring (A,) is in [least, most), px."""
        away = np.abs(self.radius_px - np.repeat(radius_px, np.diff(self.start)).astype(np.float32))
        return self.pixel[(away >= least_px) & (away < most_px)]


def cut_sectors(image_size: tuple[int, int], centre_px: Float, azimuths: int) -> Sectors:
    """Assign every pixel of an image (width, height) to the nearest of ``azimuths`` directions."""
    width, height = image_size
    v, u = np.mgrid[:height, :width]
    du, dv = (u - centre_px[0]).ravel(), (v - centre_px[1]).ravel()
    radius, turn = np.hypot(du, dv), np.arctan2(dv, du)
    step = 2 * np.pi / azimuths
    nearest = np.rint((turn + np.pi) / step).astype(np.int64)
    sector = nearest % azimuths
    order = np.argsort(sector * (4.0 * (width + height)) + radius, kind="stable")
    start = np.concatenate([[0], np.cumsum(np.bincount(sector, minlength=azimuths))])
    return Sectors(
        -np.pi + step * np.arange(azimuths),
        np.asarray(centre_px, float),
        image_size,
        start,
        order.astype(np.int32),
        radius[order].astype(np.float32),
        (turn + np.pi - nearest * step)[order].astype(np.float32),
    )
