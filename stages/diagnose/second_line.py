"""Whether rings bear out a second line: light bounced across the bore tells of the same sheet as they do."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Float
from pipeline.instrument.probe import Probe
from stages.diagnose.agreement import Agreement, Part, agreement
from stages.diagnose.channels import Seen
from stages.diagnose.correct import Correction
from stages.diagnose.gauge.answer import verdict_of
from stages.diagnose.profile.finding import Finding
from stages.diagnose.result import Verdict

_NAME = "ghost_ring"
_SHEET = ("tilt_x", "tilt_y", "cone_rad")


@dataclass(frozen=True)
class SheetByRings:
    """What the rings of a gauge run say of the laser sheet.

    Attributes
    ----------
    value : (3,)
        Tilt along x, along y, and cone, deg, true minus stated.
    covariance : (3, 3)
    """

    value: Float
    covariance: Float


def sheet_by_rings(gauge: Seen | None, correction: Correction | None, probe: Probe) -> SheetByRings | None:
    """Return the sheet as a gauge run's rings have it; None where they leave open what moved them."""
    if gauge is None or gauge.geometry is None or correction is None:
        return None
    if verdict_of(gauge.geometry) not in (Verdict.CONSISTENT, Verdict.NAMED):
        return None
    at = [probe.parameter_names.index(name) for name in _SHEET]
    moved = np.degrees(correction.probe.parameters[at] - probe.parameters[at])
    return SheetByRings(moved, np.degrees(np.degrees(correction.probe.covariance[np.ix_(at, at)])))


def against_rings(found: Finding, sheet: SheetByRings) -> Agreement | None:
    """Return whether the sheet that a second line's place asks for is that of the rings.

    None where either tells too little of the sheet.
    """
    value = np.array([size.value for size in found.confirms])
    covariance = np.diag([size.sigma**2 for size in found.confirms])
    parts = (
        Part("rings of the gauge", _words(sheet.value), sheet.value),
        Part("place of the second line", _words(value), value),
    )
    return agreement(*parts, (sheet.covariance, covariance), sheet.covariance + covariance)


def held_against_rings(seen: Seen, sheet: SheetByRings) -> Seen:
    """Return what a recording says, its second line borne out by the rings or withdrawn.

    A faint line whose place asks for a sheet that the rings exclude is not light bounced across the bore.
    Compression, the lens and the wall leave such light too.
    """
    if seen.profile is None:
        return seen
    second = next((f for f in seen.profile.found if f.effect == _NAME and f.confirms), None)
    told = against_rings(second, sheet) if second is not None else None
    if second is None or told is None:
        return seen
    if told.confirmation.agrees:
        kept = replace(second, agreements=(*second.agreements, told))
        return replace(seen, profile=seen.profile.with_finding(kept))
    withdrawn = replace(second, p_value=1.0, confirms=(), agreements=())
    words = (
        f"The line's profile of {seen.name} shows faint light beside the line. It is not light "
        f"bounced across the bore: its place would ask for {told.confirmation.measured.partition(': ')[2]}, "
        f"and the rings say {told.confirmation.prediction.partition(': ')[2]}."
    )
    return replace(
        seen,
        profile=seen.profile.with_finding(withdrawn),
        shortcomings=(*seen.shortcomings, words),
    )


def _words(sheet: Float) -> str:
    tilt, direction = np.hypot(sheet[0], sheet[1]), np.degrees(np.arctan2(sheet[1], sheet[0]))
    return f"a tilt of {tilt:.3f}° toward {direction:.0f}° and a cone of {sheet[2]:+.3f}°"
