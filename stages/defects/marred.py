"""Leave out rings in which a finding may be what a rejected glint has left over.

A glint on the line is rejected where its samples leave the ring, as a glint, as a second line, as outliers or
by their width, but not where it runs into the line: samples at its rim stay, and depart from the wall. Where
many glints lie on the line, two rings show such rims in the same place by chance, and the parts of two glints
at one place confirm each other. Other light that most rings show at an azimuth, as a second line that stays
in the picture, is no glint, and says nothing of the finding.
"""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Bool, Float, Int
from pipeline.artefacts.measured import NOT_THE_LINE, RingSamples, RingValidity
from stages.defects.relief import Relief
from stages.defects.segment import Region
from stages.defects.surface import Surface, cells_of

# A fifth of a ring's samples suffices for it to show a finding (`stages.defects.corroborate`): where a fifth
# was rejected as light that is not the line, its rim may be all that the others show.
_OTHER_SHARE = 0.2
# Other light stays at an azimuth of the picture if half of all rings show it there (chosen): glints show at
# 3 % of the samples of footage with seven in a picture.
_STAYS = 0.5
# A few of a ring's samples have no point on the wall. As points are counted, places are then known to 2°.
# With more than one in 200, a part of the ring lies beyond the surface's rows.
_LOST_SHARE = 0.005


def without_glints(frames: Int, region: Region, surface: Surface, rings: RingSamples | None) -> Int:
    """Return those of ``frames`` (n,) whose rings had no or few samples of other light in a region.

    All are returned without ``rings``; a ring that extends beyond the surface's rows is always returned.
    """
    if rings is None:
        return frames
    other = np.isin(rings.validity, NOT_THE_LINE)
    passing = other & (other.mean(0) < _STAYS)
    share = [_other_share(int(frame), region, surface, rings, passing) for frame in frames]
    clear = [of_ring < _OTHER_SHARE for of_ring in share]
    return np.asarray(frames[np.array(clear, bool)])


def _other_share(frame: int, region: Region, surface: Surface, rings: RingSamples, passing: Bool) -> float:
    """Return how many of a ring's samples in a region are ``passing`` (F, A), over these and valid ones."""
    points, its = surface.near, surface.near.frame == frame
    ring = int(np.searchsorted(rings.frame, frame))
    validity = rings.validity[ring]
    used, other = np.flatnonzero(validity == RingValidity.VALID), np.flatnonzero(passing[ring])
    if not len(other) or its.sum() < (1 - _LOST_SHARE) * len(used):
        return 0.0
    # points are in the order of their ring's samples
    used = used[np.linspace(0, len(used) - 1, int(its.sum())).round().astype(int)]
    turn = points.azimuth_rad[its].astype(float) - rings.azimuth_rad[used]
    beyond = np.angle(np.exp(1j * (turn - turn[0])))
    there = turn[0] + np.interp(other, used, beyond, period=len(validity))
    rejected = _in_columns(rings.azimuth_rad[other] + there, region, surface.relief)
    kept = int(cells_of(points, surface.relief, region)[2][its].sum())
    return rejected / max(rejected + kept, 1)


def _in_columns(azimuth_rad: Float, region: Region, relief: Relief) -> int:
    """Return how many azimuths (n,) lie in the columns of a region."""
    step = float(relief.azimuth_rad[1] - relief.azimuth_rad[0])
    column = np.rint((azimuth_rad - relief.azimuth_rad[0]) / step).astype(np.int64) - region.column
    column %= len(relief.azimuth_rad)
    its = np.flatnonzero(region.mask.any(0))
    return int(np.isin(column, its).sum())
