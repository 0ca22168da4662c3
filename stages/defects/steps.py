"""Steps of the bore, which depart from the wall's smooth shape as beads and grooves do."""

from __future__ import annotations

import numpy as np

from pipeline.adjustment.robust import row_median
from pipeline.artefacts.measured import RadiusMap
from stages.defects.segment import Region

# The bore beside a finding is looked at over a tenth of the diameter: a step is smeared over as much.
_BESIDE = 0.2
# A finding that goes round so much of the pipe is the way from one bore to the other if it stands out of the
# one by less than half of what it stands out of both in the mean. A bead stands out of both alike. Chosen.
_ALL_ROUND, _STANDS_OUT = 0.9, 0.5
IS_STEP = "The bore is of one width before it and of another behind it: it is a step, no bead or groove"


def is_step(region: Region, least_mm: float, radius_map: RadiusMap) -> bool:
    """Return whether a region that goes round the pipe is a step of the bore.

    So is what stands out of the bore beside it by less than ``least_mm``. Its median round the pipe is what
    stands out: a pit in a bead or a glint on it is deeper than the bead.
    """
    radius_mm = radius_map.radius_mm
    if region.mask.any(0).sum() < _ALL_ROUND * radius_mm.shape[1]:
        return False
    first, end = region.row, region.row + len(region.mask)
    along_mm = float(radius_map.distance_mm[1] - radius_map.distance_mm[0])
    reach = max(round(_BESIDE * float(np.nanmedian(radius_mm[first:end])) / along_mm), 1)
    rows = (slice(max(first - reach, 0), first), slice(first, end), slice(end, end + reach))
    before, inside, behind = (row_median(radius_mm[r]) for r in rows)
    if not np.isfinite(before).any() or not np.isfinite(behind).any():
        return False
    sides = region.sign * np.array([np.nanmedian(before), np.nanmedian(behind)])
    out_mm = float(np.nanmax(region.sign * inside)) - sides
    return bool(out_mm.min() < max(_STANDS_OUT * out_mm.mean(), least_mm))
