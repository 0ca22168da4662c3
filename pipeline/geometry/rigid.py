"""Rigid motions as 4 × 4 matrices; ``T_ba`` maps frame A to frame B.

Formulas: J. Solà et al., "A micro Lie theory for state estimation in robotics", 2018, §§ B and D.
"""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Float


def skew(w: Float) -> Float:
    """Return (..., 3, 3) cross-product matrices of vectors ``w`` (..., 3)."""
    w = np.asarray(w, float)
    out = np.zeros((*w.shape[:-1], 3, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -w[..., 2], w[..., 1], -w[..., 0]
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = w[..., 2], -w[..., 1], w[..., 0]
    return out


def rotation_from_vector(w: Float) -> Float:
    """Return (..., 3, 3) rotations of rotation vectors ``w`` (..., 3), rad (Rodrigues)."""
    w = np.asarray(w, float)
    t2 = np.sum(w * w, -1)[..., None, None]
    t = np.sqrt(t2)
    small = t2 < 1e-8
    safe = np.where(small, 1.0, t)
    a = np.where(small, 1 - t2 / 6, np.sin(safe) / safe)
    b = np.where(small, 0.5 - t2 / 24, (1 - np.cos(safe)) / (safe * safe))
    k = skew(w)
    return np.asarray(np.eye(3) + a * k + b * (k @ k))


def vector_from_rotation(rotation: Float) -> Float:
    """Return (..., 3) rotation vectors, rad, of rotations (..., 3, 3) by less than π."""
    q = quaternion_from_rotation(rotation)
    w, v = q[..., :1], q[..., 1:]
    s = np.linalg.norm(v, axis=-1, keepdims=True)
    scale = np.where(s < 1e-9, 2.0, 2 * np.arctan2(s, w) / np.where(s < 1e-9, 1.0, s))
    return np.asarray(v * scale)


def quaternion_from_rotation(rotation: Float) -> Float:
    """Return (..., 4) unit quaternions (w ≥ 0, x, y, z) of rotations (..., 3, 3)."""
    m = np.asarray(rotation, float)
    d = np.stack([m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]], -1)
    trace = d.sum(-1)
    squares = np.concatenate([(1 + trace)[..., None], 1 + 2 * d - trace[..., None]], -1)
    best = np.argmax(squares, -1)
    big = np.sqrt(np.maximum(np.take_along_axis(squares, best[..., None], -1), 1e-300))
    wx, wy, wz = (m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1])
    xy, xz, yz = (m[..., 0, 1] + m[..., 1, 0], m[..., 0, 2] + m[..., 2, 0], m[..., 1, 2] + m[..., 2, 1])
    b2 = squares * 1.0
    rows = np.stack(
        [
            np.stack([b2[..., 0], wx, wy, wz], -1),
            np.stack([wx, b2[..., 1], xy, xz], -1),
            np.stack([wy, xy, b2[..., 2], yz], -1),
            np.stack([wz, xz, yz, b2[..., 3]], -1),
        ],
        -2,
    )
    q = np.take_along_axis(rows, best[..., None, None], -2)[..., 0, :] / (2 * big)
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    return np.asarray(np.where(q[..., :1] < 0, -q, q))


def inverse(T_ba: Float) -> Float:
    """Return ``T_ab`` (..., 4, 4)."""
    rotation = np.swapaxes(T_ba[..., :3, :3], -1, -2)
    out = np.zeros_like(T_ba)
    out[..., :3, :3] = rotation
    out[..., :3, 3] = -np.einsum("...ij,...j->...i", rotation, T_ba[..., :3, 3])
    out[..., 3, 3] = 1
    return out


def from_parts(rotation: Float, translation: Float) -> Float:
    """Return (..., 4, 4) from rotations (..., 3, 3) and translations (..., 3)."""
    out = np.zeros((*np.shape(rotation)[:-2], 4, 4))
    out[..., :3, :3], out[..., :3, 3], out[..., 3, 3] = rotation, translation, 1
    return out


def transform(T_ba: Float, xyz_a: Float) -> Float:
    """Return points (..., 3) of A in B."""
    return np.asarray(np.einsum("...ij,...j->...i", T_ba[..., :3, :3], xyz_a) + T_ba[..., :3, 3])


def perspective_pose(xyz: Float, plane: Float) -> Float | None:
    """Return the pose (4, 4) of points (N, 3) seen at ``plane`` (N, 2), z = 1, by SQPnP; None without one.

    OpenCV refuses points that are few or crowd together, as wrong focal lengths or detections make them.
    """
    import cv2  # who only moves points need not wait for it

    try:
        found, w, t = cv2.solvePnP(xyz, plane, np.eye(3), np.zeros(4), flags=cv2.SOLVEPNP_SQPNP)
    except cv2.error:
        return None
    if not found or not (np.isfinite(w).all() and np.isfinite(t).all()):
        return None
    return from_parts(rotation_from_vector(np.asarray(w[:, 0], float)), np.asarray(t[:, 0], float))
