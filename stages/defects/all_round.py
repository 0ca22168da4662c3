"""Beads, grooves and steps of the bore that go all round the pipe, measured by medians round the pipe.

A glint or a pit on a bead stands out farther than the bead, but it covers less than half of any circle of it,
so that it does not move the median round the pipe. It is found as a separate finding on the bead.
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

IS_STEP = (
    "The bore has one diameter before it and another behind it: it is a step of the bore, no bead or groove"
)
MAY_BE_STEP = "It may also be a step of the bore: too little of the bore was seen before it or behind it"
# The bore beside a finding is its first 0.2 radii on either side: a step is smeared over about that length. A
# region goes all round if it has cells in nine of ten columns of the map.
_BESIDE, _ALL_ROUND = 0.2, 0.9
# A bead stands out of the bore on both sides by its full height, a step does so on one side only: the limit
# is half-way between the two.
_BETWEEN = 0.5
_BEAD_OR_STEP = 0.5  # prior probability of a bead, where the bore beside it was not seen
# The crest of a bead is higher than the 90 % quantile of its heights round the pipe; the few per cent above
# that quantile may be glints. How much higher follows from the 75 % quantile: the ratio (90 % − 75 %) / (90 %
# − 50 %) is _TAILS, and (crest − 50 %) / (90 % − 50 %) is _CRESTS, for a bead that is high on one half and
# low on the other, for a sine, and for 80 normal values. Other shapes err by 1 σ of _CREST_SIGMA (chosen). A
# normal value's 90 % quantile is 1.28 σ.
_HIGH, _LOWER, _HIGH_SIGMAS = 0.9, 0.75, 1.28
_TAILS, _CRESTS, _CREST_SIGMA = (0.0, 0.257, 0.474), (1.0, 1.05, 1.87), 0.25
# Heights 2 mm apart round the pipe count as independent: the width of a ring's sample and the 1 mm mean of a
# depth correlate closer ones. A row of the map is used where at least half of it was seen.
PLACE_MM, _SEEN = 2.0, 0.5
# For n normal values: 1 σ of their median times √n, and the relative 1 σ of their 90 % quantile's distance
# from the median times √n.
MEDIAN_ERRS, _HIGH_ERRS = 1.25, 1.33
_EXACT_MM = 1e-6  # keeps divisions defined where nothing scatters


@dataclass(frozen=True)
class Bore:
    """By how much a finding's median round the pipe stands out of the bore beside it, mm.

    Attributes
    ----------
    out_mm : (2,)
        Height over the bore before and behind it; NaN where that side was not seen.
    sigma_mm : float
        1 σ of such medians: their scatter from row to row on the steadier side, since the foot of a step adds
        scatter on the other; at least the scatter of the rings' medians over the whole wall.
    """

    out_mm: Float
    sigma_mm: float

    def chance_of_bead(self, min_depth_mm: float) -> float:
        """Return the probability that it stands out of the bore on both sides: a bead does, a step does not.

        A side that was not seen is as likely that of a bead as that of a step. What lies between bores of
        equal diameter is no step, even if its median stands out on neither side: a helical groove is an
        example.
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
    """Return whether a region covers enough of the circumference to be a possible step of the bore."""
    return bool(region.mask.any(0).sum() >= _ALL_ROUND * radius_map.radius_mm.shape[1])


def bore_beside(region: Region, radius_map: RadiusMap, rings_mm: float) -> Bore:
    """Return by how much a region that goes round the pipe stands out of the bore on either side.

    ``rings_mm`` is the scatter of the medians of single rings, 1 σ: rows of the map, interpolated between
    rings, scatter less.
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
    """Return by how much a profile (n,) scatters about a straight line; NaN with fewer than three values.

    The line has the median of all slopes (Theil 1950, Sen 1968), which the foot of a step does not tilt.
    """
    at = np.flatnonzero(np.isfinite(profile_mm))
    if len(at) < 3:
        return float("nan")
    one, other = np.triu_indices(len(at), 1)
    slope = np.median((profile_mm[at[other]] - profile_mm[at[one]]) / (at[other] - at[one]))
    return spread_about_median(profile_mm[at] - slope * at)


def measure_all_round(region: Region, surface: Surface, clean: CleanWall, bore: Bore) -> Depth:
    """Return the depth of a region that goes all round: largest median round the pipe plus crest above it.

    The crest follows from how much the height varies round the pipe beyond noise. The rows of ``region``
    count from the first row of the surface.
    """
    relief = surface.relief
    height = np.where(region.mask, region.sign * region.cut(surface.all_mm), np.nan)
    row = _highest_row(height)
    seen = height[row][np.isfinite(height[row])]
    places = max(2 * np.pi * relief.radius_mm / PLACE_MM * len(seen) / len(height[row]), 1.0)
    noise = clean.noise_mm * float(np.nanmedian(noise_gain(region, relief)[row]))
    level, crest, crest_sigma = _crest(seen, noise, places)
    depth = level + crest
    flattened = row_median(region.cut(surface.all_mm - surface.coarse_mm))[row]
    sigma = [
        bore.sigma_mm,
        MEDIAN_ERRS * spread_about_median(seen) / np.sqrt(places),
        crest_sigma,
        sharpening_sigma(float(flattened)),
        shape_sigma(relief, region, depth, surface.points.spacing_mm),
    ]
    peak = row, int(np.nanargmin(np.abs(height[row] - depth)))
    return Depth(region.sign * depth, float(np.linalg.norm(sigma)), 0.0, peak)


def _highest_row(height: Float) -> int:
    """Return the row of heights (H, A) with the largest 90 % quantile, among rows that were seen well."""
    share = np.isfinite(height).mean(1)
    rows = np.flatnonzero(share >= min(_SEEN, float(share.max())))
    return int(rows[np.argmax(np.nanquantile(height[rows], _HIGH, 1))])


def _crest(height: Float, noise_mm: float, places: float) -> tuple[float, float, float]:
    """Return the median of heights (n,) round the pipe, by how much the crest exceeds it, and its 1 σ, mm."""
    level, lower, high = np.quantile(height, (0.5, _LOWER, _HIGH))
    out2, noise2 = (high - level) ** 2, (_HIGH_SIGMAS * noise_mm) ** 2
    varies2 = max(out2 - noise2, 0.0)
    varies = np.sqrt(varies2)
    # The relative error of a square is twice that of its quantile.
    unsure = np.sqrt(varies2 + 2 * _HIGH_ERRS / np.sqrt(places) * np.hypot(out2, noise2)) - varies
    beyond = float(np.interp((high - lower) / max(high - level, _EXACT_MM), _TAILS, _CRESTS))
    sigma = float(np.hypot(_CREST_SIGMA * varies, beyond * unsure))
    return float(level), float(beyond * varies), sigma
