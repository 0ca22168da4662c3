"""Pipe coordinates (distance, azimuth, radius) about a polyline axis, and back.

Between the axis' points the origin is interpolated linearly and the frame linearly, then made orthonormal
again with the tangent kept; a section is the plane through the origin normal to the tangent.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.artefacts import PipeAxis

Float = NDArray[np.float64]

_ITERATIONS = 20
_CONVERGED_MM = 1e-6


def axis_frame(axis: PipeAxis, distance_mm: Float) -> tuple[Float, Float]:
    """Return the axis' points (..., 3), mm in P, and frames R_pa (..., 3, 3) at ``distance_mm`` (...).

    Beyond its ends the axis goes on straight along the last segment.
    """
    s = np.asarray(distance_mm, float)
    i = np.clip(np.searchsorted(axis.distance_mm, s, side="right") - 1, 0, len(axis.distance_mm) - 2)
    t = ((s - axis.distance_mm[i]) / (axis.distance_mm[i + 1] - axis.distance_mm[i]))[..., None]
    origin = axis.origin_p[i] * (1 - t) + axis.origin_p[i + 1] * t
    u = np.clip(t, 0, 1)[..., None]
    return origin, _orthonormal(axis.R_pa[i] * (1 - u) + axis.R_pa[i + 1] * u)


def wall_points(axis: PipeAxis, distance_mm: Float, azimuth_rad: Float, radius_mm: Float) -> Float:
    """Return points (..., 3), mm in P, of pipe coordinates that broadcast against each other."""
    origin, frame = axis_frame(axis, distance_mm)
    x, y = radius_mm * np.cos(azimuth_rad), radius_mm * np.sin(azimuth_rad)
    return np.asarray(origin + x[..., None] * frame[..., :, 0] + y[..., None] * frame[..., :, 1])


def pipe_coordinates(axis: PipeAxis, xyz_p: Float) -> tuple[Float, Float, Float]:
    """Return distance (mm), azimuth (rad, atan2(y, x)) and radius (mm), each (...), of points (..., 3) in P.

    The section that holds a point is found by fixed-point iteration, which contracts while the radius is
    well below the axis' bend radius.
    """
    xyz = np.asarray(xyz_p, float)
    step = np.linalg.norm(axis.origin_p[-1] - axis.origin_p[0])
    chord = (axis.origin_p[-1] - axis.origin_p[0]) / step
    s = axis.distance_mm[0] + (xyz - axis.origin_p[0]) @ chord
    for _ in range(_ITERATIONS):
        origin, frame = axis_frame(axis, s)
        ahead = np.einsum("...i,...i->...", xyz - origin, frame[..., :, 2])
        s = s + ahead
        if np.nanmax(np.abs(ahead), initial=0.0) < _CONVERGED_MM:
            break
    origin, frame = axis_frame(axis, s)
    local = np.einsum("...ij,...i->...j", frame, xyz - origin)
    return s, np.arctan2(local[..., 1], local[..., 0]), np.hypot(local[..., 0], local[..., 1])


def _orthonormal(frame: Float) -> Float:
    """Return ``frame`` (..., 3, 3) with the third column's direction kept, the others made normal to it."""
    z = frame[..., :, 2] / np.linalg.norm(frame[..., :, 2], axis=-1, keepdims=True)
    x = frame[..., :, 0] - np.sum(frame[..., :, 0] * z, -1, keepdims=True) * z
    x = x / np.linalg.norm(x, axis=-1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], -1)
