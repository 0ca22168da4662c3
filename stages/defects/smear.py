"""Depths flattened by a temporal noise filter or a codec: each picture retains a part of earlier ones.

Such a picture shows the wall averaged over the way that the probe travelled meanwhile. How much of a
finding's depth was lost is estimated by filtering its profile once more: it equals what a bell has lost that
would lose as much the second time.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.adjustment.robust import row_median
from pipeline.adjustment.shared_light import HeldOver
from pipeline.arrays import Float
from pipeline.artefacts.cloud_along import usual_way
from stages.defects.all_round import MEDIAN_ERRS, PLACE_MM
from stages.defects.depth import Depth
from stages.defects.segment import Region
from stages.defects.surface import Surface

# A finding is taken to have been no narrower than the 1 mm over which a depth is averaged: 1 σ, mm, of a bell
# that is 1 mm wide at half its height.
_SHARPEST_MM = 0.42
# Bells are tried up to 30 times as wide as the way over which light is retained: the widest lose 1 / 450 of
# their height.
_WIDEST, _BELLS = 30.0, 40
# A profile may be too low by so many σ of the wall's unevenness, and its flanks are compared over so many
# cells: farther off, hardly anything of any finding is left (both chosen).
_LOWER_SIGMAS, _FLANK = 3.0, 64
# A rim is at most half as high as a pit is deep (chosen). As the narrower one it is flattened more, by up to
# 1.7 times in drawn pits with rims of 0.7 of their width: 2 is on the safe side.
_HIGHEST_RIM, _RIM_LOSES_MORE = 0.5, 2.0
# Both flanks must be seen down to this part of the height for their steepest cells to count (chosen). Of a
# sharp edge from which a finding fades as slowly as retained light, .92 of the height is left there.
_FLANK_FOOT = 0.2
_ROUNDS = 30  # the share settles to 0.01 in fewer steps


def flattened(depth: Depth, region: Region, surface: Surface, held: HeldOver, ways_mm: Float) -> Depth:
    """Return a depth whose σ includes what pictures retaining earlier ones (``held``) may have taken off.

    ``ways_mm`` (F,) is how far the probe moved to each frame's ring since the ring before. A codec retains
    the fine structure of the line but draws a step of the wall afresh, a noise filter flattens both. How
    alike pictures are does not show which of the two was at work, so that only σ changes and not the depth.
    A flank that falls off faster than retained light could shows that less was retained, unless a rim beside
    the finding made it steep.
    """
    way_mm = usual_way(ways_mm[np.unique(surface.near.frame)])
    if not held.handed_on or not way_mm:
        return depth
    sign, column = np.sign(depth.depth_mm), depth.peak[1]
    shown, whole = (sign * p for p in _profiles(region, surface, column))
    with_flanks = [sign * p for p in _profiles(_with_flanks(region, surface), surface, column)]
    cell_mm = surface.relief.cell_mm[0]
    lower_mm = _LOWER_SIGMAS * _unevenness(region, surface)
    share = float(held.handed_on ** (cell_mm / way_mm))
    share = _share_with_rim(share, whole, lower_mm, _rim(with_flanks[1], lower_mm))
    lost = min(_lost(np.fmax(shown, 0.0), share, cell_mm), _lost_by_slope(with_flanks[0], share))
    return replace(depth, sigma_mm=float(np.hypot(depth.sigma_mm, abs(depth.depth_mm) * lost)))


def _rim(profile: Float, lower_mm: float) -> float:
    """Return the height that a rim beside a finding of this ``profile`` (H,) may have, over its depth.

    What is no further beyond the wall than ``lower_mm`` is no rim.
    """
    beyond = float(np.fmax(-profile, 0.0).max(initial=0.0))
    top = max(float(np.fmax(profile, 0.0).max(initial=0.0)), 1e-9)
    return min(_RIM_LOSES_MORE * beyond / top, _HIGHEST_RIM) if beyond > lower_mm else 0.0


def _share_with_rim(share: float, profile: Float, lower_mm: float, rim: float) -> float:
    """Return the largest share up to ``share`` that the flanks of a ``profile`` (H,) allow.

    A rim makes flanks steeper. If more was retained, finding and rim were higher, which allows more: from
    ``share`` down, the steps end at the largest share that agrees with itself.
    """
    for _ in range(_ROUNDS):
        share = min(share, _most_held(profile, lower_mm, rim * _undone(profile, share)))
    return share


def _undone(profile: Float, share: float) -> float:
    """Return the height of a profile (H,) before each cell retained ``share`` of the one before."""
    steps = np.diff(profile, prepend=np.nan), np.diff(profile[::-1], prepend=np.nan)[::-1]
    undone = [profile + share / (1 - share) * step for step in steps]
    return float(np.fmax(profile, np.fmax(*undone)).max(initial=0.0, where=np.isfinite(profile)))


def _lost_by_slope(profile: Float, share: float) -> float:
    """Return the lost height over the remaining height of a ``profile`` (H,), noise and all.

    Noise adds to it, so that it bounds the loss from above, also beside a rim, where no bell fits. Where a
    flank is unseen, its steepest part may be, and nothing bounds the loss.
    """
    if not _flanks_seen(profile):
        return np.inf
    return _undone(profile, share) / max(float(np.fmax(profile, 0.0).max(initial=0.0)), 1e-9) - 1


def _flanks_seen(profile: Float) -> bool:
    """Return whether a ``profile`` (H,) is seen from its top down to the foot of either flank."""
    top = int(np.fmax(profile, 0.0).argmax())
    ends = np.flatnonzero(~(profile >= _FLANK_FOOT * profile[top]))
    nearest = np.r_[ends[ends < top][-1:], ends[ends > top][:1]]
    return len(nearest) == 2 and bool(np.isfinite(profile[nearest]).all())


def _with_flanks(region: Region, surface: Surface) -> Region:
    """Return the region's window longer by its own length at either end, as far as the surface goes."""
    length = region.mask.shape[0]
    before = min(length, region.row)
    after = min(length, surface.local_mm.shape[0] - region.row - length)
    return replace(region, row=region.row - before, mask=np.pad(region.mask, ((before, after), (0, 0))))


