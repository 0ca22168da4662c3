"""Measure the depth of a defect: the extreme of its 1 mm mean, corrected for what noise adds to an extreme.

Where only a few rings cross a defect, its deepest place lies between them. Around the pipe it is sampled
densely: that profile gives the shape of a bell, which is fitted to the points. The bell has the same shape
along the pipe, with a length of its own, and may shift around the pipe from ring to ring where the defect
lies askew.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.optimize import OptimizeResult, least_squares

from pipeline.arrays import Float
from stages.defects.clean import CleanWall
from stages.defects.relief import Relief
from stages.defects.segment import Region
from stages.defects.surface import DeviationPoints, Surface

# A bell is fitted where fewer than 5 rings cross a defect, no weld within 5 mm, and is used if the points
# scatter about it by at most 0.12 of its height, RMS.
_FEW_RINGS = 5.0
_BELL_CLEAR_MM = 5.0
_BELL_MISFIT = 0.12
# If the height of the bell has a σ of more than this share of it, the bell is not used.
_BELL_UNKNOWN = 0.5
SHARPENING = 0.3  # 1 σ of a correction for a peak's curvature, relative to the correction
# 1 σ by which the top departs from a bell, as a share of the depth. Without it, 85 and 90 % of the depths of
# 88 defects painted into two open recordings were in their 95 % interval, with it 92 and 91 % of 82 (`python
# -m tests.benchmarks.bench_painted_findings`).
_TOP_SHAPE = 0.04
# A depth is significant from 1.96 σ on: zero is then outside its 95 % interval.
KNOWN = 1.96
_MARGIN_MM = 2.5
_LEAST = 24
_SHAPE_PRIOR_MM = 0.35  # 0.07 mm, the noise of independent samples, over 0.2, the prior 1 σ of ln p
_SKEW_PRIOR_MM = 0.07  # the same over 1, the prior 1 σ of the shift around per mm along
_SKEWS = (0.0, 0.7, -0.7)  # fits also start askew by ±35°: from 0 alone they may end in a broad bell


@dataclass(frozen=True)
class Depth:
    """Depth (positive into the wall), its 1 σ, and the bias from noise that was subtracted, mm.

    ``peak`` is the cell (row, column) of the region's window with the extreme deviation.
    """

    depth_mm: float
    sigma_mm: float
    bias_mm: float
    peak: tuple[int, int]

    @property
    def is_known(self) -> bool:
        """Whether zero is outside its 95 % interval."""
        return abs(self.depth_mm) >= KNOWN * self.sigma_mm

    def as_written(self) -> Depth:
        """Return the depth rounded as in defects.json, so that report and table agree in their last digit."""
        return replace(self, depth_mm=round(self.depth_mm, 4), sigma_mm=round(self.sigma_mm, 4))


def measure_depth(
    region: Region, surface: Surface, clean: CleanWall, draws: int, random: np.random.Generator
) -> Depth:
    """Measure the depth of one region.

    The extreme of a noisy surface exceeds the extreme of the true surface. By how much, and with which
    scatter, is found by adding noise drawn from the clean wall to the smoothed surface, ``draws`` times
    (parametric bootstrap: Efron & Tibshirani, An Introduction to the Bootstrap, 1993, ch. 10); the noise is
    scaled up where the map's own noise is larger.
    """
    relief = surface.relief
    height = region.sign * region.cut(surface.local_mm)
    inside = region.mask & np.isfinite(height)
    height = np.where(inside, height, 0.0)
    peak = np.unravel_index(int(np.argmax(height)), height.shape)
    smooth = gaussian_filter(height, [1.0 / c for c in relief.cell_mm])
    top = float(smooth[inside].max())
    # a top below zero is possible where the points do not show what the map shows
    near = inside & (smooth >= top - 0.5 * abs(top))
    gain = noise_gain(region, relief)
    drawn = np.array([(smooth + gain * clean.draw(height.shape, random))[near].max() for _ in range(draws)])
    bias = float(drawn.mean()) - top
    depth = float(height[peak]) - bias
    sharpened = float((region.cut(surface.all_mm) - region.cut(surface.coarse_mm))[peak])
    scatter = float(np.hypot(drawn.std(), sharpening_sigma(sharpened)))
    if is_small(relief, region, surface.points):
        noise = Noise(clean, float(gain[near].mean()), relief.cell_mm, draws, random)
        depth, scatter = _between_rings(relief, region, surface.points, noise, depth, scatter)
    sigma = float(np.hypot(scatter, shape_sigma(relief, region, depth, surface.points.spacing_mm)))
    return Depth(region.sign * depth, sigma, bias, (int(peak[0]), int(peak[1])))


def sharpening_sigma(sharpened_mm: float) -> float:
    """Return 1 σ of a peak's depth, mm, from which the map's smoothing had taken off ``sharpened_mm``."""
    return SHARPENING * abs(float(np.nan_to_num(sharpened_mm)))


def noise_gain(region: Region, relief: Relief) -> Float:
    """Return the noise of a region's cells (H, W) as a multiple of the wall's usual noise, at least 1.

    The line is dim on rust and at the bottom of a pit, and a codec keeps less of it there: rings scatter
    more.
    """
    return np.asarray(np.fmax(region.cut(relief.noise_mm) / relief.typical.sigma_mm, 1.0))


def is_small(relief: Relief, region: Region, points: DeviationPoints) -> bool:
    """Return whether so few rings cross a defect that its deepest place may lie between them.

    Always False beside a weld: there the points deviate by the weld, too, and no bell can be fitted.
    """
    margin = round(_BELL_CLEAR_MM / relief.cell_mm[0])
    first, last = region.row - margin, region.row + region.mask.shape[0] + margin
    beside = any(first < w.stop and w.start < last for w in relief.welds)
    length = region.mask.shape[0] * relief.cell_mm[0]
    return not beside and length < _FEW_RINGS * points.spacing_mm


@dataclass(frozen=True)
class Noise:
    """Noise of the clean wall, multiplied by ``gain`` and drawn ``draws`` times on cells of ``cell_mm``."""

    clean: CleanWall
    gain: float
    cell_mm: tuple[float, float]
    draws: int
    random: np.random.Generator

    def in_sum(self, weight: Float, x_mm: Float, y_mm: Float) -> float:
        """Return 1 σ of the sum of noise times ``weight`` over places (N,), mm along and around the pipe."""
        i, j = (np.rint(at / c).astype(int) for at, c in zip((x_mm, y_mm), self.cell_mm, strict=True))
        i, j = i - i.min(), j - j.min()
        shape = (int(i.max()) + 1, int(j.max()) + 1)
        drawn = [weight @ self.clean.draw(shape, self.random)[i, j] for _ in range(self.draws)]
        return self.gain * float(np.sqrt(np.mean(np.square(drawn))))


def _between_rings(
    relief: Relief, region: Region, points: DeviationPoints, noise: Noise, depth_mm: float, sigma_mm: float
) -> tuple[float, float]:
    """Return depth and 1 σ, mm, of the fitted bell if a bell describes the defect.

    Else the depth is what the rings themselves show, and its σ includes that the peak may lie between them.
    """
    bell = fit_bell(relief, region, points, noise)
    if bell is None or not bell.is_known:
        return depth_mm, float(np.hypot(sigma_mm, SHARPENING * depth_mm))
    return bell.height_mm, float(np.hypot(bell.sigma_mm, SHARPENING * (bell.height_mm - depth_mm)))


def shape_sigma(relief: Relief, region: Region, depth_mm: float, spacing_mm: float) -> float:
    """Return 1 σ, mm, of the smooth shape below a defect: five harmonics fitted to rough rings.

    What the defect's own foot takes from the harmonics is at most a few per cent of its depth. Where few
    rings cross it, the departure of its top from a bell or a local quadratic is included.
    """
    around = 2 * np.pi * relief.radius_mm
    independent = max(1.0, around / 8.0)
    ring = relief.typical.sigma_mm * np.sqrt(5 / independent)
    length = region.mask.shape[0] * relief.cell_mm[0]
    top = _TOP_SHAPE * min(1.0, _FEW_RINGS * spacing_mm / length)
    return float(np.linalg.norm([ring, 0.015 * depth_mm, top * depth_mm]))


@dataclass(frozen=True)
class Bell:
    """Height of the fitted bell's 1 mm mean, its 1 σ from noise, and RMS of the points about the bell, mm."""

    height_mm: float
    sigma_mm: float
    residual_mm: float

    @property
    def is_known(self) -> bool:
        """Whether the points show a bell, and its height."""
        fits = self.residual_mm <= _BELL_MISFIT * self.height_mm
        return fits and self.sigma_mm <= _BELL_UNKNOWN * self.height_mm


