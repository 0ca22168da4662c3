"""Pipe coordinates (distance, azimuth, radius) about a straight or curved axis."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from scipy.spatial import cKDTree

from pipeline.arrays import Float, read_only

_STEPS, _NEAR_MM = 6, 1e-7


@dataclass(frozen=True)
class PipeAxis:
    """The pipe's own, possibly curved, axis in P as a polyline with rotation-minimising frames.

    Attributes
    ----------
    distance_mm : (K,)
        Arc length, increasing, extended beyond the seen wall; distance 0 is next to the first camera.
    origin_p : (K, 3)
        Points of the axis in P.
    R_pa : (K, 3, 3)
        Columns: local x, y (section plane, azimuth atan2(y, x)) and tangent, in P.
    """

    distance_mm: Float
    origin_p: Float
    R_pa: Float


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
    origin, rotation = np.empty((s.size, 3)), np.empty((s.size, 3, 3))
    _frames(*_compiled(axis), read_only(s.ravel()), origin, rotation)
    return origin.reshape(*s.shape, 3), rotation.reshape(*s.shape, 3, 3)


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
    s = np.array(_nearest(axis, p), float).ravel()
    psi, radius = np.empty_like(s), np.empty_like(s)
    _locate(*_compiled(axis), read_only(p.reshape(-1, 3)), s, psi, radius)
    shape = p.shape[:-1]
    return s.reshape(shape), psi.reshape(shape), radius.reshape(shape)


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


def _compiled(axis: PipeAxis) -> tuple[Float, Float, Float]:
    """Return the axis as compiled functions take it: of one kind, so that they are compiled once."""
    return read_only(axis.distance_mm), read_only(axis.origin_p), read_only(axis.R_pa)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _frames(distance, origin, rotation, s, out_origin, out_rotation):  # type: ignore[no-untyped-def]
    """Write the axis' point and section frame at every distance ``s`` (N,)."""
    for n in range(len(s)):
        section_frame(distance, origin, rotation, s[n], out_origin[n], out_rotation[n])


@numba.njit(cache=True, nogil=True, error_model="numpy")
def section_frame(distance, origin, rotation, s, o, m):  # type: ignore[no-untyped-def]
    """Write point ``o`` (3,) and frame ``m`` (3, 3): z is kept, x made square to it."""
    k = min(max(np.searchsorted(distance, s) - 1, 0), len(distance) - 2)
    span = distance[k + 1] - distance[k]
    w = (s - distance[k]) / span
    inside = min(max(w, 0.0), 1.0) if w == w else w
    for i in range(3):
        o[i] = origin[k, i] + inside * (origin[k + 1, i] - origin[k, i])
        m[i, 0] = (1 - inside) * rotation[k, i, 0] + inside * rotation[k + 1, i, 0]
        m[i, 2] = (1 - inside) * rotation[k, i, 2] + inside * rotation[k + 1, i, 2]
    _normalise(m, 2)
    along = m[0, 0] * m[0, 2] + m[1, 0] * m[1, 2] + m[2, 0] * m[2, 2]
    for i in range(3):
        m[i, 0] -= along * m[i, 2]
    _normalise(m, 0)
    m[0, 1] = m[1, 2] * m[2, 0] - m[2, 2] * m[1, 0]
    m[1, 1] = m[2, 2] * m[0, 0] - m[0, 2] * m[2, 0]
    m[2, 1] = m[0, 2] * m[1, 0] - m[1, 2] * m[0, 0]
    for i in range(3):
        o[i] += (w - inside) * span * m[i, 2]


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _normalise(m, column):  # type: ignore[no-untyped-def]
    length = np.sqrt(m[0, column] ** 2 + m[1, column] ** 2 + m[2, column] ** 2)
    for i in range(3):
        m[i, column] /= length


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _locate(distance, origin, rotation, p, s, psi, radius):  # type: ignore[no-untyped-def]
    """Improve distances ``s`` (N,) of points (N, 3) in place; write their azimuths and radii."""
    o, m = np.empty(3), np.empty((3, 3))
    for n in range(len(s)):
        x, y = 0.0, 0.0
        for _ in range(_STEPS):
            section_frame(distance, origin, rotation, s[n], o, m)
            dx, dy, dz = p[n, 0] - o[0], p[n, 1] - o[1], p[n, 2] - o[2]
            x = m[0, 0] * dx + m[1, 0] * dy + m[2, 0] * dz
            y = m[0, 1] * dx + m[1, 1] * dy + m[2, 1] * dz
            ahead = m[0, 2] * dx + m[1, 2] * dy + m[2, 2] * dz
            s[n] += ahead
            if not abs(ahead) > _NEAR_MM:
                break
        psi[n], radius[n] = np.arctan2(y, x), np.hypot(x, y)
