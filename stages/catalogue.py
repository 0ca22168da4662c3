"""The stages of a run, in order."""

from __future__ import annotations

from pipeline.machine.stage import Stage
from stages.accumulate import ACCUMULATE
from stages.defects import DEFECTS
from stages.mesh import MESH
from stages.motion import MOTION
from stages.overlays import OVERLAYS
from stages.premises import PREMISES
from stages.rings import RINGS
from stages.sections import SECTIONS
from stages.texture import TEXTURE
from stages.triangulate import TRIANGULATE

PIPELINE: tuple[Stage, ...] = (
    PREMISES,
    RINGS,
    TRIANGULATE,
    MOTION,
    ACCUMULATE,
    TEXTURE,
    OVERLAYS,
    MESH,
    SECTIONS,
    DEFECTS,
)
