"""What dirt on the window has left in the wall's photo, which was made through the same window.

Wall that was photographed behind a spot, in a share of its frames, is too dark in the photo. Behind the spot
twin and recording then differ by less than the spot takes, and beside it the same wall is recorded brighter
than re-rendered. By as much the light that is left behind the spot is over-estimated.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.artefacts.twin import NamedFigure
from stages.twin.compare import BLOCK_PX
from stages.twin.locate import ImagePlace
from stages.twin.reference import BlockSamples

_MIDDLE, _CLEAR, _FEWEST_FRAMES = 0.5, 1.3, 3
"""Of a place's radius, where a spot's change falls to 3 %: its middle, and from where it takes under 1 %.
Fewest frames that show the same wall there."""
_OF_LIGHT = 0.01
"""Relative 1 σ of the brightness of wall beside a spot: what lamps and photo leave over without any."""


def without_photo(size: NamedFigure, place: ImagePlace, samples: BlockSamples | None) -> NamedFigure:
    """Return the share of the light that a spot takes away, freed of what of it the photo holds.

    Where 1 − s is left of the twin's light behind the spot, and the same wall is brighter than the twin by
    1 + b beside it, the spot lets (1 − s) / (1 + b) pass.
    """
    if samples is None:
        return size
    u, v = ((a + 0.5) * BLOCK_PX for a in (samples.column, samples.row))
    away, wall = np.hypot(u - place.u_px, v - place.v_px), samples.orders["wall"]
    behind = np.unique(wall[away < max(_MIDDLE * place.radius_px, BLOCK_PX)])
    clear = np.isin(wall, behind) & (away > _CLEAR * place.radius_px)
    frames = np.unique(samples.frame[clear])
    if len(frames) < _FEWEST_FRAMES:
        return size
    log = np.log1p(np.maximum(samples.change, -0.99))
    each = np.array([np.median(log[clear & (samples.frame == f)]) for f in frames])
    sd = float(np.hypot(each.std(ddof=1) / np.sqrt(len(each)), _OF_LIGHT))
    beside = float(np.exp(each.mean()))
    passed = (1 - size.value) / beside
    return replace(size, value=1 - passed, sd=float(np.hypot(size.sd / beside, passed * sd)))
