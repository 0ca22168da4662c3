"""What the instrument's uncertainty does to the radius: it is common to all rings and does not average away."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.artefacts import RingSamples, Trajectory
from pipeline.instrument.probe import Probe
from stages.accumulate.grid import MapGrid

Float = NDArray[np.float64]
_AZIMUTHS = 72
_RINGS = 24


def calibration_sigma(probe: Probe, rings: RingSamples, trajectory: Trajectory, grid: MapGrid) -> Float:
    """Return the 1 σ (S, A) of the radius from the probe's covariance.

    Computed on some rings and interpolated. The first harmonic of each change is taken out, because the pipe's
    axis follows the rings' centres.
    """
    azimuth = np.arange(_AZIMUTHS) * (2 * np.pi / _AZIMUTHS) - np.pi
    usable = np.flatnonzero(rings.valid.sum(1) > 0.3 * rings.valid.shape[1])
    some = usable[np.unique(np.linspace(0, len(usable) - 1, min(len(usable), _RINGS)).astype(int))]
    index = np.searchsorted(trajectory.frame, rings.frame[some])
    distance = trajectory.T_pc[index, 2, 3] + probe.laser.baseline_mm
    roll = np.arctan2(trajectory.T_pc[index, 1, 0], trajectory.T_pc[index, 0, 0])
    profiles = np.stack([_around(probe, rings, k, azimuth, t) for k, t in zip(some, roll, strict=True)])
    order = np.argsort(distance)
    at = np.clip(np.searchsorted(distance[order], grid.distance_mm), 1, max(len(some) - 1, 1))
    near = np.minimum(at - (grid.distance_mm - distance[order][at - 1] < _half(distance[order], at)), len(some) - 1)
    rows = profiles[order][near]
    wide = np.concatenate([rows, rows[:, :1]], 1)
    fine = (grid.azimuth_rad + np.pi) / (2 * np.pi / _AZIMUTHS)
    left = np.minimum(fine.astype(int), _AZIMUTHS - 1)
    part = fine - left
    return np.asarray(wide[:, left] * (1 - part) + wide[:, left + 1] * part)


def _half(distance: Float, at: NDArray[np.int64]) -> Float:
    return np.asarray((distance[np.minimum(at, len(distance) - 1)] - distance[at - 1]) / 2)


def _around(probe: Probe, rings: RingSamples, row: int, azimuth_p: Float, roll: float) -> Float:
    """Return the 1 σ of the radius at azimuths of P (72,) for one ring."""
    azimuth_c = (azimuth_p - roll + np.pi) % (2 * np.pi) - np.pi
    radius_px = float(np.median(rings.radius_px[row][rings.valid[row]]))
    outward = np.stack([np.cos(azimuth_c), np.sin(azimuth_c)], -1)
    by_parameters = probe.triangulate_jacobian(rings.centre_px + radius_px * outward)[1]
    change = np.einsum("ai,aip->ap", outward, by_parameters[:, :2])
    first = np.stack([np.cos(azimuth_c), np.sin(azimuth_c)], -1)
    change = change - first @ (first.T @ change) * (2 / len(azimuth_p))
    return np.sqrt(np.einsum("ap,pq,aq->a", change, probe.covariance, change))
