"""Wall to defects: what stands off the pipe's own smooth shape, told from noise, measured, named.

1. Take the pipe's own slowly varying shape out (`relief`), and the motion of single rings; once more when it
   is known where the defects are.
2. Matched filters over scales, threshold from a wished number of false alarms (`detect`).
3. Hysteresis to instances with outlines; all-round beads are welds (`segment`).
4. Depth as the extreme of a 1 mm mean of the points (`fine`), without what noise adds to it, ± 1 σ (`depth`).
5. Kind from named features as a probability; codes; words (`classify`, `codes`, `describe`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from pipeline.artefacts import Wall, WallTexture
from pipeline.errors import UnusableError
from pipeline.findings import Defects
from pipeline.recording.base import Recording
from pipeline.stage import Context, Stage
from stages.defects.depth import Depth, measure_depth, measured_surface
from stages.defects.describe import Scene, describe
from stages.defects.detect import Detection, detect
from stages.defects.parameters import DefectParameters
from stages.defects.relief import smooth_shape_removed
from stages.defects.segment import Region, footprint, segment

__all__ = ["DEFECTS", "DefectParameters", "find_defects"]

_MIN_CELLS, _MIN_CIRCLES, _HALF = 1000, 8, 0.5


def find_defects(
    recording: Recording, wall: Wall, texture: WallTexture, parameters: DefectParameters, context: Context
) -> Defects:
    """Find, outline, measure and name the defects of a wall.

    Raises
    ------
    UnusableError
        When too little of the wall was measured to know its own shape.
    """
    _refuse_unseen(np.isfinite(wall.radius_map.radius_mm))
    relief = smooth_shape_removed(
        wall.radius_map, parameters, np.zeros(wall.radius_map.radius_mm.shape, bool)
    )
    detection = detect(relief, parameters.false_alarms)
    known = footprint(relief, segment(relief, detection, parameters))
    relief = smooth_shape_removed(wall.radius_map, parameters, known)
    regions = segment(relief, detection, parameters)
    surface = measured_surface(relief, wall.cloud, regions)
    measured: list[tuple[Region, Depth]] = []
    for k, region in enumerate(regions):
        measured.append((region, measure_depth(relief, region, surface, parameters.draws, context.random)))
        context.progress(k + 1, len(regions))
    kept = [(r, d) for r, d in measured if abs(d.depth_mm) >= parameters.min_depth_mm]
    kept.sort(key=lambda pair: (pair[0].row, pair[0].column))
    scene = Scene(relief, wall.cloud, texture, recording.pipe.wall_thickness_mm, parameters.min_depth_mm)
    items = tuple(describe(n + 1, region, depth, scene) for n, (region, depth) in enumerate(kept))
    context.report("defects", len(items), "")
    context.report("rejected: shallower than the smallest depth", len(measured) - len(kept), "detections")
    return Defects(items, parameters.false_alarms, _smallest_depth(detection, parameters))


def _refuse_unseen(seen: NDArray[np.bool_]) -> None:
    """Refuse a wall (S, A) of which too little was ``seen`` to know the shape that defects depart from."""
    cells, circles = int(seen.sum()), int((seen.mean(1) >= _HALF).sum())
    if cells < _MIN_CELLS or circles < _MIN_CIRCLES:
        raise UnusableError(
            "defects",
            f"{cells} cells of the wall were measured, {circles} circles of it to at least a half",
            limit=f"at least {_MIN_CELLS} cells and {_MIN_CIRCLES} circles",
            hint="see the rejected ring samples by reason, and whether the motion is right",
        )


def _smallest_depth(detection: Detection, parameters: DefectParameters) -> float:
    """Return the depth at which nine of ten defects of 3 mm × 3 mm pass both the threshold and the limit."""
    chance = float(ndtri(0.9))
    found = (detection.threshold + chance) * detection.small_sigma_mm
    return max(found, parameters.min_depth_mm + chance * detection.small_sigma_mm)


DEFECTS = Stage(
    "defects", "2", DefectParameters, find_defects, "defects as instances with depth, clock and kind"
)
