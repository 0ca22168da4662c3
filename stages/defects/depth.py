"""Depth of a defect: the extreme of its 1 mm mean, freed from what noise adds to an extreme."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from pipeline.artefacts import PointCloud
from stages.defects.bell import fit_bell
from stages.defects.fine import DeviationPoints, deviation_points, fine_surface
from stages.defects.relief import Relief
from stages.defects.segment import Region, millimetre_mean

Float = NDArray[np.float64]
Mask = NDArray[np.bool_]

_TRIES = 40
_FEW_RINGS = 5.0
_BELL_CLEAR_MM = 5.0
_BELL_MISFIT = 0.12
_SHARPENING = 0.3  # 1 σ of a peak's curvature correction, relative


@dataclass(frozen=True)
class Depth:
    """Depth (positive into the wall), its 1 σ, and the bias that was taken out, mm."""

    depth_mm: float
    sigma_mm: float
    bias_mm: float


@dataclass(frozen=True)
class Surface:
    """The wall's 1 mm mean, and its noise as the clean wall shows it.

    Attributes
    ----------
    local_mm, all_mm : (S, A)
        1 mm means from the points; as in `Relief`.
    coarse_mm : (S, A)
        1 mm mean of the map's ``all_mm``, which smoothing has flattened.
    clean : (S, A) bool
        Away from all defects.
    scale : float
        Share of noise in the scatter of the clean wall; the rest is its natural roughness.
    points : DeviationPoints
    """

    local_mm: Float
    all_mm: Float
    coarse_mm: Float
    clean: Mask
    scale: float
    points: DeviationPoints

    def draw(self, shape: tuple[int, int], random: np.random.Generator) -> Float:
        """Return a patch (H, W) of the clean wall, cleanest of some tries; its sign is drawn too."""
        rows, columns = self.local_mm.shape
        best, share = np.zeros(shape), -1.0
        for _ in range(_TRIES):
            i = np.arange(shape[0]) + int(random.integers(0, max(1, rows - shape[0] + 1)))
            j = np.arange(shape[1]) + int(random.integers(0, columns))
            at = np.ix_(_reflected(i, rows), j % columns)
            clean = self.clean[at]
            if clean.mean() > share:
                best, share = np.where(clean, self.local_mm[at], 0.0), float(clean.mean())
            if share > 0.98:
                break
        return np.asarray(best * self.scale * (1 if random.random() < 0.5 else -1))


def _reflected(i: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    period = max(1, 2 * count - 2)
    return np.asarray(np.minimum(i % period, period - i % period), np.int64)


def measured_surface(relief: Relief, cloud: PointCloud, regions: tuple[Region, ...]) -> Surface:
    """Return the surface on which depths are read."""
    points = deviation_points(relief, cloud)
    everything = fine_surface(relief, points)
    local = everything + relief.local_mm - relief.all_mm
    clean = np.isfinite(local)
    margin = [round(3.0 / c) for c in relief.cell_mm]
    for region in regions:
        height, width = region.mask.shape
        rows = slice(max(0, region.row - margin[0]), region.row + height + margin[0])
        first, last = region.column - margin[1], region.column + width + margin[1]
        clean[rows, np.arange(first, last) % clean.shape[1]] = False
    coarse = millimetre_mean(relief.all_mm, relief.cell_mm)
    return Surface(local, everything, coarse, clean, _noise_share(relief, local[clean]), points)


def _noise_share(relief: Relief, clean_mm: Float) -> float:
    """Return noise over scatter of the clean wall: what exceeds the roughness that the map shows."""
    roughness = float(np.nanmedian(relief.sigma_mm)) ** 2 - float(np.nanmedian(relief.noise_mm)) ** 2
    scatter = (1.4826 * float(np.median(np.abs(clean_mm)))) ** 2 if clean_mm.size else 0.0
    return float(np.sqrt(np.clip(1 - roughness / scatter, 0.1, 1.0))) if scatter > 0 else 1.0


def measure_depth(
    relief: Relief, region: Region, surface: Surface, draws: int, random: np.random.Generator
) -> Depth:
    """Measure the depth of one region.

    The extreme of a noisy surface exceeds the surface's extreme. By how much, and how it scatters, is found
    by adding noise as the clean wall shows it to the smoothed surface (parametric bootstrap: Efron &
    Tibshirani, An Introduction to the Bootstrap, 1993, ch. 10).
    """
    height = region.sign * region.cut(surface.all_mm if region.all_round else surface.local_mm)
    inside = region.mask & np.isfinite(height)
    height = np.where(inside, height, 0.0)
    peak = np.unravel_index(int(np.argmax(height)), height.shape)
    smooth = gaussian_filter(height, [1.0 / c for c in relief.cell_mm])
    top = float(smooth[inside].max())
    near = inside & (smooth > 0.5 * top)
    drawn = np.array([(smooth + surface.draw(height.shape, random))[near].max() for _ in range(draws)])
    bias = float(drawn.mean()) - top
    depth = float(height[peak]) - bias
    sharpened = float((region.cut(surface.all_mm) - region.cut(surface.coarse_mm))[peak])
    scatter = float(np.linalg.norm([drawn.std(), _SHARPENING * np.nan_to_num(sharpened)]))
    if _is_small(relief, region, surface.points):
        depth, scatter = _between_rings(relief, region, surface.points, depth, scatter)
    return Depth(region.sign * depth, float(np.hypot(scatter, _shape_sigma(relief, depth))), bias)


def _is_small(relief: Relief, region: Region, points: DeviationPoints) -> bool:
    """Tell whether so few rings cross a defect that its deepest place may lie between them.

    Beside a weld the points' deviation is the weld's too, so that no bell is fitted there.
    """
    margin = round(_BELL_CLEAR_MM / relief.cell_mm[0])
    first, last = region.row - margin, region.row + region.mask.shape[0] + margin
    beside = any(first < w.stop and w.start < last for w in relief.welds)
    length = region.mask.shape[0] * relief.cell_mm[0]
    return not region.all_round and not beside and length < _FEW_RINGS * points.spacing_mm


def _between_rings(
    relief: Relief, region: Region, points: DeviationPoints, depth_mm: float, sigma_mm: float
) -> tuple[float, float]:
    """Return depth and 1 σ by a bell, where a bell describes the defect, else what is there already."""
    bell = fit_bell(relief, region, points)
    if bell is None or bell.residual_mm > _BELL_MISFIT * bell.height_mm:
        return depth_mm, sigma_mm
    return bell.height_mm, float(np.hypot(bell.sigma_mm, _SHARPENING * (bell.height_mm - depth_mm)))


def _shape_sigma(relief: Relief, depth_mm: float) -> float:
    """Return 1 σ of the pipe's own shape below the defect: a ring's five harmonics, given its roughness.

    What the defect's own foot takes from them is at most a few per cent of its depth.
    """
    around = 2 * np.pi * relief.radius_mm
    independent = max(1.0, around / 8.0)
    ring = float(np.nanmedian(relief.sigma_mm)) * np.sqrt(5 / independent)
    return float(np.hypot(ring, 0.015 * depth_mm))
