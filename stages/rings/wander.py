"""Estimates the line's scatter beyond its noise: speckle, texture, other light, compression."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from pipeline.adjustment.robust import robust_spread
from pipeline.arrays import Bool, Float, Float32
from pipeline.artefacts.measured import RingSamples

# Sectors this many line widths apart share neither pixels nor speckle.
_LAG_WIDTHS = 6.0
# Groups of equal size, by the line's height, in which the wander is estimated. With fewer samples than this
# in each, one wander is estimated for all.
_GROUPS, _LEAST_SAMPLES = 8, 500


@dataclass(frozen=True)
class Wander:
    """1 σ of the line's position beyond its noise: a part without and a part with influence of its height.

    Speckle and the laser's own light on the wall's texture displace every line equally, by ``even_px``. Other
    light, from lamps or left by compression, displaces a line by the ratio of that light's slope to the
    line's height: by ``slope_px`` (px times grey level) over the line's height.
    """

    even_px: float
    slope_px: float

    def at(self, amplitude: Float | Float32 | float) -> Float:
        """Return the 1 σ, px, of lines of these heights (...), grey levels."""
        return np.hypot(self.even_px, self.slope_px / np.asarray(amplitude, float))


def wander_of(samples: RingSamples) -> Wander:
    """Return the scatter of the line beyond the stated σ of the samples.

    It is estimated from second differences along the ring between sectors that are far enough apart to share
    neither pixels nor speckle (both are blurred over the line's width), and near enough for the wall to be
    straight; medians exclude true edges.
    """
    valid, lag = samples.valid, _lag(samples)
    radius = np.where(valid, samples.radius_px, np.nan).astype(float)
    bend = np.roll(radius, lag, 1) - 2 * radius + np.roll(radius, -lag, 1)
    known = np.isfinite(bend)
    if not known.any():
        return Wander(0.0, 0.0)
    stated = _in_bends(np.where(known, samples.sigma_px, 1.0).astype(float) ** 2, lag, known)
    faint = _in_bends(np.where(known, samples.amplitude, 1.0).astype(float) ** -2, lag, known)
    return _by_height(bend[known] / np.sqrt(6), stated, faint)


def _lag(samples: RingSamples) -> int:
    valid = samples.valid
    if not valid.any():
        return 1
    arc = np.median(samples.radius_px[valid]) * (samples.azimuth_rad[1] - samples.azimuth_rad[0])
    return int(np.ceil(_LAG_WIDTHS * np.median(samples.width_px[valid]) / arc))


def _in_bends(variance: Float, lag: int, known: Bool) -> Float:
    """Return the mean of a variance (F, A) over the known second differences, with their weights."""
    return np.asarray((np.roll(variance, lag, 1) + 4 * variance + np.roll(variance, -lag, 1))[known] / 6)


def _by_height(bend: Float, stated: Float, faint: Float) -> Wander:
    """Return the wander that explains the spread of ``bend`` (N,) beyond ``stated`` (N,), in groups.

    ``faint`` (N,) is the inverse square of the line's height.
    """
    groups = max(min(_GROUPS, len(bend) // _LEAST_SAMPLES), 1)
    order = np.array_split(np.argsort(faint), groups)
    left = np.array([robust_spread(bend[g]) ** 2 - np.median(stated[g]) for g in order])
    if groups == 1:
        return Wander(float(np.sqrt(max(left[0], 0.0))), 0.0)
    height = np.array([np.median(faint[g]) for g in order])
    scale = float(height.mean())
    even, slope = nnls(np.stack([np.ones(groups), height / scale], -1), left)[0]
    return Wander(float(np.sqrt(even)), float(np.sqrt(slope / scale)))
