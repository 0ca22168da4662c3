"""Frames -> ring samples: sub-pixel radius, σ, width, amplitude and validity at every azimuth."""

from pipeline.machine.stage import Stage
from stages.rings.extract import RingParameters, extract_rings

__all__ = ["RINGS", "RingParameters", "extract_rings"]

RINGS = Stage(
    "rings", "4", RingParameters, extract_rings, "laser frames to sub-pixel ring samples with their σ"
)
