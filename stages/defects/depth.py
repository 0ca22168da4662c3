"""Depth of a defect: the extreme of its 1 mm mean, freed from what noise adds to an extreme."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from stages.defects.relief import Relief
from stages.defects.segment import Region, millimetre_mean

Float = NDArray[np.float64]
Mask = NDArray[np.bool_]

_TRIES = 40


@dataclass(frozen=True)
class Depth:
    """Depth (positive into the wall), its 1 σ, and the bias that was taken out, mm."""

    depth_mm: float
    sigma_mm: float
    bias_mm: float


@dataclass(frozen=True)
class NoiseField:
    """Where noise is drawn from: the 1 mm mean of the clean wall, scaled to the stated noise."""

    smooth_mm: Float
    clean: Mask
    scale: float

    def draw(self, shape: tuple[int, int], random: np.random.Generator) -> Float:
        """Return a patch (H, W) of the clean wall, cleanest of some tries; its sign is drawn too."""
        rows, columns = self.smooth_mm.shape
        best, share = np.zeros(shape), -1.0
        for _ in range(_TRIES):
            i = np.arange(shape[0]) + int(random.integers(0, max(1, rows - shape[0] + 1)))
            j = np.arange(shape[1]) + int(random.integers(0, columns))
            at = np.ix_(_reflected(i, rows), j % columns)
            clean = self.clean[at]
            if clean.mean() > share:
                best, share = np.where(clean, self.smooth_mm[at], 0.0), float(clean.mean())
            if share > 0.98:
                break
        return np.asarray(best * self.scale * (1 if random.random() < 0.5 else -1))


def _reflected(i: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    period = max(1, 2 * count - 2)
    return np.asarray(np.minimum(i % period, period - i % period), np.int64)


def noise_field(relief: Relief, regions: tuple[Region, ...]) -> NoiseField:
    """Return the noise of the 1 mm mean as the wall itself shows it, outside all regions."""
    smooth = millimetre_mean(relief.local_mm, relief.cell_mm)
    clean = np.isfinite(smooth)
    margin = [round(3.0 / c) for c in relief.cell_mm]
    for region in regions:
        height, width = region.mask.shape
        rows = slice(max(0, region.row - margin[0]), region.row + height + margin[0])
        first, last = region.column - margin[1], region.column + width + margin[1]
        clean[rows, np.arange(first, last) % clean.shape[1]] = False
    total = float(np.nanmedian(relief.sigma_mm))
    noise = float(np.nanmedian(relief.noise_mm))
    return NoiseField(smooth, clean, float(np.clip(noise / max(total, 1e-9), 0.1, 1.0)))


def measure_depth(
    relief: Relief, region: Region, noise: NoiseField, draws: int, random: np.random.Generator
) -> Depth:
    """Measure the depth of one region.

    The extreme of a noisy surface exceeds the surface's extreme. By how much, and how it scatters, is found
    by adding noise as the clean wall shows it to the smoothed surface (parametric bootstrap: Efron &
    Tibshirani, An Introduction to the Bootstrap, 1993, ch. 10).
    """
    source = relief.all_mm if region.all_round else relief.local_mm
    surface = region.sign * region.cut(millimetre_mean(source, relief.cell_mm))
    inside = region.mask & np.isfinite(surface)
    surface = np.where(inside, surface, 0.0)
    found = float(surface.max())
    smooth = gaussian_filter(surface, [1.0 / c for c in relief.cell_mm])
    top = float(smooth[inside].max())
    near = inside & (smooth > 0.5 * top)
    drawn = np.array([(smooth + noise.draw(surface.shape, random))[near].max() for _ in range(draws)])
    bias, scatter = float(drawn.mean()) - top, float(drawn.std())
    depth = found - bias
    sigma = float(np.hypot(scatter, _shape_sigma(relief, depth)))
    return Depth(region.sign * depth, sigma, bias)


def _shape_sigma(relief: Relief, depth_mm: float) -> float:
    """Return 1 σ of the pipe's own shape below the defect: a ring's five harmonics, given its roughness.

    What the defect's own foot takes from them is at most a few per cent of its depth.
    """
    around = 2 * np.pi * relief.radius_mm
    independent = max(1.0, around / 8.0)
    ring = float(np.nanmedian(relief.sigma_mm)) * np.sqrt(5 / independent)
    return float(np.hypot(ring, 0.015 * depth_mm))
