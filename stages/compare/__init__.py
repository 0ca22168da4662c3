"""Two walls of one pipe compared: registration, the difference all over, and what became of each finding."""

from __future__ import annotations

import numpy as np

from pipeline.artefacts.comparison import Comparison, FindingPair, RegisteredWalls, WallPair
from pipeline.machine.stage import Context, Parameters, Stage
from stages.compare.changes import changes, put_together
from stages.compare.growth import Resolution
from stages.compare.paired import PairedWalls, registered_walls
from stages.compare.registration.by_marks import RegisterParameters, register
from stages.compare.registration.marks import Surface

__all__ = ["COMPARE", "COMPARISON", "REGISTER", "CompareParameters", "compare_findings", "register_walls"]


class CompareParameters(Parameters):
    """Parameters of the compare stage: it has none."""


def register_walls(walls: WallPair, parameters: RegisterParameters, context: Context) -> RegisteredWalls:
    """Lay an earlier wall on a later one and take their difference.

    Raises
    ------
    UnusableError
        When the two do not show the same wall.
    """
    before, after = (Surface(w.wall, w.texture) for w in (walls.earlier, walls.now))
    registration = register(before, after, walls.welds_mm, parameters)
    context.report("pieces of wall matched", registration.blocks)
    context.report("pieces of wall that agree", registration.agreeing)
    pair = PairedWalls(before.wall, after.wall, registration)
    return registered_walls(pair, walls.is_one_calibration, context.progress)


def compare_findings(
    walls: WallPair,
    registered: RegisteredWalls,
    findings: FindingPair,
    parameters: CompareParameters,
    context: Context,
) -> Comparison:
    """Put the findings of both runs together and measure each on both walls."""
    pair = PairedWalls(walls.earlier.wall, walls.now.wall, registered.registration)
    places = put_together(findings.earlier, findings.now, pair.registration, pair.radius_mm)
    return Comparison(changes(places, pair, _resolution(walls, pair), context.progress))


def _resolution(walls: WallPair, pair: PairedWalls) -> Resolution:
    """Return what limits the reading of depths: the coarser of both maps, and the calibration."""
    both = (walls.earlier, walls.now)
    smoothing, spacing = max(w.smoothing_mm for w in both), max(w.ring_spacing_mm for w in both)
    # neighbouring rings are joined by a triangle of that foot, whose 1 σ is foot / √6
    along = float(np.hypot(smoothing, spacing / np.sqrt(6)))
    return Resolution(along, smoothing, pair.calibration_mm / pair.radius_mm, walls.is_one_calibration)


REGISTER = Stage(
    "register", "1", RegisterParameters, register_walls, "Lay an earlier run's wall on a later one's."
)
COMPARE = Stage("compare", "1", CompareParameters, compare_findings, "Tell what became of every finding.")
COMPARISON: tuple[Stage, ...] = (REGISTER, COMPARE)
