"""Mixture of the colour channels in which the laser line stands out from a lit wall."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.artefacts import Float
from stages.rings.sectors import Sectors

_BLUE_GREEN_NM, _GREEN_RED_NM = 490.0, 580.0
_LINE_WIDTHS, _WALL_WIDTHS = 0.7, 4.0


def excess_weights(wavelength_nm: float) -> Float:
    """Return (3,) B, G, R weights: the channel nearest to the laser's wavelength minus half of the others."""
    channel = 0 if wavelength_nm < _BLUE_GREEN_NM else 1 if wavelength_nm < _GREEN_RED_NM else 2
    weights = np.full(3, -0.5)
    weights[channel] = 1.0
    return weights


def mix(bgr: NDArray[np.uint8], weights: Float) -> NDArray[np.float32]:
    """Return the (H, W) mixture of an image (H, W, 3)."""
    return np.asarray(bgr @ weights.astype(np.float32), np.float32)


def discriminant_weights(
    bgr: NDArray[np.uint8], sectors: Sectors, radius_px: Float, width_px: float, band_px: float
) -> Float | None:
    """Return (3,) Fisher discriminant weights between line and wall beside it; None where it is undefined.

    The wall's colour covariance holds both its reflectance and the sensor's noise, so the mixture has the best
    ratio of line height to what is not line. Scaled so that the line keeps its height in the strongest channel.
    """
    sector = np.repeat(np.arange(len(radius_px)), np.diff(sectors.start))
    away = np.abs(sectors.radius_px - radius_px[sector]) / width_px
    line = bgr.reshape(-1, 3)[sectors.pixel[away < _LINE_WIDTHS]].astype(float)
    beside = (away > _WALL_WIDTHS) & (away * width_px < band_px)
    wall = bgr.reshape(-1, 3)[sectors.pixel[beside]].astype(float)
    if len(line) < 100 or len(wall) < 100:
        return None
    rise = line.mean(0) - wall.mean(0)
    covariance = np.cov(wall.T) + np.eye(3) / 12
    weights = np.linalg.solve(covariance, rise)
    gain = float(weights @ rise / rise.max())
    return weights / gain if gain > 0 else None
