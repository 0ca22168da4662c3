"""Uncertainty of the wall where walls in photo and rings differ: on the map's rows, and in a warning."""

from __future__ import annotations

import numpy as np

from pipeline.adjustment.robust import row_median
from pipeline.arrays import Float, Int
from pipeline.artefacts.measured import Trajectory, Wall
from pipeline.machine.stage import Context
from stages.accumulate.grid import MapGrid
from stages.accumulate.survey import RingSurvey, nearest

_MATTERS = 0.42
"""A part that is this share of the whole σ raises it by a tenth."""
_JUDGED_ROWS, _TOLD = 2000, 4
"""Number of rows that are judged at least, which bounds time alone, and of stretches that are warned of."""


def displaced_on(grid: MapGrid, trajectory: Trajectory, frame: Int, survey: RingSurvey) -> Float:
    """Return the 1 σ (S,), mm, by which rows of the map err from place to place: that of the nearest ring.

    ``frame`` (F,) are the frames of the rings.
    """
    used = np.flatnonzero(survey.count)
    return trajectory.displaced_mm(frame[used[nearest(survey.middle_mm[used], grid.distance_mm)]])


def warn_of_displaced(trajectory: Trajectory, wall: Wall, context: Context) -> None:
    """Warn if photo and line certainly differ, and this raises the σ of radii by more than a tenth."""
    some = slice(None, None, max(len(wall.radius_map.distance_mm) // _JUDGED_ROWS, 1))
    total, apart = wall.radius_map.sigma_mm[some], wall.radius_map.displaced_in(some)
    raised = np.unique(apart[apart > _MATTERS * row_median(total)])
    worst = [d for d in trajectory.displaced if d.certain and d.size_mm in raised]
    if worst:
        worst = sorted(worst, key=lambda d: -d.size_mm)[:_TOLD]
        where = ", ".join(f"{d.size_mm:.2g} mm in frames {d.frame_from} to {d.frame_to}" for d in worst)
        context.warn(
            "photo and laser line contradict each other: they show the same places of the wall at radii that "
            f"differ smoothly (1 σ) by some {where}, after a shift and a tilt are removed. Either may be "
            "wrong: water, grease or uneven glass in front of the lens or of the laser, a lens or a sheet of "
            "laser light that is not as stated, or strong compression. σ of the radii includes the whole "
            "difference. What to do: dry and clean the window, run boresight diagnose on a gauge run, "
            "record with less compression"
        )
