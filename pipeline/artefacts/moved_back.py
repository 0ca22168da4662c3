"""Decides whether ring samples that were moved back behind dirt on the window were displaced by dirt.

Dirt displaces the line at one azimuth of the image in all rings. A groove or seam along the pipe does the
same unless the probe rolls: then the wall behind the dirt changes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.ndimage import label

from pipeline.arrays import Bool, Float, Int
from pipeline.artefacts.measured import RingSamples, RingValidity, Trajectory
from pipeline.geometry.axis import distance_along, roll_at


def kept_by_roll(rings: RingSamples, trajectory: Trajectory) -> RingSamples:
    """Return the rings without samples that were moved back, unless the probe's roll confirms dirt.

    Samples were moved by the median departure of all rings. A feature of the wall that is as wide as the
    moved stretch of azimuths is seen there only while the probe rolls by that width: it determines the median
    only if half of the rings have rolls within that width.
    """
    if rings.moved_px is None:
        return rings
    moved, roll_rad = (rings.moved_px != 0) & rings.valid, _roll_of(rings, trajectory)
    width = _widths(moved.any(0)) * 2 * np.pi / moved.shape[1]
    unsure = [a for a in np.flatnonzero(width) if _half_within(roll_rad[moved[:, a]]) <= width[a]]
    lost = np.zeros_like(moved)
    lost[:, unsure] = moved[:, unsure]
    return replace(rings, validity=np.where(lost, np.uint8(RingValidity.OUT_OF_VIEW), rings.validity))


def _roll_of(rings: RingSamples, trajectory: Trajectory) -> Float:
    """Return azimuth in P minus azimuth in the image (F,), rad."""
    last = len(trajectory.frame) - 1
    T_pc = trajectory.T_pc[np.minimum(np.searchsorted(trajectory.frame, rings.frame), last)]
    return roll_at(trajectory.axis, distance_along(trajectory.axis, T_pc), T_pc)


def _widths(moved: Bool) -> Int:
    """Return the length of the stretch of moved azimuths that each of (A,) belongs to, 0 if not moved."""
    start = int(np.argmin(moved))
    stretch = label(np.roll(moved, -start))[0]
    count = np.bincount(stretch)
    count[0] = 0
    return np.asarray(np.roll(count[stretch], start))


def _half_within(angle: Float) -> float:
    """Return the width, rad, of the shortest arc in which at least half of the angles (n,) lie."""
    ordered = np.sort(angle % (2 * np.pi))
    further = -(-len(ordered) // 2) - 1
    ends = np.concatenate([ordered, ordered + 2 * np.pi])[further : further + len(ordered)]
    return float((ends - ordered).min())
