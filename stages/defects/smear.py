"""Depths that a noise filter or a codec flattened: each picture holds some of those before it.

Such a picture shows a mean of the wall over the way that the probe went meanwhile. What that took off a
finding's depth is told by what it would take off once more.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.signal import lfilter

from pipeline.adjustment.shared_light import HeldOver
from stages.defects.depth import Depth
from stages.defects.segment import Region
from stages.defects.surface import Surface

# No more of a depth is taken to be lost than a third: its bell is hardly known any more (chosen).
_MOST_LOST = 1 / 3


def flattened(depth: Depth, region: Region, surface: Surface, held: HeldOver) -> Depth:
    """Return a depth with a σ that holds what pictures which ``held`` earlier ones may have taken off it.

    A codec holds the fine structure of the line and shows a step of the wall anew, a noise filter flattens
    both: likeness does not tell which, so that the depth itself is left as it is.
    """
    if not held.more_than_usual:
        return depth
    shown = region.cut(surface.all_mm if region.all_round else surface.local_mm)[:, depth.peak[1]]
    profile = np.fmax(np.sign(depth.depth_mm) * shown, 0.0)
    share = float(held.handed_on ** (surface.relief.cell_mm[0] / surface.points.spacing_mm))
    once_more = lfilter([1 - share], [1, -share], profile).max(initial=0.0)
    lost = abs(depth.depth_mm) * _lost(float(once_more / max(profile.max(initial=0.0), 1e-9)))
    return replace(depth, sigma_mm=float(np.hypot(depth.sigma_mm, lost)))


def _lost(kept: float) -> float:
    """Return which part of a depth, as it is now, was lost, if this part of it is ``kept`` once more.

    Each time a bell's variance along the pipe grows by as much, and its height falls by the root of it: from
    v − d to v to v + d, so that heights are as √(2 − 1 / kept²) to 1 to kept.
    """
    before = 2 - 1 / max(kept, 0.1) ** 2
    return min(before**-0.5 - 1, _MOST_LOST) if before > 0 else _MOST_LOST
