"""Find text and logos that a recorder burns into the picture: they look alike in either light."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import cv2
import numpy as np

from pipeline.arrays import Bool, Float32
from pipeline.recording.base import Illumination
from stages.twin.scene import Scene

_LEAST_GREY, _ALIKE, _FEWEST, _LEAST_PX, _RIM_PX = 40.0, 10.0, 4, 20, 8
"""Least brightness above black, and most difference, grey levels; fewest lit frames, and connected pixels:
hot ones are alike, too; px about letters that a codec blurs, those of its blocks. Chosen."""


class _Picture(Protocol):
    """A frame that is examined."""

    @property
    def frame(self) -> int:
        """Its number."""

    @property
    def light(self) -> Illumination:
        """What is switched on."""

    @property
    def image(self) -> Float32:
        """Its grey levels (H, W)."""


def burnt_in(scene: Scene, sampled: Sequence[_Picture], black: float) -> Bool:
    """Return pixels (H, W) that are bright and alike in all frames of both lights, and what is beside them.

    No wall is: apart from the line, it is dark without lamps, and passes by in their light. What a drop shows
    of line and wall may have one brightness in some frames, not in all.
    """
    alone = [s for s in sampled if s.light == Illumination.LASER]
    lit = [s for s in sampled if s.light == Illumination.LED]
    if not alone or len(lit) < _FEWEST:
        return np.zeros(sampled[0].image.shape, bool)
    least, most = (of([s.image for s in (*alone, *lit)], 0) for of in (np.min, np.max))
    alike = (least > black + _LEAST_GREY) & (most - least < _ALIKE)
    for s in alone:
        line = scene.line(scene.pose(s.frame))
        alike[line.row, line.column] = False
    _, label, stats, _ = cv2.connectedComponentsWithStats(alike.astype(np.uint8))
    large = stats[:, cv2.CC_STAT_AREA] >= _LEAST_PX
    large[0] = False
    kernel = np.ones((2 * _RIM_PX + 1,) * 2, np.uint8)
    return np.asarray(cv2.dilate(large[label].astype(np.uint8), kernel) > 0)
