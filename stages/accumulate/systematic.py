"""Systematic part of the radius's σ: what neighbouring samples share, and what does not average out."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Float, Float32
from pipeline.artefacts.measured import RingSamples, RingValidity, Trajectory
from pipeline.artefacts.wall_map import FixedToProbe
from pipeline.geometry.axis import roll_at
from pipeline.instrument.probe import Probe
from stages.accumulate.grid import MapGrid
from stages.accumulate.survey import RingSurvey, nearest

# Azimuths, 5° apart: the instrument's errors are harmonics up to the fourth, and linear between nodes.
_AZIMUTHS = 72
# Rings for which the instrument's share is computed: at least so many, in long runs every 500th.
_RINGS, _EVERY = 24, 500


@dataclass(frozen=True)
class CalibrationSpread:
    """1 σ of the radius from the probe's covariance at some distances (K,), around the circle (K, 72)."""

    distance_mm: Float
    sigma_mm: Float

    def on(self, grid: MapGrid) -> Float:
        """Return the 1 σ (S, A): rows take the nearest distance, columns are interpolated."""
        rows = self.sigma_mm[nearest(self.distance_mm, grid.distance_mm)]
        wide = np.concatenate([rows, rows[:, :1]], 1)
        fine = (grid.azimuth_rad + np.pi) / (2 * np.pi / _AZIMUTHS)
        left = np.minimum(fine.astype(int), _AZIMUTHS - 1)
        part = fine - left
        return np.asarray(wide[:, left] * (1 - part) + wide[:, left + 1] * part)


def calibration_spread(
    probe: Probe, rings: RingSamples, trajectory: Trajectory, survey: RingSurvey
) -> CalibrationSpread:
    """Return the 1 σ of the radius from the instrument's uncertainty, computed for some rings.

    The first harmonic of each change is removed, because the pipe's axis follows the rings' centres.
    """
    azimuth = np.linspace(-np.pi, np.pi, _AZIMUTHS, endpoint=False)
    # Rings seen over less than 0.3 of the circle hardly determine the first harmonic to be removed (chosen).
    usable = np.flatnonzero(survey.seen > min(0.3, 0.99 * survey.seen.max()))
    count = min(len(usable), max(_RINGS, len(usable) // _EVERY))
    some = usable[np.unique(np.linspace(0, len(usable) - 1, count).astype(int))]
    index = np.searchsorted(trajectory.frame, rings.frame[some])
    roll = roll_at(trajectory.axis, survey.middle_mm[some], trajectory.T_pc[index])
    knock = trajectory.knock
    after = probe if knock is None else probe.after(knock)
    first = np.inf if knock is None else knock.frame
    probes = [probe if rings.frame[k] < first else after for k in some]
    profiles = [_around(p, rings, k, azimuth, t) for p, k, t in zip(probes, some, roll, strict=True)]
    drift = np.full(len(some), trajectory.radius_doubt * trajectory.radius_mm)
    if trajectory.image_scale_sigma is not None:
        by_scale = [_by_scale(probe, rings, k) for k in some]
        drift = np.hypot(drift, np.array(by_scale) * trajectory.image_scale_sigma[index])
    return CalibrationSpread(survey.middle_mm[some], np.hypot(np.stack(profiles), drift[:, None]))


def _by_scale(probe: Probe, rings: RingSamples, row: int) -> float:
    """Return the change of a ring's radius, mm, per relative change of the picture's scale."""
    outward = np.stack([np.cos(rings.azimuth_rad), np.sin(rings.azimuth_rad)], -1)
    radius_px = float(np.median(rings.radius_px[row][rings.valid[row]]))
    by_pixel = probe.triangulate_jacobian(rings.centre_px + radius_px * outward)[0][:, :2]
    return radius_px * float(np.mean(np.einsum("ai,aij,aj->a", outward, by_pixel, outward)))


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


@dataclass(frozen=True)
class Systematic:
    """All systematic parts of the radius's σ; a part that the run does not have is None.

    Attributes
    ----------
    instrument : CalibrationSpread
        From the probe's uncertainty.
    displaced_mm : (S,)
        What displaces the picture for a while.
    fixed : FixedToProbe or None
        What stays at one place of the image, which is a part of what displaces the picture.
    rival_mm : (S,) or None
        From a probe that the pictures contradict.
    shared_mm : (S, A) or None
        Error that all rings share.
    """

    instrument: CalibrationSpread
    displaced_mm: Float
    fixed: FixedToProbe | None
    rival_mm: Float | None
    shared_mm: Float32 | None

    def on(self, grid: MapGrid, rows: slice) -> Float:
        """Return the 1 σ, mm, in some rows of the map, (n, A)."""
        out = self.instrument.on(grid.rows(rows.start, rows.stop))
        for part in self._others(rows):
            out = np.hypot(out, part)
        return out

    def _others(self, rows: slice) -> Iterator[Float | Float32]:
        displaced = self.displaced_mm[rows, None]
        yield displaced if self.fixed is None else np.maximum(displaced, self.fixed.departure_mm[rows])
        if self.rival_mm is not None:
            yield self.rival_mm[rows, None]
        if self.shared_mm is not None:
            yield self.shared_mm[rows]
