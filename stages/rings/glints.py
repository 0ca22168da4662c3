"""Finds runs of samples off the wall that only one ring shows, while the rings before and after agree.

The next ring shows a defect too, but not a glint, which has moved on. Rings are aligned by their slow
variation around the circle, and the median of five rings in a row is the wall. A run of neighbouring samples
that leaves the wall together either shows in a neighbouring ring too or is alone. A lone run is rejected if
its profile is that of a glint, brighter or wider than the ring's; if its profile is that of the line, its
samples stay, with a σ that includes the chance that they are not wall.
"""

from __future__ import annotations

import numba
import numpy as np

from pipeline.adjustment.robust import robust_spread, robust_spreads
from pipeline.arrays import Bool, Float, Float32, Int
from stages.rings.kernels import slow_around

# Rings on either side that are compared: two of five may be wrong, and a run is confirmed by a neighbour,
# which itself is measured against two more; clutter is counted over two rings on either side.
WALL_RINGS = 2
_CLUTTER_RINGS = 2
SAYING_RINGS = WALL_RINGS + 1 + _CLUTTER_RINGS
# A run extends as far as its samples leave the wall by 2.5 σ, and counts if one of them leaves it by 5 σ:
# less than one in a hundred thousand samples of noise does.
_RUN_SIGMAS, _SEED_SIGMAS = 2.5, 5.0
# Least share of a lone run's depth that a neighbouring ring must show to confirm it. Chosen so that a ring
# beside the middle of a small pit still counts; not measured (data/debts.md).
_SHARE = 0.25
_NEAR_SECTORS, _GAP_SECTORS = 2, 4
# Root mean square over a run of the excess of brightness and width, in robust σ of the ring; the ring itself
# has 1. Runs above the larger value are glints even if a second ring shows one in the same place; what three
# of five rings show is the wall and no run.
_ODD_RUN, _GLARING_RUN = 3.0, 6.0
# For every four glint samples of odd profile, one with the profile of a line is assumed; and in a recording
# without odd ones, one in ten lone samples still does not count as wall. Both are judgements, not measured.
_CLUTTER_ORDINARY, _CLUTTER_PRIOR = 0.25, 0.1
_LEAST_WIDTH_SPREAD, _LEAST_BRIGHTNESS_SPREAD = 0.03, 0.1


def lone_runs(
    radius_px: Float32, sigma_px: Float32, width_px: Float32, amplitude: Float32
) -> tuple[Bool, Float32]:
    """Return which samples (F, A) are not the line, and σ, px, of all samples, which includes that chance.

    Rings are in the order of time; ``radius_px`` is NaN where there is no valid sample, and σ is NaN there.
    ``sigma_px`` is 1 σ.
    """
    away = _away_from_wall(radius_px.astype(np.float64))
    sigma = np.maximum(sigma_px, _spread_of(away))
    runs = _runs(away, sigma)
    odd = _oddness(np.log(width_px), _LEAST_WIDTH_SPREAD) ** 2
    odd += _oddness(np.log(amplitude), _LEAST_BRIGHTNESS_SPREAD) ** 2
    odd = _mean_over_runs(runs > 0, odd)
    lone = runs == 2
    glint = (lone & (odd > _ODD_RUN**2)) | (odd > _GLARING_RUN**2)
    chance = _chance_of_clutter((lone & glint).sum(1), (lone & ~glint).sum(1))
    unsure = np.hypot(sigma_px, np.sqrt(chance) * np.where(lone, np.nan_to_num(np.abs(away)), 0.0))
    return glint & np.isfinite(radius_px), np.asarray(unsure, np.float32)


def _oddness(value: Float32, least_spread: float) -> Float:
    """Return the excess of each value (F, A) over the slow variation around its ring, in σ of the ring."""
    out = np.zeros(value.shape)
    for row, ring in zip(out, value.astype(float), strict=True):
        beyond = ring - slow_around(ring)
        spread = robust_spread(beyond) if np.isfinite(beyond).any() else 0.0
        row[:] = np.maximum(beyond, 0.0) / max(spread, least_spread)
    return out


