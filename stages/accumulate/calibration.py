"""Effect of the instrument's uncertainty on the radius: common to all rings, it does not average away."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Float, Int
from pipeline.artefacts.measured import RingSamples, RingValidity, Trajectory
from pipeline.geometry.axis import frames_at
from pipeline.instrument.probe import Probe
from stages.accumulate.grid import MapGrid
from stages.accumulate.survey import RingSurvey

# Azimuths, 5° apart: the instrument's errors are harmonics up to the fourth, and linear between nodes.
_AZIMUTHS = 72
# Rings at which the instrument's share is worked out: at least so many, on long runs every 500th.
_RINGS = 24
# See above.
_EVERY = 500


@dataclass(frozen=True)
class CalibrationSpread:
    """1 σ of the radius from the probe's covariance at some distances (K,), around the circle (K, 72)."""

    distance_mm: Float
    sigma_mm: Float

    def on(self, grid: MapGrid) -> Float:
        """Return the 1 σ (S, A): rows take the nearest distance, columns are interpolated."""
        rows = self.sigma_mm[_nearest(self.distance_mm, grid.distance_mm)]
        wide = np.concatenate([rows, rows[:, :1]], 1)
        fine = (grid.azimuth_rad + np.pi) / (2 * np.pi / _AZIMUTHS)
        left = np.minimum(fine.astype(int), _AZIMUTHS - 1)
        part = fine - left
        return np.asarray(wide[:, left] * (1 - part) + wide[:, left + 1] * part)


def calibration_spread(
    probe: Probe, rings: RingSamples, trajectory: Trajectory, survey: RingSurvey
) -> CalibrationSpread:
    """Return the 1 σ of the radius from the instrument's uncertainty, computed for some rings.

    The first harmonic of each change is taken out, because the pipe's axis follows the rings' centres.
    """
    azimuth = np.linspace(-np.pi, np.pi, _AZIMUTHS, endpoint=False)
    usable = np.flatnonzero(survey.seen > min(0.3, 0.99 * survey.seen.max()))
    count = min(len(usable), max(_RINGS, len(usable) // _EVERY))
    some = usable[np.unique(np.linspace(0, len(usable) - 1, count).astype(int))]
    index = np.searchsorted(trajectory.frame, rings.frame[some])
    section = frames_at(trajectory.axis, survey.middle_mm[some])[1]
    turn = np.swapaxes(section, 1, 2) @ trajectory.T_pc[index, :3, :3]
    roll = np.arctan2(turn[:, 1, 0], turn[:, 0, 0])
    profiles = [_around(probe, rings, k, azimuth, t) for k, t in zip(some, roll, strict=True)]
    return CalibrationSpread(survey.middle_mm[some], np.stack(profiles))


def _nearest(distance: Float, wanted: Float) -> Int:
    """Return for each wanted distance the index of the nearest of the distances, in any order."""
    order = np.argsort(distance, kind="stable")
    middle = (distance[order][1:] + distance[order][:-1]) / 2
    return np.asarray(order[np.searchsorted(middle, wanted)])


def _around(probe: Probe, rings: RingSamples, row: int, azimuth_p: Float, roll: float) -> Float:
    """Return the 1 σ of the radius at azimuths of P (72,) for one ring."""
    azimuth_c = (azimuth_p - roll + np.pi) % (2 * np.pi) - np.pi
    valid = rings.validity[row] == RingValidity.VALID
    radius_px = float(np.median(rings.radius_px[row][valid]))
    outward = np.stack([np.cos(azimuth_c), np.sin(azimuth_c)], -1)
    by_parameters = probe.triangulate_jacobian(rings.centre_px + radius_px * outward)[1]
    change = np.einsum("ai,aip->ap", outward, by_parameters[:, :2])
    first = np.stack([np.cos(azimuth_c), np.sin(azimuth_c)], -1)
    change = change - first @ (first.T @ change) * (2 / len(azimuth_p))
    return np.asarray(np.sqrt(np.einsum("ap,pq,aq->a", change, probe.covariance, change)))
