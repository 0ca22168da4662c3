"""Measures the growth of a defect in the same way on both walls, with its σ."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter, shift

from pipeline.arrays import Bool, Float
from pipeline.artefacts.comparison import Growth, Value
from stages.compare.patch import Patch, at_its_peak, smoothed

# Where one wall is no deeper than this share of the other, it shows no defect of its own.
_ALIKE = 0.5
# Extents are read at half the lesser depth, as a full width at half maximum.
_LEVEL = 0.5
# 1 σ of the smoothing that makes a noise-free model of the defect, to which clean wall is then added.
_BASE_MM = 1.0
# From so many pieces of clean wall on the defect's own rings, their scatter counts where it is larger.
_LEAST_OWN = 8


@dataclass(frozen=True)
class Resolution:
    """Resolution of the maps: 1 σ of their own smoothing along and around, and calibration of heights.

    Attributes
    ----------
    along_mm, around_mm : float
    relative : float
        1 σ of the radius from calibration over the radius.
    is_common : bool
        Whether both runs share that calibration, so that it acts on the growth alone.
    displaced_mm : float
        1 σ of the growth from what displaces the picture smoothly in either run.
    """

    along_mm: float
    around_mm: float
    relative: float
    is_common: bool
    displaced_mm: float = 0.0


def measure_growth(
    patch: Patch, sign: int, resolution: Resolution, place_sigma_mm: tuple[float, float]
) -> Growth:
    """Return a defect's growth; ``sign`` is +1 for one that goes into the wall, −1 for one inward.

    A defect that only one wall shows is measured on the other wall at the place of its peak, because the
    extreme of mere noise is no depth. The maps' resolution flattens a peak; this is estimated by smoothing
    once more, and the whole correction counts as its own 1 σ. Noise is estimated by the same measurement on
    pieces of clean wall; the σ of registration and calibration are added to it.
    """
    now, before = sign * patch.now_mm, sign * patch.before_mm
    extremes = [float(h[patch.inside].max()) for h in (now, before)]
    in_both = min(extremes) > _ALIKE * max(extremes)
    peaks = _peaks(now, before, patch.inside, in_both)
    lost = _lost_of_both(now, before, peaks, patch, resolution, in_both)
    depth = [h[p] + part for h, p, part in zip((now, before), peaks, lost, strict=True)]
    level = _LEVEL * max(min(depth) if in_both else max(depth), 1e-6)
    size = _size(now, patch, level, peaks[0]) - _size(before, patch, level, peaks[1])
    spread = _spread(now, before, patch, level, in_both)
    placed = _misplaced(before, peaks, patch, place_sigma_mm, in_both)
    growth = depth[0] - depth[1]
    calibration = resolution.relative * (
        abs(growth) if resolution.is_common else float(np.linalg.norm(depth))
    )
    sigma = float(np.linalg.norm([spread[0], *lost, placed, calibration, resolution.displaced_mm]))
    edge = np.array(patch.cell_mm) / np.sqrt(6)
    length, width = (Value(float(size[k]), float(np.hypot(spread[k + 1], edge[k]))) for k in (0, 1))
    cell = patch.cell_mm[0] * patch.cell_mm[1]
    area = Value(float(size[2]), float(np.hypot(spread[3], cell)))
    return Growth(
        sign * float(depth[0]),
        sign * float(depth[1]),
        Value(sign * float(growth), sigma),
        length,
        width,
        area,
        level,
    )


def _peaks(now: Float, before: Float, inside: Bool, in_both: bool) -> list[tuple[int, int]]:
    """Return the cell of each wall's extreme; a wall without a defect of its own gets that of the other."""
    own = [_argmax(h, inside) for h in (now, before)]
    if in_both:
        return own
    deeper = own[0] if now[own[0]] >= before[own[1]] else own[1]
    return [deeper, deeper]