def _chance_of_clutter(glints: Int, ordinary: Int) -> Float:
    """Return the chance (F, 1) that a lone sample with an ordinary profile is no wall.

    ``glints`` and ``ordinary`` (F,) are the lone samples of every ring with either profile: where there are
    glints, some of them look like a line.
    """
    near = np.ones(2 * _CLUTTER_RINGS + 1)
    odd, plain = (np.convolve(n, near)[_CLUTTER_RINGS : len(n) + _CLUTTER_RINGS] for n in (glints, ordinary))
    chance = (_CLUTTER_PRIOR + _CLUTTER_ORDINARY * odd) / (1 + plain)
    return np.clip(chance, _CLUTTER_PRIOR, 0.5)[:, None]


def _spread_of(away: Float) -> Float:
    """Return the robust 1 σ (F, 1) of every ring's distance to the wall."""
    known = np.isfinite(away).any(1)
    out = np.zeros((len(away), 1))
    out[known, 0] = robust_spreads(away[known], 1)
    return out


def _away_from_wall(radius: Float) -> Float:
    """Return the distance (F, A) of rings to the median of themselves and two on either side, or NaN."""
    step = np.zeros_like(radius)
    for own, apart in zip(step[1:], np.diff(radius, axis=0), strict=True):
        own[:] = slow_around(apart)
    level = radius - np.cumsum(step, axis=0)
    beside = np.full((WALL_RINGS, radius.shape[1]), np.nan)
    padded = np.concatenate([beside, level, beside])
    near = np.sort([padded[k : k + len(level)] for k in range(2 * WALL_RINGS + 1)], axis=0)
    known = np.isfinite(near).sum(0, keepdims=True)
    low, high = (np.take_along_axis(near, np.maximum(known - k, 0) // 2, 0)[0] for k in (1, 0))
    return np.where(known[0] > 2, level - 0.5 * (low + high), np.nan)


@numba.njit(cache=True, nogil=True)
def _runs(away, sigma):  # type: ignore[no-untyped-def]
    """Mark runs (F, A) that leave the wall to one side: 1 if a neighbouring ring does too, 2 if alone, or 0.

    A run may include a few sectors without a sample.
    """
    rings, sectors = away.shape
    out = np.zeros((rings, sectors), np.uint8)
    for k in range(rings):
        first = 0
        while first < sectors:
            sign = 1.0 if away[k, first] > 0 else -1.0
            if not sign * away[k, first] > _RUN_SIGMAS * sigma[k, first]:
                first += 1
                continue
            length, gap, total, confirmed, top = 1, 0, 0.0, 0.0, 0.0
            while gap <= _GAP_SECTORS and length + gap <= sectors:
                a = (first + length - 1 + gap) % sectors
                height = sign * away[k, a]
                if height > _RUN_SIGMAS * sigma[k, a]:
                    length, gap = length + gap, 1
                    total += height
                    top = max(top, height / sigma[k, a])
                    confirmed += height if _confirmed(away, sigma, k, a, sign) else 0.0
                elif np.isnan(height):
                    gap += 1
                else:
                    break
            if top > _SEED_SIGMAS:
                for a in range(first, first + length):
                    out[k, a % sectors] = 1 if 2 * confirmed > total else 2
            first += length
    return out


@numba.njit(cache=True, nogil=True)
def _confirmed(away, sigma, k, a, sign):  # type: ignore[no-untyped-def]
    """Whether the ring before or after leaves the wall near sector ``a`` to the same side as ring ``k``."""
    rings, sectors = away.shape
    for n in (k - 1, k + 1):
        if not 0 <= n < rings:
            continue
        for turn in range(-_NEAR_SECTORS, _NEAR_SECTORS + 1):
            b = (a + turn) % sectors
            least = max(_SHARE * sign * away[k, a], _RUN_SIGMAS * sigma[n, b])
            if sign * away[n, b] > least:
                return True
    return False


def _mean_over_runs(runs: Bool, value: Float) -> Float:
    """Return the mean of the finite ``value`` (F, A) over each run of neighbours in ``runs``, 0 elsewhere."""
    begins = runs.copy()
    begins[:, 1:] &= ~runs[:, :-1]
    run = np.cumsum(begins).reshape(runs.shape)
    known = runs & np.isfinite(value)
    total, count = (np.bincount(run[known], of, begins.sum() + 1) for of in (value[known], None))
    return np.where(runs, (total / np.maximum(count, 1))[run], 0.0)
