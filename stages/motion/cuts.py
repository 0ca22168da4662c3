"""Distances beyond a place where the recording was cut, joined or stored in another order."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.artefacts.measured import Trajectory
from pipeline.geometry.axis import distance_along, frames_at


def beyond_cuts(trajectory: Trajectory, cut: tuple[int, ...]) -> Trajectory:
    """Return the trajectory with what is not known of distances from the first frame of ``cut`` on.

    How far the probe went at a cut is not known: 1 σ is taken to be the whole length of the run (a choice),
    along the pipe in the poses' covariance.
    """
    if not cut:
        return trajectory
    distance_mm = distance_along(trajectory.axis, trajectory.T_pc)
    length_mm = float(np.ptp(distance_mm))
    _, R_pa = frames_at(trajectory.axis, distance_mm)
    way = np.zeros((len(distance_mm), 6))
    way[:, :3] = length_mm * R_pa[:, :, 2]
    way[trajectory.frame < min(cut)] = 0.0
    return replace(
        trajectory,
        covariance=trajectory.covariance + way[:, :, None] * way[:, None, :],
        distance_sigma_mm=float(np.hypot(trajectory.distance_sigma_mm, length_mm)),
    )