def fit_bell(relief: Relief, region: Region, points: DeviationPoints, noise: Noise) -> Bell | None:
    """Fit height · exp(−(x²/a² + (y − k x)²/b²)^p) to a region's points; None if none of them stands out.

    x is mm along the pipe and y mm around it, both from the bell's middle; k is the skew.
    """
    x, y, value = _near(relief, region, points)
    value = region.sign * value
    if len(value) < _LEAST or value.max() <= 0:
        return None
    size = np.array(region.mask.shape) * relief.cell_mm
    top = np.argmax(value)
    start = np.array([value[top], x[top], y[top], *np.log(0.35 * size), 0.0, 0.0])
    low = start - np.array([0.5 * value[top], size[0] / 2, size[1] / 2, 1.5, 2.5, 0.5, 2.0])
    high = start + np.array([value[top], size[0] / 2, size[1] / 2, 1.0, 1.0, 1.4, 2.0])

    def misfit(t: Float) -> Float:
        return np.concatenate([_bell(t, x, y) - value, [_SHAPE_PRIOR_MM * t[5], _SKEW_PRIOR_MM * t[6]]])

    def fitted(skew: float) -> OptimizeResult:
        unit = [1, 1, 1, 0.3, 0.3, 0.5, 0.5]
        return least_squares(misfit, [*start[:6], skew], bounds=(low, high), x_scale=unit)

    skews = _SKEWS if size[0] > points.spacing_mm else _SKEWS[:1]  # one ring alone cannot show a skew
    found = min(map(fitted, skews), key=lambda fit: float(fit.cost))
    jacobian = np.asarray(found.jac, float)
    height, slope = _millimetre_mean(found.x)
    curvature = jacobian.T @ jacobian + 1e-9 * np.eye(len(slope))
    by_point = (jacobian @ np.linalg.solve(curvature, slope))[: len(value)]
    residual = float(np.sqrt(found.fun @ found.fun / max(1.0, len(value) - len(slope))))
    sigma = np.hypot(noise.in_sum(by_point, x, y), residual * np.linalg.norm(by_point))
    return Bell(height, float(sigma), residual)


