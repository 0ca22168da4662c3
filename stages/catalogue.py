"""The stages of a run, in order."""

from __future__ import annotations

from pipeline.stage import Stage
from stages.sections import SECTIONS
from stages.triangulate import TRIANGULATE

PIPELINE: tuple[Stage, ...] = (TRIANGULATE, SECTIONS)