def _argmax(height: Float, inside: Bool) -> tuple[int, int]:
    r, c = np.unravel_index(int(np.argmax(np.where(inside, height, -np.inf))), height.shape)
    return int(r), int(c)


def _lost_of_both(
    now: Float,
    before: Float,
    peaks: list[tuple[int, int]],
    patch: Patch,
    resolution: Resolution,
    in_both: bool,
) -> Float:
    """Return the loss (2,), mm, of each wall's peak by the maps' resolution; 0 on a wall without a peak."""
    lost = np.array([_lost(h, p, patch, resolution) for h, p in zip((now, before), peaks, strict=True)])
    has_peak = in_both or np.array([now[peaks[0]] >= before[peaks[1]], now[peaks[0]] < before[peaks[1]]])
    return np.where(has_peak, lost, 0.0)


def _lost(height: Float, peak: tuple[int, int], patch: Patch, resolution: Resolution) -> float:
    """Return the loss of a peak, mm, when the map is smoothed a second time with its own kernel."""
    kernel = [s / c for s, c in zip((resolution.along_mm, resolution.around_mm), patch.cell_mm, strict=True)]
    reach = [int(np.ceil(4 * k)) + 1 for k in kernel]
    near = tuple(slice(max(p - r, 0), p + r + 1) for p, r in zip(peak, reach, strict=True))
    at = tuple(min(p, r) for p, r in zip(peak, reach, strict=True))
    return float(max(height[peak] - gaussian_filter(height[near], kernel)[at], 0.0))


def _size(height: Float, patch: Patch, level: float, peak: tuple[int, int]) -> Float:
    """Return length, width and area of the part beyond a level around a peak."""
    part = at_its_peak((height > level) & patch.inside, peak)
    if not part.any():
        return np.zeros(3)
    extent = [_extent(height.max(axis=1 - k, where=part, initial=0.0), level) for k in (0, 1)]
    cell = np.array(patch.cell_mm)
    return np.array([*(extent * cell), part.sum() * cell.prod()])


def _extent(profile: Float, level: float) -> float:
    """Return the number of cells from the first to the last at which a profile is beyond a level.

    The profile is 0 outside the connected part.
    """
    at = np.flatnonzero(profile > level)
    return float(at[-1] - at[0] + 1)


def _spread(now: Float, before: Float, patch: Patch, level: float, in_both: bool) -> Float:
    """Return 1 σ of the growth of depth, length, width and area if the walls differ as clean wall does."""
    base = smoothed((now + before) / 2 if in_both else np.maximum(now, before), patch.cell_mm, _BASE_MM)
    at = _argmax(base, patch.inside)
    without = np.array([base[at], *_size(base, patch, level, at)])
    drawn = []
    for piece in patch.noise_mm:
        other = base + piece
        peak = _argmax(other, patch.inside) if in_both else at
        # an extreme over several cells scatters less than any one cell; the larger value is used
        drawn.append(np.array([other[at], *_size(other, patch, level, peak)]) - without)
    errors = np.array(drawn)
    spread = np.sqrt((errors**2).mean(0))
    if patch.own_pieces < _LEAST_OWN:
        return np.asarray(spread)
    return np.asarray(np.maximum(spread, np.sqrt((errors[: patch.own_pieces] ** 2).mean(0))))


def _misplaced(
    before: Float, peaks: list[tuple[int, int]], patch: Patch, sigma_mm: tuple[float, float], in_both: bool
) -> float:
    """Return the 1 σ of the earlier reading that the 1 σ of the registration causes."""
    changes = []
    for axis in (0, 1):
        move = [0.0, 0.0]
        move[axis] = sigma_mm[axis] / patch.cell_mm[axis]
        moved = shift(before, move, order=1, mode="nearest")
        peak = _argmax(moved, patch.inside) if in_both else peaks[1]
        changes.append(float(moved[peak] - before[peaks[1]]))
    return float(np.linalg.norm(changes))
