"""Mixture of the colour channels in which the laser line stands out from a lit wall."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Byte, Float, Float32
from stages.rings.noise import QUANTISATION_VARIANCE
from stages.rings.search import BAND_WIDTHS
from stages.rings.sectors import Sectors
from stages.rings.trace import RingTrace

_BLUE_GREEN_NM, _GREEN_RED_NM = 490.0, 580.0
_LINE_WIDTHS, _WALL_WIDTHS = 0.7, 4.0


def excess_weights(wavelength_nm: float) -> Float:
    """Return (3,) B, G, R weights: the channel nearest to the laser's wavelength minus half of the others."""
    channel = 0 if wavelength_nm < _BLUE_GREEN_NM else 1 if wavelength_nm < _GREEN_RED_NM else 2
    weights = np.full(3, -0.5)
    weights[channel] = 1.0
    return weights


def mix(bgr: Byte, weights: Float) -> Float32:
    """Return the (H, W) mixture of an image (H, W, 3)."""
    return np.asarray(bgr @ weights.astype(np.float32), np.float32)


def discriminant_weights(bgr: Byte, sectors: Sectors, trace: RingTrace, otherwise: Float) -> Float:
    """Return (3,) Fisher discriminant weights between line and wall beside it.

    The wall's colour covariance holds both its reflectance and the sensor's noise, so the mixture has the
    best ratio of line height to what is not line. Scaled so that the line keeps its height in the strongest
    channel; ``otherwise`` is returned where line and wall do not differ in colour.
    """
    radius, width = trace.radius_everywhere(), trace.width_px
    line = bgr.reshape(-1, 3)[sectors.pixels_near(radius, 0, _LINE_WIDTHS * width)].astype(float)
    wall = bgr.reshape(-1, 3)[sectors.pixels_near(radius, _WALL_WIDTHS * width, BAND_WIDTHS * width)].astype(
        float
    )
    rise = line.mean(0) - wall.mean(0)
    weights = np.linalg.solve(np.cov(wall.T) + np.eye(3) * QUANTISATION_VARIANCE, rise)
    gain = float(weights @ rise / rise.max())
    return weights / gain if gain > 0 else otherwise
