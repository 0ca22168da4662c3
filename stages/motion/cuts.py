"""Distances beyond a place where the recording was cut, joined or stored in another order."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.artefacts.measured import Trajectory
from pipeline.geometry.axis import distance_along, frames_at


def beyond_cuts(trajectory: Trajectory, cut: tuple[int, ...], seen_mm: float) -> Trajectory:
    """Return the trajectory with what is not known of distances from the first frame of ``cut`` on.

    How far the probe went at a cut is not known. As no texture is common to the pictures on both sides, it
    was at least ``seen_mm``, the length of pipe in a picture: 1 σ is taken to be that, or the whole length of
    the run if larger (a choice), along the pipe in the poses' covariance and in the limits of pieces that
    the probe reached from there on.
    """
    if not cut:
        return trajectory
    distance_mm, behind = distance_along(trajectory.axis, trajectory.T_pc), trajectory.frame >= min(cut)
    sigma_mm = max(float(np.ptp(distance_mm)), seen_mm)
    _, R_pa = frames_at(trajectory.axis, distance_mm)
    way = np.zeros((len(distance_mm), 6))
    way[behind, :3] = sigma_mm * R_pa[behind, :, 2]
    first_mm = float(distance_mm[behind].min(initial=np.inf))
    pieces = [
        replace(p, sigma_mm=float(np.hypot(p.sigma_mm, sigma_mm))) if p.to_mm > first_mm else p
        for p in trajectory.pieces
    ]
    return replace(
        trajectory,
        covariance=trajectory.covariance + way[:, :, None] * way[:, None, :],
        distance_sigma_mm=float(np.hypot(trajectory.distance_sigma_mm, sigma_mm)),
        cut_sigma_mm=sigma_mm,
        pieces=tuple(pieces),
    )
