"""Whether a ring that swings may be a sheet that rocks."""

from __future__ import annotations

import numpy as np

from stages.diagnose.channels import Seen
from stages.diagnose.travel.lines import Line

_ROCKING_P = 0.01


def rocking_excluded(line: Line, seen: Seen) -> bool:
    """Return whether a sheet that rocks as much as the ring swings would show, and rings show none.

    Seen with the sheet believed at rest, a tilt φ of the sheet moves the ring as a camera r² φ / l off the
    axis does; but only a sheet moves rings against fiducials, the more the wider the bore.
    """
    if seen.geometry is None or any("laser_rocking" in names for names in seen.geometry.unsplit):
        return False
    rings, verdicts = seen.geometry.searched.nothing.linearised.rings, seen.geometry.verdicts
    about = [f for f in seen.geometry.feasibility if f.name == "laser_rocking"]
    suspected = verdicts is not None and any(
        p > _ROCKING_P and "laser_rocking" in j.names
        for p, j in zip(verdicts.probability, verdicts.judged, strict=True)
    )
    if not about or suspected:
        return False
    widest_mm = float(np.max(rings.radius_mm))
    needed_mrad = 1e3 * line.amplitude_mm * rings.probe.laser.baseline_mm / widest_mm**2
    return bool(needed_mrad > about[0].detectable)
