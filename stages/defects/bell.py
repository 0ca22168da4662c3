"""Small defects between the rings: a bell fitted to the points.

Where only a few rings cross a defect, its deepest place lies between them. Around the pipe it is sampled
densely: that profile tells the shape, which is taken to be the same along the pipe up to its own length.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from pipeline.arrays import Float
from stages.defects.fine import DeviationPoints
from stages.defects.relief import Relief
from stages.defects.segment import Region

_MARGIN_MM = 2.5
_LEAST = 24
_SHAPE_PRIOR_MM = 0.35  # 0.07 mm, the noise of independent samples, over 0.2, the prior 1 σ of ln p
_OVERSAMPLED = 3.0  # neighbouring samples of a ring share their noise


@dataclass(frozen=True)
class Bell:
    """Height of the bell's 1 mm mean, its 1 σ from noise, and RMS of the points about the bell, mm."""

    height_mm: float
    sigma_mm: float
    residual_mm: float


def fit_bell(relief: Relief, region: Region, points: DeviationPoints) -> Bell | None:
    """Fit height · exp(−(x²/a² + y²/b²)^p) to a region's points; None where few are or none stands out."""
    x, y, value = _near(relief, region, points)
    value = region.sign * value
    if len(value) < _LEAST or value.max() <= 0:
        return None
    size = np.array(region.mask.shape) * relief.cell_mm
    top = np.argmax(value)
    start = np.array([value[top], x[top], y[top], *np.log(0.35 * size), 0.0])
    low = start - np.array([0.5 * value[top], size[0] / 2, size[1] / 2, 1.5, 1.5, 0.5])
    high = start + np.array([value[top], size[0] / 2, size[1] / 2, 1.0, 1.0, 1.4])

    def misfit(t: Float) -> Float:
        return np.append(_bell(t, x, y) - value, _SHAPE_PRIOR_MM * t[5])

    found = least_squares(misfit, start, bounds=(low, high), x_scale=[1, 1, 1, 0.3, 0.3, 0.5])
    jacobian = np.asarray(found.jac, float)
    freedom = max(1.0, len(value) - 6.0)
    variance = float(found.fun @ found.fun) / freedom
    curvature = jacobian.T @ jacobian + 1e-9 * np.eye(6)
    height, slope = _millimetre_mean(found.x)
    covariance = variance * _OVERSAMPLED * np.linalg.inv(curvature)
    return Bell(height, float(np.sqrt(slope @ covariance @ slope)), float(np.sqrt(variance)))


def _near(relief: Relief, region: Region, points: DeviationPoints) -> tuple[Float, Float, Float]:
    """Return place (mm along and around from the window's middle) and deviation of a window's points."""
    size = np.array(region.mask.shape)
    reach = size / 2 + _MARGIN_MM / np.array(relief.cell_mm)
    along = points.row - (region.row + (size[0] - 1) / 2)
    columns = len(relief.azimuth_rad)
    around = points.column - (region.column + (size[1] - 1) / 2)
    around = around - columns * np.rint(around / columns)
    near = (np.abs(along) <= reach[0]) & (np.abs(around) <= reach[1])
    return along[near] * relief.cell_mm[0], around[near] * relief.cell_mm[1], points.deviation_mm[near]


def _bell(t: Float, x: Float, y: Float) -> Float:
    q = ((x - t[1]) / np.exp(t[3])) ** 2 + ((y - t[2]) / np.exp(t[4])) ** 2
    return np.asarray(t[0] * np.exp(-((q + 1e-12) ** np.exp(t[5]))))


def _millimetre_mean(t: Float) -> tuple[float, Float]:
    """Return the mean of the bell over 1 mm × 1 mm at its top, and the gradient by its parameters (6,)."""
    offset = (np.arange(9) - 4) / 9
    x, y = (g.ravel() for g in np.meshgrid(offset, offset))

    def mean(p: Float) -> float:
        return float(_bell(p, x + p[1], y + p[2]).mean())

    steps = 1e-4 * np.eye(6)
    gradient = np.array([(mean(t + d) - mean(t - d)) / 2e-4 for d in steps])
    return mean(t), gradient
