"""Preliminary sections of a recording that is still being written: a circle through every ring.

Motion, wall and axis are known only once the recording is complete. Until then the probe's pose is not, so
every figure still contains its tilt and its offset from the pipe's axis.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.adjustment.normal_equations import covariance_of
from pipeline.adjustment.robust import basis_of, independent_count, spread_about_median
from pipeline.arrays import Float
from pipeline.errors import UnusableError
from pipeline.instrument.misalignment import fit_circle
from pipeline.instrument.probe import Probe
from pipeline.machine.stage import Context
from pipeline.recording.base import FrameTable, Recording
from stages.rings import RingParameters, extract_rings
from stages.triangulate import TriangulateParameters, triangulate_rings

# A quarter of the preview's 360 azimuths: a circle through less is badly determined.
_LEAST_POINTS = 90
_TRIANGULATE = TriangulateParameters(largest_departure=0.2)
# Harmonics of the pipe's shape, ovality among them, that are not taken for noise (chosen).
_HARMONICS = 4


@dataclass(frozen=True)
class PreliminarySection:
    """The circle through one frame's ring.

    Attributes
    ----------
    frame, time_s
    distance_mm : float
        By the encoder as it was read; NaN without one.
    diameter_mm, diameter_sigma_mm : float
        σ from the scatter of the points about the circle and from the probe's covariance; what a tilt of the
        probe makes of the ring is not in it.
    seen : float
        Share of the ring with a usable line.
    """

    frame: int
    time_s: float
    distance_mm: float
    diameter_mm: float
    diameter_sigma_mm: float
    seen: float


def preliminary_sections(
    recording: Recording, probe: Probe, after_frame: int, parameters: RingParameters, context: Context
) -> tuple[PreliminarySection, ...]:
    """Return the sections of the laser frames behind ``after_frame``; none where no ring can be used."""
    later = _behind(recording, after_frame)
    try:
        rings = extract_rings(later, probe, parameters, context)
    except UnusableError:
        return ()
    points = triangulate_rings(rings, probe, _TRIANGULATE, context)
    times = dict(zip(later.frames.frame.tolist(), later.frames.time_s.tolist(), strict=True))
    return tuple(
        section_of(int(frame), times[int(frame)], _reading(recording, times[int(frame)]), xyz, uv, probe)
        for frame, xyz, uv in zip(points.frame, points.xyz_c.astype(float), rings.pixels(), strict=True)
        if np.isfinite(xyz).all(-1).sum() >= _LEAST_POINTS
    )


def _behind(recording: Recording, after_frame: int) -> Recording:
    table = recording.frames
    new = table.frame > after_frame
    return replace(recording, frames=FrameTable(table.frame[new], table.time_s[new], table.illumination[new]))


def section_of(
    frame: int, time_s: float, distance_mm: float, xyz_c: Float, uv: Float, probe: Probe
) -> PreliminarySection:
    """Return the section of one frame, from points (A, 3), mm in C, and pixels (A, 2) of its ring.

    The circle is fitted twice, the second time without what lies off the first: deposits, branches.
    """
    there = np.isfinite(xyz_c).all(-1)
    xy = xyz_c[there, :2]
    centre, radius = fit_circle(xy)
    off = np.linalg.norm(xy - centre, axis=-1) - radius
    near = np.abs(off - np.median(off)) <= 3 * spread_about_median(off)
    centre, radius = fit_circle(xy[near])
    arm = xy[near] - centre
    sigma = 2 * float(np.hypot(_radius_sigma(arm), _calibration_sigma(probe, uv[there][near], arm)))
    return PreliminarySection(frame, time_s, distance_mm, 2 * radius, sigma, len(xy) / len(xyz_c))


def _radius_sigma(arm: Float) -> float:
    """Return the 1 σ of a circle's radius, from points about its centre (N, 2) in the order of the ring.

    The pipe's shape up to the fourth harmonic is taken out. It does not change the mean radius of a whole
    ring; where part of the ring is missing, the harmonics' own uncertainty counts.
    """
    azimuth, radius = np.arctan2(arm[:, 1], arm[:, 0]), np.linalg.norm(arm, axis=-1)
    design = basis_of(azimuth, _HARMONICS)
    noise = radius - design @ np.linalg.lstsq(design, radius, rcond=None)[0]
    variance = float(noise @ noise) / (len(arm) - design.shape[1])
    alike = len(noise) / independent_count(noise)
    return float(np.sqrt(variance * alike * covariance_of(design.T @ design)[0, 0]))


def _calibration_sigma(probe: Probe, uv: Float, arm: Float) -> float:
    """Return the 1 σ of the mean radius of points (N, 2) about their centre from the probe's covariance."""
    outward = arm / np.linalg.norm(arm, axis=-1, keepdims=True)
    by_parameters = np.einsum("nj,njp->p", outward, probe.triangulate_jacobian(uv)[1][:, :2]) / len(uv)
    return float(np.sqrt(by_parameters @ probe.covariance @ by_parameters))


def _reading(recording: Recording, time_s: float) -> float:
    encoder = recording.encoder
    if encoder is None or time_s > encoder.time_s[-1]:
        return float("nan")
    return float(np.interp(time_s, encoder.time_s, encoder.distance_mm))
