"""Depths that a noise filter or a codec flattened: each picture holds some of those before it.

Such a picture shows a mean of the wall over the way that the probe went meanwhile. What that took off a
finding's depth is told by what it would take off once more: as from a bell that loses as much then.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.adjustment.robust import row_median
from pipeline.adjustment.shared_light import HeldOver
from pipeline.arrays import Float
from pipeline.artefacts.cloud_along import usual_way
from stages.defects.depth import Depth
from stages.defects.segment import Region
from stages.defects.surface import Surface

# No finding is taken to have been narrower than the millimetre whose mean a depth is: 1 σ of a bell that is
# 1 mm wide at half its height, mm.
_SHARPEST_MM = 0.42
# Bells are tried up to so many ways over which a picture is held: the widest lose 1 / 450 of their height.
_WIDEST, _BELLS = 30.0, 40


def flattened(depth: Depth, region: Region, surface: Surface, held: HeldOver, ways_mm: Float) -> Depth:
    """Return a depth with a σ that holds what pictures which ``held`` earlier ones may have taken off it.

    ``ways_mm`` (F,) is how far the probe went to each frame's ring since the one before.
    A codec holds the fine structure of the line and shows a step of the wall anew, a noise filter flattens
    both: likeness does not tell which, so that the depth itself is left as it is.
    """
    way_mm = usual_way(ways_mm[np.unique(surface.near.frame)])
    if not held.handed_on or not way_mm:
        return depth
    profile = np.fmax(np.sign(depth.depth_mm) * _shown(region, surface, depth.peak[1]), 0.0)
    cell_mm = surface.relief.cell_mm[0]
    share = float(held.handed_on ** (cell_mm / way_mm))
    lost = abs(depth.depth_mm) * _lost(profile, share, cell_mm)
    return replace(depth, sigma_mm=float(np.hypot(depth.sigma_mm, lost)))


def _shown(region: Region, surface: Surface, column: int) -> Float:
    """Return a finding's profile (H,) along the pipe, of what goes all round the median round the pipe."""
    return (
        row_median(region.cut(surface.all_mm))
        if region.all_round
        else region.cut(surface.local_mm)[:, column]
    )


def _lost(profile: Float, share: float, cell_mm: float) -> float:
    """Return how many times the height that a ``profile`` (H,) still has it lost.

    It is what a bell lost of which once more takes off as much. Where even the sharpest keeps more, a finding
    is taken to have been as sharp: the loss is then at most as large.
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
    """Return which part of a profile's height (H,) is left once more, whichever way the probe went."""
    left = min(float(_held_over(p, share).max(initial=0.0)) for p in (profile, profile[::-1]))
    return left / max(float(profile.max(initial=0.0)), 1e-9)


def _held_over(profile: Float, share: float) -> Float:
    """Return a profile (H,) of which each cell holds such a share of the one before."""
    # Loaded where it is needed, as few runs do: it brings scipy.stats, a fifth of the time of all imports.
    from scipy.signal import lfilter

    return np.asarray(lfilter([1 - share], [1, -share], profile))
