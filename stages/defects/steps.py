"""Steps of the bore, which depart from the wall's smooth shape as beads and grooves do."""

from __future__ import annotations

import numpy as np

from pipeline.adjustment.robust import row_median
from pipeline.artefacts.measured import RadiusMap
from stages.defects.segment import Region

# The bore beside a finding is looked at over a tenth of the diameter: a step is smeared over as much.
_BESIDE = 0.2
# A finding that goes round so much of the pipe and stands out of neither bore beside it by half of its depth
# is the way from one to the other. A bead stands out of both by all of it. Chosen.
_ALL_ROUND, _STANDS_OUT = 0.9, 0.5
IS_STEP = "The bore is of one width before it and of another behind it: it is a step, no bead or groove"


def is_step(region: Region, depth_mm: float, radius_map: RadiusMap) -> bool:
    """Return whether a region of depth ``depth_mm``, positive into the wall, is a step of the bore."""
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
    sides = np.sign(depth_mm) * np.array([np.nanmedian(before), np.nanmedian(behind)])
    out_mm = float(np.nanmax(np.sign(depth_mm) * inside) - sides.max())
    return out_mm < _STANDS_OUT * abs(depth_mm)
