"""Depth of a defect: the extreme of its 1 mm mean, freed from what noise adds to an extreme."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import gaussian_filter

from pipeline.arrays import Float
from stages.defects.bell import fit_bell
from stages.defects.clean import CleanWall
from stages.defects.fine import DeviationPoints
from stages.defects.relief import Relief
from stages.defects.segment import Region
from stages.defects.surface import Surface, cells_of

_FEW_RINGS = 5.0
_BELL_CLEAR_MM = 5.0
_BELL_MISFIT = 0.12
# A bell whose height the points leave open by more than this share of it tells nothing: what the rings
# themselves show is the depth then, and its σ that of a peak between them.
_BELL_UNKNOWN = 0.5
# Rings beside each other are no further apart than this many of their distances; a ring's departure is that
# of the fifth of its samples that depart most, as for what confirms a finding.
_BESIDE, _TOP_QUANTILE, _LEAST_OF_RING = 1.6, 0.8, 3
_SHARPENING = 0.3  # 1 σ of a peak's curvature correction, relative


@dataclass(frozen=True)
class Depth:
    """Depth (positive into the wall), its 1 σ, and the bias that was taken out, mm.

    ``peak`` is the cell of the region's window (row, column) whose deviation is extreme.
    """

    depth_mm: float
    sigma_mm: float
    bias_mm: float
    peak: tuple[int, int]


def measure_depth(
    region: Region, surface: Surface, clean: CleanWall, draws: int, random: np.random.Generator
) -> Depth:
    """Measure the depth of one region.

    The extreme of a noisy surface exceeds the surface's extreme. By how much, and how it scatters, is found
    by adding noise as the clean wall shows it to the smoothed surface (parametric bootstrap: Efron &
    Tibshirani, An Introduction to the Bootstrap, 1993, ch. 10).
    """
    relief = surface.relief
    height = region.sign * region.cut(surface.all_mm if region.all_round else surface.local_mm)
    inside = region.mask & np.isfinite(height)
    height = np.where(inside, height, 0.0)
    peak = np.unravel_index(int(np.argmax(height)), height.shape)
    smooth = gaussian_filter(height, [1.0 / c for c in relief.cell_mm])
    top = float(smooth[inside].max())
    # where points show nothing of what the map shows, the top of a defect may lie below zero
    near = inside & (smooth >= top - 0.5 * abs(top))
    drawn = np.array([(smooth + clean.draw(height.shape, random))[near].max() for _ in range(draws)])
    bias = float(drawn.mean()) - top
    depth = float(height[peak]) - bias
    sharpened = float((region.cut(surface.all_mm) - region.cut(surface.coarse_mm))[peak])
    scatter = float(np.linalg.norm([drawn.std(), _SHARPENING * np.nan_to_num(sharpened)]))
    if _is_small(relief, region, surface.points):
        depth, scatter = _between_rings(relief, region, surface.points, depth, scatter)
    sigma = float(np.hypot(scatter, _shape_sigma(relief, depth)))
    return Depth(region.sign * depth, sigma, bias, (int(peak[0]), int(peak[1])))


def allowed_by_neighbours(depth: Depth, region: Region, surface: Surface) -> Depth:
    """Return the depth, no deeper than the rings beside the deepest one allow, and then as unsure as that.

    A wall seen along a line of sight falls off from ring to ring by no more than their distance (45°, the
    mean flank of a hemisphere): what one ring shows beyond that is no part of the wall that the next one
    shows.
    """
    top, at = _tops_of_rings(depth, region, surface)
    if region.all_round or not len(top):
        return depth
    spacing = surface.points.spacing_mm
    beside = (np.abs(at - at[top.argmax()]) < _BESIDE * spacing) & (np.arange(len(top)) != top.argmax())
    most = max(float(top[beside].max(initial=0.0)), 0.0) + spacing
    if abs(depth.depth_mm) <= most:
        return depth
    sigma = float(np.hypot(depth.sigma_mm, most / 2))
    return replace(depth, depth_mm=float(np.sign(depth.depth_mm)) * most, sigma_mm=sigma)


def _tops_of_rings(depth: Depth, region: Region, surface: Surface) -> tuple[Float, Float]:
    """Return how far every ring about a region departs to the finding's side, and where along the pipe."""
    relief, points = surface.relief, surface.near
    margin = int(np.ceil(2 * surface.points.spacing_mm / relief.cell_mm[0]))
    columns = np.broadcast_to(region.mask.any(0), (len(region.mask) + 2 * margin, region.mask.shape[1]))
    wide = Region(region.row - margin, region.column, columns, region.sign)
    row, column, inside = cells_of(points, relief, wide)
    deviation = np.sign(depth.depth_mm) * (points.radius_mm - relief.shape_at(row, column))
    rings = [inside & (points.frame == k) for k in np.unique(points.frame[inside])]
    rings = [r for r in rings if r.sum() >= _LEAST_OF_RING]
    top = np.array([np.quantile(deviation[r], _TOP_QUANTILE) for r in rings])
    return top, np.array([float(np.mean(points.distance_mm[r])) for r in rings])


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
    if bell.sigma_mm > _BELL_UNKNOWN * bell.height_mm:
        return depth_mm, float(np.hypot(sigma_mm, _SHARPENING * depth_mm))
    return bell.height_mm, float(np.hypot(bell.sigma_mm, _SHARPENING * (bell.height_mm - depth_mm)))


def _shape_sigma(relief: Relief, depth_mm: float) -> float:
    """Return 1 σ of the pipe's own shape below the defect: a ring's five harmonics, given its roughness.

    What the defect's own foot takes from them is at most a few per cent of its depth.
    """
    around = 2 * np.pi * relief.radius_mm
    independent = max(1.0, around / 8.0)
    ring = relief.typical.sigma_mm * np.sqrt(5 / independent)
    return float(np.hypot(ring, 0.015 * depth_mm))
