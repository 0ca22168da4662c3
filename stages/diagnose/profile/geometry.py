"""Where the line lies in the pipe and how it moves, by frame and azimuth sector."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from pipeline.arrays import Bool, Float, Float32, Int
from pipeline.artefacts.measured import RingSamples
from pipeline.instrument.probe import Probe

_JUMP, _BEFORE, _AFTER = 0.006, 2, 3
_MOTION_ORDER = 3
_CLIPPED_SHARE = 0.2


@dataclass(frozen=True)
class LineGeometry:
    """The line by frame and sector, (F, S) each; NaN without enough samples.

    Attributes
    ----------
    azimuth_rad : (S,)
    radius_px, width_px, height
        Medians of the ring samples; width and height of samples that did not clip.
    radius_mm : distance from the optical axis.
    theta_rad : polar angle.
    px_per_mm
        Outward motion of the image for a step of 1 mm back along the axis: positive.
    speed_px_s
        Of the line's radius.
    steady : (F,) bool
        Whether the ring does not jump from bore to bore about this frame.
    """

    azimuth_rad: Float
    radius_px: Float
    width_px: Float
    height: Float
    radius_mm: Float
    theta_rad: Float
    px_per_mm: Float
    speed_px_s: Float
    steady: Bool


def line_geometry(
    rings: RingSamples,
    rows: Int,
    time_s: Float,
    azimuth_rad: Float,
    clipped: Float,
    probe: Probe,
) -> LineGeometry:
    """Return the geometry of the ring samples in ``rows``; ``clipped`` (F, S) is the share that clips."""
    sectors = len(azimuth_rad)
    valid = rings.valid[rows]
    radius = _medians(rings.radius_px[rows], valid, sectors)
    width = _medians(rings.width_px[rows], valid, sectors)
    height = _medians(rings.amplitude[rows], valid, sectors)
    direction = np.stack([np.cos(azimuth_rad), np.sin(azimuth_rad)], -1)
    xyz = probe.triangulate(rings.centre_px + radius[..., None] * direction)
    by_point = probe.camera.project_jacobian(xyz).by_point
    inward = -np.einsum("fsi,si->fs", by_point[..., 2], direction)
    middle = np.nanmedian(radius, axis=1)
    steady = _steady(middle)
    return LineGeometry(
        azimuth_rad, radius, np.where(clipped > _CLIPPED_SHARE, np.nan, width), height,
        np.hypot(xyz[..., 0], xyz[..., 1]), np.arctan2(np.hypot(xyz[..., 0], xyz[..., 1]), xyz[..., 2]),
        inward, _speed(radius, time_s, azimuth_rad, steady), steady,
    )  # fmt: skip


def _medians(values: Float32, valid: Bool, sectors: int) -> Float:
    """Return medians (F, S) of the valid ones of values (F, A), A a multiple of S."""
    parts = np.where(valid, values, np.nan).astype(float).reshape(len(values), sectors, -1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        return np.asarray(np.nanmedian(parts, axis=2))


def _steady(middle: Float) -> Bool:
    """Return (F,) false about frames between which the ring's median radius (F,) jumps."""
    steady = np.isfinite(middle)
    for k in np.flatnonzero(np.abs(np.diff(middle)) > _JUMP * middle[:-1]):
        steady[max(k - _BEFORE, 0) : k + _AFTER + 1] = False
    return steady


def _speed(radius: Float, time_s: Float, azimuth_rad: Float, steady: Bool) -> Float:
    """Return (F, S) px/s: splines through the low harmonics of every run of steady frames."""
    orders = np.arange(1, _MOTION_ORDER + 1)
    waves = np.outer(azimuth_rad, orders)
    basis = np.concatenate([np.ones((len(azimuth_rad), 1)), np.cos(waves), np.sin(waves)], axis=1)
    out = np.full(radius.shape, np.nan)
    for run in _runs(steady & (np.isfinite(radius).mean(1) > 0.7)):
        if len(run) < 4:
            continue
        parts = [
            np.linalg.lstsq(basis[g], r[g], rcond=None)[0] for r in radius[run] for g in [np.isfinite(r)]
        ]
        out[run] = CubicSpline(time_s[run], np.array(parts))(time_s[run], 1) @ basis.T
    return out


def _runs(good: Bool) -> list[Int]:
    """Return the indices of every run of neighbours that are all good."""
    index = np.flatnonzero(good)
    return np.split(index, np.flatnonzero(np.diff(index) > 1) + 1) if len(index) else []
