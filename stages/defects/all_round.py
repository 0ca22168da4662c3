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
MAY_BE_STEP = "It may as well be a step: too little of the bore was seen before it or behind it"
# The bore beside a finding is looked at over a tenth of the diameter: a step is smeared over as much.
_BESIDE, _ALL_ROUND = 0.2, 0.9
# A bead stands out of the bore on both sides by all of its height, a step out of one of them by nothing: half
# is the middle between the two.
_BETWEEN = 0.5
_BEAD_OR_STEP = 0.5  # where nothing tells
# A bead's crest lies beyond the height below which nine tenths of it stay; above are the few per cent that
# are glints, too. By how much follows from how far that height is above the one of three quarters, both over
# its distance from the median: so for two heights by halves, a sine, and 80 normal values. ± 1 σ (chosen) for
# what is like none of them.
_HIGH, _LOWER, _HIGH_SIGMAS = 0.9, 0.75, 1.28
_TAILS, _CRESTS, _CREST_SIGMA = (0.0, 0.257, 0.474), (1.0, 1.05, 1.87), 0.25
# So many places of 2 mm are independent: the width of a ring's samples and a depth's 1 mm mean leave so much
# alike. A row counts where half of it was seen.
_PLACE_MM, _SEEN = 2.0, 0.5
# 1 σ of n normal values' median times √n, and of their 90 % quantile over its distance from the median.
_MEDIAN_ERRS, _HIGH_ERRS = 1.25, 1.33
_EXACT_MM = 1e-6


@dataclass(frozen=True)
class Bore:
    """How far a finding's median round the pipe stands out of the bore before and behind it (2,), mm.

    ``sigma_mm`` is by how much such medians scatter from row to row of the bore where they do less, as the
    foot of a step adds to it on the other; by at least what those of rings do all over the wall. NaN where
    nothing was seen.
    """

    out_mm: Float
    sigma_mm: float

    def chance_of_bead(self, min_depth_mm: float) -> float:
        """Return the probability that it stands out of both sides, as a bead does and no step.

        Out of one that was not seen it does so or not, as a bead or a step that the view ends in. What lies
        between bores of one width is no step, though its median stand out of neither: a helical groove.
        """
        seen = self.out_mm[np.isfinite(self.out_mm)]
        if not len(seen):
            return _BEAD_OR_STEP
        limit = max(_BETWEEN * float(seen.mean()), min_depth_mm / 2)
        sigma = max(np.sqrt(2) * self.sigma_mm, _EXACT_MM)
        chance = float(ndtr((seen.min() - limit) / sigma))
        if len(seen) == 1:
            return round(_BEAD_OR_STEP * chance, 4)
        two_widths = float(ndtr((np.ptp(seen) - min_depth_mm / 2) / sigma))
        return round(1 - (1 - chance) * two_widths, 4)


def goes_round(region: Region, radius_map: RadiusMap) -> bool:
    """Return whether a region goes round so much of the pipe that it may be a step of the bore."""
    return bool(region.mask.any(0).sum() >= _ALL_ROUND * radius_map.radius_mm.shape[1])


def bore_beside(region: Region, radius_map: RadiusMap, rings_mm: float) -> Bore:
    """Return how a region that goes round the pipe stands out of the bore beside it.

    ``rings_mm`` is by how much rings' medians scatter: between rings, rows of the map scatter less.
    """
    radius_mm, s = radius_map.radius_mm, radius_map.distance_mm
    first, end = region.row, region.row + len(region.mask)
    reach = max(round(_BESIDE * float(np.nanmedian(radius_mm[first:end])) / float(s[1] - s[0])), 1)
    rows = (slice(max(first - reach, 0), first), slice(first, end), slice(end, end + reach))
    before, inside, behind = (region.sign * row_median(radius_mm[r]) for r in rows)
    out_mm = np.fmax.reduce(inside) - np.array([_level(before), _level(behind)])
    return Bore(out_mm, float(np.fmax(np.fmin(_scatter(before), _scatter(behind)), rings_mm)))


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
    row = _highest_row(height)
    seen = height[row][np.isfinite(height[row])]
    places = max(2 * np.pi * relief.radius_mm / _PLACE_MM * len(seen) / len(height[row]), 1.0)
    noise = clean.noise_mm * float(np.nanmedian(noise_gain(region, relief)[row]))
    level, crest, crest_sigma = _crest(seen, noise, places)
    depth = level + crest
    flattened = row_median(region.cut(surface.all_mm - surface.coarse_mm))[row]
    sigma = [
        bore.sigma_mm,
        _MEDIAN_ERRS * spread_about_median(seen) / np.sqrt(places),
        crest_sigma,
        sharpening_sigma(float(flattened)),
        shape_sigma(relief, region, depth, surface.points.spacing_mm),
    ]
    peak = row, int(np.nanargmin(np.abs(height[row] - depth)))
    return Depth(region.sign * depth, float(np.linalg.norm(sigma)), 0.0, peak)


def _highest_row(height: Float) -> int:
    """Return the row of a height (H, A) of which nine tenths stay below the most, of those well seen."""
    share = np.isfinite(height).mean(1)
    rows = np.flatnonzero(share >= min(_SEEN, float(share.max())))
    return int(rows[np.argmax(np.nanquantile(height[rows], _HIGH, 1))])


def _crest(height: Float, noise_mm: float, places: float) -> tuple[float, float, float]:
    """Return a height's (n,) median round the pipe, by how much its crest exceeds it, and its 1 σ, mm."""
    level, lower, high = np.quantile(height, (0.5, _LOWER, _HIGH))
    out2, noise2 = (high - level) ** 2, (_HIGH_SIGMAS * noise_mm) ** 2
    varies2 = max(out2 - noise2, 0.0)
    varies = np.sqrt(varies2)
    # Both squares err by twice the relative error of a quantile.
    unsure = np.sqrt(varies2 + 2 * _HIGH_ERRS / np.sqrt(places) * np.hypot(out2, noise2)) - varies
    beyond = float(np.interp((high - lower) / max(high - level, _EXACT_MM), _TAILS, _CRESTS))
    sigma = float(np.hypot(_CREST_SIGMA * varies, beyond * unsure))
    return float(level), float(beyond * varies), sigma
