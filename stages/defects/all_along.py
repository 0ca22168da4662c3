"""Findings that run along all of the measured pipe: a seam, or a drop or scratch on the window.

Where the probe does not roll, both stay at one place of the image and of the wall, in every ring. What is
large is found in the image itself (`stages.accumulate.fixed`); a low ridge is not, but has as little proof.
"""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Float
from pipeline.artefacts.cloud_along import CloudAlong
from pipeline.artefacts.measured import Trajectory
from pipeline.geometry.axis import roll_at
from stages.defects.relief import WallRelief
from stages.defects.segment import Region

# Share of the measured rows that it covers, and how many times less it scatters on the wall than in the
# image if the probe's roll shows that it is on the wall: as for what is found in the image.
_COVERED, _CLEARLY = 0.8, 2.0


def may_be_on_window(region: Region, relief: WallRelief, cloud: CloudAlong, motion: Trajectory) -> bool:
    """Whether a finding runs along the whole measured pipe, and no roll shows that it is on the wall.

    It covers four fifths of the map's rows, and scatters in the image less than twice as much as on the wall.
    """
    rows, psi = relief.radius_map.distance_mm, relief.radius_map.azimuth_rad
    if region.all_round or len(region.mask) < _COVERED * len(rows):
        return False
    frame, at_mm = cloud.rings()
    row = np.rint((at_mm - rows[region.row]) / relief.cell_mm[0]).astype(np.int64)
    width = region.mask.sum(1)
    crosses = (row >= 0) & (row < len(width)) & (width[row.clip(0, len(width) - 1)] > 0)
    row, frame, at_mm = row[crosses], frame[crosses], at_mm[crosses]
    step = float(psi[1] - psi[0])
    on_wall = step * (region.mask[row] @ np.arange(region.mask.shape[1])) / width[row]
    poses = motion.T_pc[np.searchsorted(motion.frame, frame).clip(0, len(motion.frame) - 1)]
    in_image = on_wall - roll_at(motion.axis, at_mm, poses)
    # A row's middle is known to within its width.
    unsure = step * float(np.median(width[row])) / np.sqrt(12) if len(row) else np.inf
    return not np.hypot(_spread(in_image), unsure) > _CLEARLY * np.hypot(_spread(on_wall), unsure)


def _spread(angle: Float) -> float:
    """Return the standard deviation of angles (n,), rad, about their mean direction."""
    if not angle.size:
        return 0.0
    turn = np.exp(1j * angle)
    return float(np.std(np.angle(turn / turn.mean())))
