"""What goes all round the pipe: a bead or groove, or a step of the bore, told by its median round the pipe.

A glint or a pit on a bead stands out farther than the bead, but it lies on less than half of any circle of
it, so that medians round the pipe do not see it. It is found on the bead as a finding of its own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from pipeline.adjustment.robust import row_median, spread_about_median
from pipeline.arrays import Float
from pipeline.artefacts.measured import RadiusMap
from stages.defects.clean import CleanWall
from stages.defects.depth import Depth, noise_gain, shape_sigma, sharpening_sigma
from stages.defects.segment import Region
from stages.defects.surface import Surface

IS_STEP = "The bore is of one width before it and of another behind it: it is a step, no bead or groove"
# The bore beside a finding is looked at over a tenth of the diameter: a step is smeared over as much.
_BESIDE, _ALL_ROUND = 0.2, 0.9
# A bead stands out of the bore on both sides by all of its height, a step out of one of them by nothing: half
# is the middle between the two.
_BETWEEN = 0.5
# By how many of its standard deviations round the pipe a bead's crest exceeds its median, ± 1 σ: a sine's by
# √2, the highest of 80 independent places by 2.4. So many of 2 mm go round a pipe of 50 mm: the width of a
# ring's samples and a depth's 1 mm mean leave so much alike.
_CREST, _CREST_SIGMA, _PLACE_MM = 2.0, 0.5, 2.0
# 1 σ of the median of n normal values, and of a spread by their median deviation, times √n.
_MEDIAN_ERRS, _SPREAD_ERRS = 1.25, 1.17
_EXACT_MM = 1e-6


@dataclass(frozen=True)
class Bore:
    """How far a finding's median round the pipe stands out of the bore before and behind it (2,), mm.

    ``sigma_mm`` is by how much such medians scatter from row to row of the bore where they do less:
    the foot of a step adds to it on the other. NaN where nothing was seen.
    """

    out_mm: Float
    sigma_mm: float

    def chance_of_bead(self, min_depth_mm: float) -> float:
        """Return the probability that it stands out of both sides, as a bead does and no step."""
        if not np.isfinite(self.out_mm).all():
            return 1.0
        limit = max(_BETWEEN * float(self.out_mm.mean()), min_depth_mm / 2)
        sigma = max(np.sqrt(2) * self.sigma_mm, _EXACT_MM)
        return round(float(ndtr((self.out_mm.min() - limit) / sigma)), 4)


def goes_round(region: Region, radius_map: RadiusMap) -> bool:
    """Return whether a region goes round so much of the pipe that it may be a step of the bore."""
    return bool(region.mask.any(0).sum() >= _ALL_ROUND * radius_map.radius_mm.shape[1])


def bore_beside(region: Region, radius_map: RadiusMap) -> Bore:
    """Return how a region that goes round the pipe stands out of the bore beside it."""
    radius_mm, s = radius_map.radius_mm, radius_map.distance_mm
    first, end = region.row, region.row + len(region.mask)
    reach = max(round(_BESIDE * float(np.nanmedian(radius_mm[first:end])) / float(s[1] - s[0])), 1)
    rows = (slice(max(first - reach, 0), first), slice(first, end), slice(end, end + reach))
    before, inside, behind = (region.sign * row_median(radius_mm[r]) for r in rows)
    out_mm = np.fmax.reduce(inside) - np.array([_level(before), _level(behind)])
    return Bore(out_mm, float(np.nan_to_num(np.fmin(_scatter(before), _scatter(behind)))))


def _level(profile_mm: Float) -> float:
    seen = profile_mm[np.isfinite(profile_mm)]
    return float(np.median(seen)) if seen.size else float("nan")


def _scatter(profile_mm: Float) -> float:
    """Return by how much a profile (n,) scatters about a straight line, NaN where at most two are seen.

    The line is that of the median slope (Theil 1950, Sen 1968), which the foot of a step does not turn.
    """
    at = np.flatnonzero(np.isfinite(profile_mm))
    if len(at) < 3:
        return float("nan")
    one, other = np.triu_indices(len(at), 1)
    slope = np.median((profile_mm[at[other]] - profile_mm[at[one]]) / (at[other] - at[one]))
    return spread_about_median(profile_mm[at] - slope * at)


def measure_all_round(region: Region, surface: Surface, clean: CleanWall, bore: Bore) -> Depth:
    """Return the depth of what goes all round: its largest median round the pipe, and its crest beyond.

    The crest follows from by how much more the height varies round the pipe than noise makes it. ``region``
    counts its rows from the first of the surface.
    """
    relief = surface.relief
    height = np.where(region.mask, region.sign * region.cut(surface.all_mm), np.nan)
    level = row_median(height)
    row = int(np.nanargmax(level))
    places = max(2 * np.pi * relief.radius_mm / _PLACE_MM, 1.0)
    spread = spread_about_median(height[row][np.isfinite(height[row])])
    noise = clean.noise_mm * float(np.nanmedian(noise_gain(region, relief)[row]))
    crest, crest_sigma = _crest(spread, noise, places)
    depth = float(level[row]) + crest
    flattened = row_median(region.cut(surface.all_mm - surface.coarse_mm))[row]
    sigma = [
        bore.sigma_mm,
        _MEDIAN_ERRS * spread / np.sqrt(places),
        crest_sigma,
        sharpening_sigma(float(flattened)),
        shape_sigma(relief, region, depth, surface.points.spacing_mm),
    ]
    peak = row, int(np.nanargmin(np.abs(height[row] - depth)))
    return Depth(region.sign * depth, float(np.linalg.norm(sigma)), 0.0, peak)


def _crest(spread_mm: float, noise_mm: float, places: float) -> tuple[float, float]:
    """Return by how much a crest exceeds the median round the pipe, and its 1 σ, mm."""
    varies2 = max(spread_mm**2 - noise_mm**2, 0.0)
    # Both squares err by twice the relative error of a spread.
    errs2 = 2 * _SPREAD_ERRS / np.sqrt(places) * np.hypot(spread_mm**2, noise_mm**2)
    varies = np.sqrt(varies2)
    unsure = np.sqrt(varies2 + errs2) - varies
    return float(_CREST * varies), float(np.hypot(_CREST_SIGMA * varies, _CREST * unsure))
