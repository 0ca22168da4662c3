"""Pipe coordinates (distance, azimuth, radius) about a straight or curved axis."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pipeline.artefacts import PipeAxis

Float = NDArray[np.float64]


def straight_axis(distance_from_mm: float, distance_to_mm: float) -> PipeAxis:
    """Return the z-axis of P between two distances, mm."""
    distance = np.array([distance_from_mm, distance_to_mm], float)
    origin = np.stack([0 * distance, 0 * distance, distance], -1)
    return PipeAxis(distance, origin, np.broadcast_to(np.eye(3), (2, 3, 3)).copy())


def axis_through(origin_p: Float, x_p: Float, distance_from_mm: float) -> PipeAxis:
    """Return the axis through points, with rotation-minimising frames by double reflection.

    W. Wang et al., "Computation of rotation minimizing frames", ACM TOG 2008.

    Parameters
    ----------
    origin_p : (K, 3)
        Points along the axis in P, mm.
    x_p : (3,)
        Direction in P to which the first frame's x is next.
    distance_from_mm : float
        Distance of the first point.
    """
    step = np.linalg.norm(np.diff(origin_p, axis=0), axis=1)
    distance = distance_from_mm + np.concatenate([[0.0], np.cumsum(step)])
    tangent = np.gradient(origin_p, distance, axis=0, edge_order=2 if len(distance) > 2 else 1)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    x = np.empty_like(origin_p)
    x[0] = x_p - tangent[0] * (tangent[0] @ x_p)
    x[0] /= np.linalg.norm(x[0])
    for k in range(len(x) - 1):
        v1 = origin_p[k + 1] - origin_p[k]
        x_mirrored = x[k] - 2 / (v1 @ v1) * (v1 @ x[k]) * v1
        t_mirrored = tangent[k] - 2 / (v1 @ v1) * (v1 @ tangent[k]) * v1
        v2 = tangent[k + 1] - t_mirrored
        x[k + 1] = x_mirrored - 2 * (v2 @ x_mirrored) / max(v2 @ v2, 1e-300) * v2
    return PipeAxis(distance, np.asarray(origin_p, float), np.stack([x, np.cross(tangent, x), tangent], -1))


def frames_at(axis: PipeAxis, distance_mm: Float) -> tuple[Float, Float]:
    """Return axis points (..., 3) and section frames (..., 3, 3) in P at distances (...).

    Linear between the axis' points and straight beyond its ends.
    """
    s = np.asarray(distance_mm, float)
    k = np.clip(np.searchsorted(axis.distance_mm, s) - 1, 0, len(axis.distance_mm) - 2)
    span = axis.distance_mm[k + 1] - axis.distance_mm[k]
    w = (s - axis.distance_mm[k]) / span
    inside = np.clip(w, 0, 1)[..., None, None]
    rotation = _orthonormal((1 - inside) * axis.R_pa[k] + inside * axis.R_pa[k + 1])
    chord = axis.origin_p[k + 1] - axis.origin_p[k]
    origin = axis.origin_p[k] + np.clip(w, 0, 1)[..., None] * chord
    beyond = (w - np.clip(w, 0, 1)) * span
    return origin + beyond[..., None] * rotation[..., :, 2], rotation


def from_pipe(axis: PipeAxis, distance_mm: Float, azimuth_rad: Float, radius_mm: Float) -> Float:
    """Return points (..., 3) in P of pipe coordinates (...), which are broadcast together."""
    _, psi, r = np.broadcast_arrays(distance_mm, azimuth_rad, radius_mm)
    origin, rotation = frames_at(axis, np.asarray(distance_mm, float))
    across = rotation[..., :, 0] * np.cos(psi)[..., None] + rotation[..., :, 1] * np.sin(psi)[..., None]
    return np.asarray(origin + r[..., None] * across)


def to_pipe(axis: PipeAxis, xyz_p: Float) -> tuple[Float, Float, Float]:
    """Return distance, azimuth and radius (each (...)) of points (..., 3) in P.

    The section is the one whose plane holds the point, found by fixed-point steps from the nearest axis
    point; this converges where the radius of curvature exceeds the point's distance from the axis.
    """
    p = np.asarray(xyz_p, float)
    s = _nearest(axis, p)
    for _ in range(6):
        origin, rotation = frames_at(axis, s)
        local = np.einsum("...ji,...j->...i", rotation, p - origin)
        s = s + local[..., 2]
        if not np.any(np.abs(local[..., 2]) > 1e-7):
            break
    return s, np.arctan2(local[..., 1], local[..., 0]), np.hypot(local[..., 0], local[..., 1])


def distance_along(axis: PipeAxis, T_pc: Float) -> Float:
    """Return distances (...) of poses (..., 4, 4) along the axis; where a pipe bends these are not z in P."""
    return to_pipe(axis, T_pc[..., :3, 3])[0]


def _nearest(axis: PipeAxis, p: Float) -> Float:
    """Return the distance of the axis point nearest along the overall direction of the axis."""
    if len(axis.distance_mm) == 2:
        tangent = axis.R_pa[0, :, 2]
        return np.asarray(axis.distance_mm[0] + (p - axis.origin_p[0]) @ tangent)
    flat = np.where(np.isfinite(p), p, 0.0).reshape(-1, 3)
    index = cKDTree(axis.origin_p).query(flat)[1]
    return np.asarray(axis.distance_mm[index].reshape(p.shape[:-1]))


def _orthonormal(m: Float) -> Float:
    """Return the frames with z kept and x made square to it."""
    z = m[..., :, 2] / np.linalg.norm(m[..., :, 2], axis=-1, keepdims=True)
    x = m[..., :, 0] - z * np.sum(z * m[..., :, 0], -1, keepdims=True)
    x = x / np.linalg.norm(x, axis=-1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], -1)
