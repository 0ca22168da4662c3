"""A second line is light bounced across the bore only if its place fits the sheet that the rings show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.arrays import Float
from pipeline.instrument.probe import Probe
from stages.diagnose.agreement import Agreement, Part, agreement
from stages.diagnose.channels import Seen
from stages.diagnose.correct import Correction
from stages.diagnose.gauge.answer import verdict_of
from stages.diagnose.profile.finding import Finding
from stages.diagnose.profile.ghost import LARGEST_RAD
from stages.diagnose.result import Verdict

_NAME = "ghost_ring"
_SHEET = ("tilt_x", "tilt_y", "cone_rad")


def sheet_by_rings(gauge: Seen | None, correction: Correction | None, probe: Probe) -> Part | None:
    """Return tilt along x and y and cone of the sheet, deg, true minus stated, from a gauge run's rings.

    None where they leave open what displaced them.
    """
    if gauge is None or gauge.geometry is None or correction is None:
        return None
    if verdict_of(gauge.geometry) not in (Verdict.CONSISTENT, Verdict.NAMED):
        return None
    at = [probe.parameter_names.index(name) for name in _SHEET]
    moved = np.degrees(correction.probe.parameters[at] - probe.parameters[at])
    covariance = np.degrees(np.degrees(correction.probe.covariance[np.ix_(at, at)]))
    return Part("rings of the gauge", _words(moved), moved, covariance)


def against_rings(found: Finding, sheet: Part) -> Agreement | None:
    """Return whether the sheet implied by the place of a second line agrees with that of the rings.

    None where either determines the sheet too poorly.
    """
    value = np.array([size.value for size in found.confirms])
    covariance = np.diag([size.sigma**2 for size in found.confirms])
    return agreement(sheet, Part("place of the second line", _words(value), value, covariance))


def chance_of_place(found: Finding, sheet: Part) -> float:
    """Return the p-value of a second line of this height so close to the place where the rings expect it.

    By chance it would lie anywhere in the range searched, wherever the sheet is: height and place are
    independent, so that their p-values are combined as by R. A. Fisher, "Statistical Methods for Research
    Workers", 4th ed., 1932, § 21.1.
    """
    apart = np.array([size.value for size in found.confirms]) - sheet.value
    gap = sheet.covariance + np.diag([size.sigma**2 for size in found.confirms])
    nearer = 4 / 3 * np.pi * (apart @ np.linalg.solve(gap, apart)) ** 1.5 * np.sqrt(np.linalg.det(gap))
    place = min(float(nearer) / float(np.degrees(2 * LARGEST_RAD)) ** len(apart), 1.0)
    both = max(found.p_value * place, 1e-300)
    return float(min(both * (1 - np.log(both)), 1.0))


def compared_with_rings(seen: Seen, sheet: Part) -> Seen:
    """Return a recording's evidence with its second line confirmed by the rings, or withdrawn.

    A faint line whose place implies a sheet that the rings exclude is not light bounced across the bore.
    Compression, the lens and the wall leave such light, too.
    """
    if seen.profile is None:
        return seen
    second = next((f for f in seen.profile.findings if f.effect == _NAME and f.confirms), None)
    match = against_rings(second, sheet) if second is not None else None
    if second is None or match is None:
        return seen
    if match.confirmation.agrees:
        chance = chance_of_place(second, sheet)
        kept = replace(second, p_value=chance, agreements=(*second.agreements, match))
        return replace(seen, profile=seen.profile.with_finding(kept))
    if not second.found:
        return seen
    withdrawn = replace(second, p_value=1.0, confirms=(), agreements=())
    words = (
        f"The line's profile of {seen.name} shows faint light beside the line. It is not light "
        f"bounced across the bore: its place would require {match.confirmation.measured.partition(': ')[2]}, "
        f"and the rings say {match.confirmation.prediction.partition(': ')[2]}."
    )
    return replace(
        seen, profile=seen.profile.with_finding(withdrawn), shortcomings=(*seen.shortcomings, words)
    )


def _words(sheet: Float) -> str:
    tilt, direction = np.hypot(sheet[0], sheet[1]), np.degrees(np.arctan2(sheet[1], sheet[0]))
    return f"a tilt of {tilt:.3f}° toward {direction:.0f}° and a cone of {sheet[2]:+.3f}°"