def _unevenness(region: Region, surface: Surface) -> float:
    """Return 1 σ, mm, of a profile that is the median over the independent places of a region's columns."""
    relief = surface.relief
    around = (
        2 * np.pi * relief.radius_mm if region.all_round else region.mask.any(0).sum() * relief.cell_mm[1]
    )
    return float(relief.typical.sigma_mm * MEDIAN_ERRS / np.sqrt(max(around / PLACE_MM, 1.0)))


def _most_held(shown: Float, lower_mm: float, rim_mm: float) -> float:
    """Return the largest possible share of each cell that the next one retains, in either direction.

    If each cell retains a share of the one before, and the wall lies nowhere lower than the top of a rim of
    ``rim_mm``, then after k cells at least the k-th power of the height above that top is left. The profile
    ``shown`` (H,), NaN where unseen, may be too low by ``lower_mm``. Cells below 0 tell nothing.
    """

    def most(profile: Float) -> float:
        share = 1.0
        for k in range(1, min(len(profile), _FLANK)):
            out = (profile[:-k] > lower_mm) & (profile[k:] > 0)
            left = np.maximum(profile[k:] + rim_mm + lower_mm, 0.0)[out] / (profile[:-k][out] + rim_mm)
            share = min(share, float(left.min(initial=1.0)) ** (1 / k))
        return share

    return max(most(shown), most(shown[::-1]))


def _profiles(region: Region, surface: Surface, column: int) -> tuple[Float, Float]:
    """Return a finding's profiles (H,) along the pipe, mm: at its peak, and the median over its columns.

    Those of an all-round one are both its medians round the pipe.
    """
    if region.all_round:
        profile = row_median(region.cut(surface.all_mm))
        return profile, profile
    local = region.cut(surface.local_mm)
    return local[:, column], row_median(local[:, region.mask.any(0)])


def _lost(profile: Float, share: float, cell_mm: float) -> float:
    """Return the lost height over the remaining height of a ``profile`` (H,).

    It is the loss of the bell that would lose the same fraction if filtered once more. Where even the
    narrowest bell loses less, the finding is taken to have been that narrow, which bounds the loss.
    """
    held = 1 / (1 - share)
    sharpest = _SHARPEST_MM / cell_mm
    kept, height = [], []
    for width in np.geomspace(sharpest, sharpest + _WIDEST * held, _BELLS):
        along = np.arange(-np.ceil(4 * width), np.ceil(4 * width + 8 * held) + 1)
        bell = _held_over(np.exp(-0.5 * (along / width) ** 2), share)
        kept.append(_kept(bell, share))
        height.append(float(bell.max()))
    return 1 / float(np.interp(_kept(profile, share), kept, height)) - 1


def _kept(profile: Float, share: float) -> float:
    """Return the fraction of a profile's height (H,) left if filtered once more, in the worse direction."""
    left = min(float(_held_over(p, share).max(initial=0.0)) for p in (profile, profile[::-1]))
    return left / max(float(profile.max(initial=0.0)), 1e-9)


def _held_over(profile: Float, share: float) -> Float:
    """Return a profile (H,) in which each cell retains ``share`` of the cell before."""
    # Imported here because few runs need it: it imports scipy.stats, a fifth of the time of all imports.
    from scipy.signal import lfilter

    return np.asarray(lfilter([1 - share], [1, -share], profile))
