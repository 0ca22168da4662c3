"""Whether an oscillating ring may be due to a rocking laser sheet."""

from __future__ import annotations

import numpy as np

from stages.diagnose.channels import Seen
from stages.diagnose.travel.lines import Line

_ROCKING_P = 0.01


def rocking_excluded(line: Line, seen: Seen) -> bool:
    """Return whether a sheet rocking as much as the ring oscillates would be visible, but rings show none.

    If the sheet is assumed to be at rest, a tilt φ of it moves the ring like a camera that is r² φ / l off
    the axis. But only a sheet moves rings relative to fiducials, the more the wider the bore.
    """
    if seen.geometry is None:
        return False
    rings, verdicts = seen.geometry.searched.nothing.linearised.rings, seen.geometry.verdicts
    about = [f for f in seen.geometry.feasibility if f.name == "laser_rocking"]
    sets = verdicts.sets if verdicts is not None else ()
    suspected = sum(p for p, terms in sets if any(t.model.law == "laser_rocking" for t in terms))
    if not about or suspected > _ROCKING_P:
        return False
    widest_mm = float(np.max(rings.radius_mm))
    needed_mrad = 1e3 * line.amplitude_mm * rings.probe.laser.baseline_mm / widest_mm**2
    return bool(needed_mrad > about[0].detectable)
