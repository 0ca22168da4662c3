"""Uncertainty of the wall where pictures contradict the stated probe: what the one they demand changes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.arrays import Float, Int
from pipeline.artefacts.motion import Rival
from stages.accumulate.grid import MapGrid
from stages.accumulate.survey import RingsOnWall, RingSurvey, WallSamples, nearest, smooth_shape, wall_samples

_MOST_RINGS = 400
"""Rings for which it is computed at most, evenly along the run: a bound on time and memory alone."""


def rival_on(grid: MapGrid, on_wall: RingsOnWall, survey: RingSurvey) -> Float | None:
    """Return the 1 σ (S,), mm, of the radius from a contradicted probe; None if the pictures agree with it.

    It is the root mean square around a ring of what the probe and motion that the pictures demand would
    change, without the first harmonic, because the pipe's axis follows the rings' centres; if the pictures
    allow several, it is the largest. Both walls are computed, since the change is not linear: it is a product
    of the probe's error and the camera's tilt.
    """
    if not on_wall.trajectory.rivals:
        return None
    used = np.flatnonzero(survey.count)
    rows = used[np.unique(np.linspace(0, len(used) - 1, min(len(used), _MOST_RINGS)).astype(int))]
    size_mm = np.max([_changes(on_wall, rival, rows) for rival in on_wall.trajectory.rivals], axis=0)
    return np.asarray(size_mm[nearest(survey.middle_mm[rows], grid.distance_mm)])


def _changes(on_wall: RingsOnWall, rival: Rival, rows: Int) -> Float:
    """Return the size (n,), mm, of what a rival would change in rings ``rows`` (n,)."""
    trajectory = on_wall.trajectory.of_rival(rival)
    probe = on_wall.probe.as_found_in(trajectory)
    its = wall_samples(probe, on_wall.rings, on_wall.points, trajectory, rows)
    return sizes_of_change(on_wall.samples(rows), its)


def sizes_of_change(own: WallSamples, its: WallSamples) -> Float:
    """Return the root mean square (F,), mm, of a change over the seen part of rings, which are centred.

    A ring that is seen to less than a half is not centred, and the first harmonic of its change counts.
    """
    both = own.valid & its.valid
    change_mm = np.where(both, its.radius_mm - own.radius_mm, 0.0)
    shift_mm, _ = smooth_shape(replace(own, radius_mm=change_mm, valid=both))
    psi = np.where(both, own.azimuth_rad, 0.0)
    left = change_mm - shift_mm[:, :1] * np.cos(psi) - shift_mm[:, 1:] * np.sin(psi)
    return np.asarray(np.sqrt(np.sum(both * left**2, axis=1) / np.maximum(both.sum(1), 1)))