def _near(relief: Relief, region: Region, points: DeviationPoints) -> tuple[Float, Float, Float]:
    """Return a window's points: mm along and around from its middle, and deviation, mm."""
    size = np.array(region.mask.shape)
    reach = size / 2 + _MARGIN_MM / np.array(relief.cell_mm)
    along = points.row - (region.row + (size[0] - 1) / 2)
    columns = len(relief.azimuth_rad)
    around = points.column - (region.column + (size[1] - 1) / 2)
    around = around - columns * np.rint(around / columns)
    near = (np.abs(along) <= reach[0]) & (np.abs(around) <= reach[1])
    return along[near] * relief.cell_mm[0], around[near] * relief.cell_mm[1], points.deviation_mm[near]


def _bell(t: Float, x: Float, y: Float) -> Float:
    along = x - t[1]
    q = (along / np.exp(t[3])) ** 2 + ((y - t[2] - t[6] * along) / np.exp(t[4])) ** 2
    return np.asarray(t[0] * np.exp(-((q + 1e-12) ** np.exp(t[5]))))


def _millimetre_mean(t: Float) -> tuple[float, Float]:
    """Return the bell's mean over 1 mm × 1 mm at its top, and its gradient (7,) by the parameters."""
    offset = (np.arange(9) - 4) / 9
    x, y = (g.ravel() for g in np.meshgrid(offset, offset))

    def mean(p: Float) -> float:
        return float(_bell(p, x + p[1], y + p[2]).mean())

    steps = 1e-4 * np.eye(len(t))
    gradient = np.array([(mean(t + d) - mean(t - d)) / 2e-4 for d in steps])
    return mean(t), gradient
