"""Compiled loops behind `pipeline.geometry.axis`."""

from __future__ import annotations

import numba
import numpy as np

# Each step shrinks the error by distance from the axis over radius of curvature; 1e-7 mm is rounding.
_STEPS, _NEAR_MM = 6, 1e-7


@numba.njit(cache=True, nogil=True, error_model="numpy")
def frames(distance, origin, rotation, s, out_origin, out_rotation):  # type: ignore[no-untyped-def]
    """Write the axis' point and section frame at every distance ``s`` (N,)."""
    for n in range(len(s)):
        section_frame(distance, origin, rotation, s[n], out_origin[n], out_rotation[n])


@numba.njit(cache=True, nogil=True, error_model="numpy")
def section_frame(distance, origin, rotation, s, o, m):  # type: ignore[no-untyped-def]
    """Write point ``o`` (3,) and frame ``m`` (3, 3): z is kept, x made square to it."""
    k, above = 0, len(distance) - 1
    while above - k > 1:
        middle = (k + above) // 2
        k, above = (middle, above) if distance[middle] < s else (k, middle)
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
def locate(distance, origin, rotation, p, s, psi, radius):  # type: ignore[no-untyped-def]
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
