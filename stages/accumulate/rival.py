"""Uncertainty of the wall where pictures contradict the stated probe: what the one they demand changes."""

from __future__ import annotations

import numpy as np

from pipeline.adjustment.robust import basis_of
from pipeline.arrays import Float, Int
from pipeline.artefacts.motion import Rival
from stages.accumulate.grid import MapGrid
from stages.accumulate.survey import RingsOnWall, RingSurvey, nearest, wall_samples

_MOST_RINGS = 400
"""Rings for which it is computed at most, evenly along the run: a bound on time and memory alone."""
_HARMONICS = 4
"""Highest harmonic of the change around a ring: the errors of an instrument have no higher one."""


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
    own, its = on_wall.samples(rows), wall_samples(probe, on_wall.rings, on_wall.points, trajectory, rows)
    change_mm = np.where(own.valid & its.valid, its.radius_mm - own.radius_mm, np.nan)
    return np.array([_size(*ring) for ring in zip(own.azimuth_rad, change_mm, strict=True)])


def _size(azimuth_rad: Float, change_mm: Float) -> float:
    """Return the root mean square of a ring's change (A,), mm, beside its first harmonic."""
    seen = np.isfinite(change_mm)
    fit = np.linalg.lstsq(basis_of(azimuth_rad[seen], _HARMONICS), change_mm[seen], rcond=None)[0]
    return float(np.sqrt(fit[0] ** 2 + np.sum(fit[3:] ** 2) / 2))
