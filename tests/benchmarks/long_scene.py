"""A pulled scene of any length.

Its metre repeated, with other defects in each metre and welds in every second.
"""

from __future__ import annotations

import numpy as np

from pipeline.simulator.scene import Scene
from pipeline.simulator.wall.description import Defect

_METRE_MM = 1000.0
_WELD_EVERY_M = 2
# With this rotation no two metres have their defects at the same place around the pipe.
_TURN_DEG = 137.5


def lengthened(scene: Scene, metres: int) -> Scene:
    """Return a scene of one metre made as many metres long; its texture does not repeat."""
    pipe = scene.pipe
    beyond_mm = pipe.to_mm - _METRE_MM
    welds = tuple(
        weld.model_copy(update={"distance_mm": weld.distance_mm + _METRE_MM * k})
        for k in range(0, metres, _WELD_EVERY_M)
        for weld in pipe.welds
    )
    random = np.random.default_rng(scene.seed)
    defects = tuple(_another(d, k, random) for k in range(metres) for d in pipe.defects)
    longer = {"to_mm": _METRE_MM * metres + beyond_mm, "welds": welds, "defects": defects}
    return scene.model_copy(
        update={
            "name": f"{scene.name}-{metres}m",
            "frames": scene.frames * metres,
            "pipe": pipe.model_copy(update=longer),
            "motion": scene.motion.model_copy(update={"legs": scene.motion.legs * metres}),
        }
    )


def _another(defect: Defect, metre: int, random: np.random.Generator) -> Defect:
    """Return a defect ``metre`` metres on, elsewhere around the pipe and of another size."""
    size, depth = random.uniform(0.7, 1.3, 2)
    return defect.model_copy(
        update={
            "distance_mm": defect.distance_mm + _METRE_MM * metre,
            "azimuth_deg": (defect.azimuth_deg + _TURN_DEG * metre + 180.0) % 360.0 - 180.0,
            "length_mm": defect.length_mm * size,
            "width_mm": defect.width_mm * size,
            "depth_mm": defect.depth_mm * depth,
        }
    )
