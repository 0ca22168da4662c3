"""Strip registration: decides whether two unrolled strips show the same wall, and measures its shift.

First all shifts within reach are tried at half resolution by normalised correlation of the samples usable in
both (D. Padfield, "Masked object registration in the Fourier domain", 2012); then patches are matched one by
one. The wall is the same if most patches are found with the same shift, and no other shift fits nearly as
well.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum

import numpy as np

from pipeline.adjustment.robust import robust_spread
from pipeline.arrays import Bool, Float, Int
from stages.motion.parameters import MotionParameters
from stages.motion.tracking.overlap import MOST_RIVAL, Overlap, StoredStrip
from stages.motion.tracking.patches import cornerness, cut, whole_patches
from stages.motion.tracking.strips import Strip

# The limits below rejected all of 422 wrong pairs of equal welds at equal spacing and accepted 77 of 77 right
# ones (`python -m tests.benchmarks.bench_loops OUT`); their margins were not measured.
_FEWEST_PATCHES = 30
"""Patches that must be found, or else there is too little texture."""
_FEWEST_AGREE = 0.5
"""Share of the searched patches that must be found with the same shift."""
_AGREEING_PX = 1.5
"""Difference, strip samples, up to which shifts of patches count as the same; as in tracking."""
_LEAN_PX = 3.0
"""1 σ, strip samples, of the part of the shift that varies once around the pipe: an error of 0.5 mm of the
camera's position across the pipe, at 0.22 mm per sample, makes 2.3."""
_BEYOND = 3
"""Number of patch sizes beyond the reach that are tried too, to find out whether the wall repeats itself."""
_LEAST_SIGMA_PX = 0.05
"""Smallest 1 σ, strip samples, of a shift: matching has a common error for all patches of a strip."""
_LEAST_SPREAD_PX = 0.02
"""Smallest spread, strip samples, of the shifts of patches."""
_ROUNDS = 8
"""Reweighted fits of the common shift."""


class Verdict(Enum):
    """The outcome of registering two strips; the value is its text in the report."""

    SAME = "the same wall"
    PLAIN = "too little texture"
    REPEATED = "the wall looks the same elsewhere too"
    OTHER = "the wall is not recognised"
    UNREADABLE = "a frame could not be read"
    CONTRADICTED = "contradicted by the motion or by other places"


@dataclass(frozen=True)
class Registration:
    """Result of registering a strip.

    Attributes
    ----------
    verdict : Verdict
    shift : (2,)
        Rows and columns by which the wall lies farther in the later strip.
    sigma : (2,)
        1 σ of the shift.
    """

    verdict: Verdict
    shift: Float
    sigma: Float

    @staticmethod
    def refused(verdict: Verdict) -> Registration:
        """Return a registration without a shift."""
        return Registration(verdict, np.full(2, np.nan), np.full(2, np.nan))


@dataclass(frozen=True)
class _Peak:
    """A shift (2,) of an earlier strip at which it correlates well."""

    earlier: StoredStrip
    shift: Float
    height: float


@dataclass(frozen=True)
class ExpectedShift:
    """Predicted shift of the wall in the later strip.

    Attributes
    ----------
    shift : (2,)
        Rows and columns.
    reach : (2,)
        Largest difference from the prediction.
    """

    shift: Float
    reach: Float

    def allows(self, shift: Float) -> bool:
        """Whether a shift (2,) is within reach."""
        return bool(np.all(np.abs(shift - self.shift) <= self.reach))


def register(
    earlier: Iterable[StoredStrip], later: Strip, expected: ExpectedShift, parameters: MotionParameters
) -> Registration:
    """Register a strip with earlier ones of the same place.

    Shifts a little beyond the reach are tried too: a repetition in the wall must not be taken for the same
    wall.
    """
    row, column = _corners(later, parameters)
    if len(row) < _FEWEST_PATCHES:
        return Registration.refused(Verdict.PLAIN)
    peaks = [p for strip in earlier for p in _peaks(strip, StoredStrip.of(later), expected, parameters)]
    inside = [p for p in peaks if expected.allows(p.shift)]
    if not inside:
        return Registration.refused(Verdict.OTHER)
    best = max(inside, key=lambda p: p.height)
    found = _matched(best, later, row, column, parameters)
    if found.verdict is not Verdict.SAME:
        return found
    apart = 2 * parameters.patch_half_px
    rivals = [p.height for p in peaks if np.max(np.abs(p.shift - best.shift)) > apart]
    if max(rivals, default=0.0) > MOST_RIVAL * best.height:
        return Registration.refused(Verdict.REPEATED)
    return found


