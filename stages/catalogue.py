"""The stages of a run, in order."""

from __future__ import annotations

from pipeline.stage import Stage
from stages.motion import MOTION
from stages.rings import RINGS
from stages.triangulate import TRIANGULATE

PIPELINE: tuple[Stage, ...] = (RINGS, TRIANGULATE, MOTION)
