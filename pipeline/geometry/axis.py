"""Pipe coordinates (distance, azimuth, radius) about a straight or curved axis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Float, read_only

_STRAIGHT = np.cos(np.radians(15))
"""Cosine of the largest angle to the chord at which an axis counts as nearly straight: the place abreast of a
point on the wall is then at most a quarter of a radius from the one across the axis."""


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
        Direction in P that the first frame's x comes nearest to.
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
    from pipeline.geometry import (
        axis_kernels,
    )  # Numba takes a second to load: who only reads an axis need not wait

    s = np.asarray(distance_mm, float)
    origin, rotation = np.empty((s.size, 3)), np.empty((s.size, 3, 3))
    axis_kernels.frames(*_compiled(axis), read_only(s.ravel()), origin, rotation)
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
    from pipeline.geometry import axis_kernels

    p = np.asarray(xyz_p, float)
    s = np.array(_nearest(axis, p), float).ravel()
    psi, radius = np.empty_like(s), np.empty_like(s)
    axis_kernels.locate(*_compiled(axis), read_only(p.reshape(-1, 3)), s, psi, radius)
    shape = p.shape[:-1]
    return s.reshape(shape), psi.reshape(shape), radius.reshape(shape)


def distance_along(axis: PipeAxis, T_pc: Float) -> Float:
    """Return distances (...) of poses (..., 4, 4) along the axis; where a pipe bends these are not z in P."""
    return to_pipe(axis, T_pc[..., :3, 3])[0]


def roll_at(axis: PipeAxis, distance_mm: Float, T_pc: Float) -> Float:
    """Return azimuth in P less azimuth in the image (N,), rad, of poses (N, 4, 4) at distances (N,)."""
    turn = np.swapaxes(frames_at(axis, distance_mm)[1], -1, -2) @ T_pc[:, :3, :3]
    return np.asarray(np.arctan2(turn[:, 1, 0], turn[:, 0, 0]))


def _nearest(axis: PipeAxis, p: Float) -> Float:
    """Return a distance (...) near that of each point (..., 3), from which `to_pipe` finds it.

    Where the axis is nearly straight, it is read off the projection on the chord, which takes a tenth of the
    time of a search for the nearest axis point.
    """
    if len(axis.distance_mm) == 2:
        tangent = axis.R_pa[0, :, 2]
        return np.asarray(axis.distance_mm[0] + (p - axis.origin_p[0]) @ tangent)
    chord = axis.origin_p[-1] - axis.origin_p[0]
    if np.all(axis.R_pa[:, :, 2] @ chord > _STRAIGHT * np.linalg.norm(chord)):
        return _by_chord(axis, p, chord / np.linalg.norm(chord))
    from scipy.spatial import cKDTree

    flat = np.where(np.isfinite(p), p, 0.0).reshape(-1, 3)
    index = cKDTree(axis.origin_p).query(flat)[1]
    return np.asarray(axis.distance_mm[index].reshape(p.shape[:-1]))


def _by_chord(axis: PipeAxis, p: Float, chord: Float) -> Float:
    """Return the distances (...) at which the axis is abreast of points (..., 3) along a unit ``chord``."""
    along = (axis.origin_p - axis.origin_p[0]) @ chord
    at = (np.asarray(p) - axis.origin_p[0]) @ chord
    beyond = np.minimum(at - along[0], 0.0) + np.maximum(at - along[-1], 0.0)
    return np.asarray(np.interp(at, along, axis.distance_mm) + beyond)


def _compiled(axis: PipeAxis) -> tuple[Float, Float, Float]:
    """Return the axis as compiled functions take it: of one kind, so that they are compiled once."""
    return read_only(axis.distance_mm), read_only(axis.origin_p), read_only(axis.R_pa)
