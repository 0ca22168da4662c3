"""Ring samples in pipe coordinates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Bool, Float, Int
from pipeline.artefacts.measured import RingPoints, RingSamples, RingValidity, Trajectory
from pipeline.geometry.axis import frames_at, to_pipe
from pipeline.instrument.probe import Probe


@dataclass(frozen=True)
class WallSamples:
    """Every ring sample on the wall; rows are laser frames, columns image azimuths.

    Attributes
    ----------
    frame : (F,) int
    valid : (F, A) bool
    xyz_p : (F, A, 3)
    distance_mm, azimuth_rad, radius_mm : (F, A)
        Pipe coordinates.
    sigma_mm : (F, A)
        1 σ of the radius from image noise.
    misalignment_mm : (F, A)
        Radius with the sheet taken as square to the camera, minus ``radius_mm``.
    section : (F, A, 3, 3)
        The pipe's section frame at each sample.
    """

    frame: Int
    valid: Bool
    xyz_p: Float
    distance_mm: Float
    azimuth_rad: Float
    radius_mm: Float
    sigma_mm: Float
    misalignment_mm: Float
    section: Float


@dataclass
class RingsOnWall:
    """All rings of a run; samples are worked out for some of them at a time."""

    probe: Probe
    rings: RingSamples
    points: RingPoints
    trajectory: Trajectory
    _last: tuple[Int, WallSamples] | None = None

    def samples(self, rows: Int) -> WallSamples:
        """Return the samples of some rings (n,); those asked for last are kept at hand."""
        if self._last is None or not np.array_equal(self._last[0], rows):
            self._last = None
            self._last = rows, wall_samples(self.probe, self.rings, self.points, self.trajectory, rows)
        return self._last[1]


def wall_samples(
    probe: Probe, rings: RingSamples, points: RingPoints, trajectory: Trajectory, rows: Int
) -> WallSamples:
    """Triangulate rings ``rows`` (n,) with the probe as found in the run and place the points on the wall."""
    frame, last = rings.frame[rows], len(trajectory.frame) - 1
    index = np.minimum(np.searchsorted(trajectory.frame, frame), last)
    T_pc = trajectory.T_pc[index]
    direction = np.stack([np.cos(rings.azimuth_rad), np.sin(rings.azimuth_rad)], -1)
    pixels = rings.centre_px + rings.radius_px[rows][..., None].astype(np.float64) * direction
    ray = probe.camera.unproject(pixels).ray
    xyz_p = _placed(T_pc, probe.laser.intersect(ray))
    s, psi, radius = to_pipe(trajectory.axis, xyz_p)
    uncorrected = to_pipe(trajectory.axis, _placed(T_pc, probe.laser.untilted().intersect(ray)))[2]
    section = frames_at(trajectory.axis, np.where(np.isfinite(s), s, 0.0))[1]
    outward = section[..., :, 0] * np.cos(psi)[..., None] + section[..., :, 1] * np.sin(psi)[..., None]
    noise_p = np.einsum("fij,faj->fai", T_pc[:, :3, :3], points.noise_direction[rows].astype(float))
    sigma = np.abs(np.sum(outward * noise_p, -1))
    known = trajectory.frame[index] == frame
    seen = rings.validity[rows] == RingValidity.VALID
    valid = seen & known[:, None] & np.isfinite(radius) & np.isfinite(sigma)
    return WallSamples(frame, valid, xyz_p, s, psi, radius, sigma, uncorrected - radius, section)


def _placed(T_pc: Float, xyz_c: Float) -> Float:
    """Return ring points (F, A, 3) of C in P."""
    return np.asarray(np.einsum("fij,faj->fai", T_pc[:, :3, :3], xyz_c) + T_pc[:, None, :3, 3])