def _peaks(
    earlier: StoredStrip, later: StoredStrip, expected: ExpectedShift, parameters: MotionParameters
) -> list[_Peak]:
    """Return the best shift within reach, and the best one elsewhere."""
    overlap = Overlap.of(earlier, later)
    height, shift_row, shift_column = overlap.height, overlap.row, overlap.column
    off = [np.abs(s - e) for s, e in zip((shift_row, shift_column), expected.shift, strict=True)]
    beyond = expected.reach + _BEYOND * (2 * parameters.patch_half_px + 1)
    height = np.where((off[0] <= beyond[0]) & (off[1] <= beyond[1]), height, -1.0)
    inside = (off[0] <= expected.reach[0]) & (off[1] <= expected.reach[1])
    found: list[_Peak] = []
    for allowed in (inside, np.ones_like(inside)):
        for other in found:
            apart = np.maximum(np.abs(shift_row - other.shift[0]), np.abs(shift_column - other.shift[1]))
            allowed = allowed & (apart > 2 * parameters.patch_half_px)
        r, c = np.unravel_index(int(np.argmax(np.where(allowed, height, -1.0))), height.shape)
        if allowed[r, c] and height[r, c] > 0:
            at = np.array([shift_row[r, 0], shift_column[0, c]], float)
            found.append(_Peak(earlier, at, float(height[r, c])))
    return found


def _corners(strip: Strip, parameters: MotionParameters) -> tuple[Int, Int]:
    """Return rows and columns of the best corner of every cell that can be matched well enough."""
    half, cell = parameters.patch_half_px, parameters.cell_px
    corner = cornerness(strip.contrast, strip.usable, half, slice(0, len(strip.contrast)))
    rows, columns = (n // cell for n in corner.shape)
    cells = corner[: rows * cell, : columns * cell].reshape(rows, cell, columns, cell)
    block = cells.transpose(0, 2, 1, 3).reshape(rows, columns, -1)
    at, best = block.argmax(-1), block.max(-1)
    i, j = np.nonzero(best > 0)
    row, column = i * cell + at[i, j] // cell, j * cell + at[i, j] % cell
    patches = cut(strip.contrast, row, column, half)
    good = strip.noise[row] * patches.sigma_per_noise < parameters.landmark_sigma_px
    return row[good], column[good]


def _matched(peak: _Peak, later: Strip, row: Int, column: Int, parameters: MotionParameters) -> Registration:
    """Match the later strip's corners one by one in an earlier strip."""
    patches = cut(later.contrast, row, column, parameters.patch_half_px)
    guess_row = row + later.first_row - peak.shift[0] - peak.earlier.first_row
    guess_column = column - peak.shift[1]
    there = np.nan_to_num(peak.earlier.contrast)
    found = patches.match(there, peak.earlier.usable, guess_row, guess_column)
    tried = np.isfinite(found.offset).all(1) | _inside(peak.earlier, guess_row, guess_column, parameters)
    good = np.isfinite(found.offset).all(1) & (found.correlation > parameters.min_correlation)
    if good.sum() < _FEWEST_PATCHES:
        return Registration.refused(Verdict.OTHER if tried.sum() >= _FEWEST_PATCHES else Verdict.PLAIN)
    psi = column[good] * (2 * np.pi / later.contrast.shape[1])
    fits = [_fit(psi, -found.offset[good, k]) for k in (0, 1)]
    agree = np.all([np.abs(residual) < _AGREEING_PX for _, _, residual in fits], 0)
    if agree.sum() < max(_FEWEST_AGREE * tried.sum(), _FEWEST_PATCHES):
        return Registration.refused(Verdict.OTHER)
    value, sigma = (np.array(x) for x in zip(*((v, s) for v, s, _ in fits), strict=True))
    return Registration(Verdict.SAME, peak.shift + value, np.hypot(sigma, _LEAST_SIGMA_PX))


def _inside(strip: StoredStrip, row: Float, column: Float, parameters: MotionParameters) -> Bool:
    """Return whether patches at positions (n,) are seen whole."""
    whole = whole_patches(strip.usable, parameters.patch_half_px + 1)
    i, j = np.rint(row).astype(int), np.mod(np.rint(column).astype(int), whole.shape[1])
    on = (i >= 0) & (i < len(whole))
    return np.asarray(on & whole[np.where(on, i, 0), j])


def _fit(psi: Float, value: Float) -> tuple[float, float, Float]:
    """Return the robust mean, its 1 σ and the residuals of shifts (n,) at azimuths (n,).

    Shifts may vary once around the pipe, if the camera's angles or offsets are estimated slightly differently
    in the two frames.
    """
    design = np.stack([np.ones_like(psi), np.cos(psi), np.sin(psi)], -1)
    known = np.diag([0.0, _LEAN_PX**-2, _LEAN_PX**-2])
    residual, scale = value - np.median(value), 1.0
    for _ in range(_ROUNDS):
        scale = max(robust_spread(residual), _LEAST_SPREAD_PX)
        weight = 1 / (scale**2 + residual**2 / 4)
        information = (design * weight[:, None]).T @ design + known
        found = np.linalg.solve(information, design.T @ (weight * value))
        residual = value - design @ found
    return float(found[0]), float(np.sqrt(np.linalg.inv(information)[0, 0])), residual
