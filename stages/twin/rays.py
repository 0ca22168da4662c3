"""Intersection of rays with the wall of a run."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from pipeline.arrays import Bool, Float, Float32
from pipeline.geometry.axis_kernels import section_frame
from stages.texture.surface import WallSurface

_STEPS, _CLOSE_MM = 12, 2e-3
"""Newton steps of a ray toward the wall, and the gap, mm, at which they end: 2 µm is 0.01 px at the ring."""
_MET = 20
"""A ray that did not converge still counts as meeting the wall up to this many times that gap."""
_FAR_RADII = 12.0
"""A ray that meets no wall within so many radii leaves through the pipe's open end."""
_LEAST_APPROACH = 1e-3
"""Sine of the angle to the axis below which a ray is treated as parallel to the pipe."""


@dataclass(frozen=True)
class WallSight:
    """Wall points that rays meet; NaN where a ray meets none.

    Attributes
    ----------
    distance_mm, azimuth_rad : (N,) float32
        Position in the pipe.
    xyz_c, normal_c : (N, 3)
        Point, mm, and inward unit normal in C.
    """

    distance_mm: Float32
    azimuth_rad: Float32
    xyz_c: Float
    normal_c: Float

    @property
    def seen(self) -> Bool:
        """(N,) whether the ray meets the wall."""
        return np.isfinite(self.distance_mm)


def wall_seen(surface: WallSurface, T_pc: Float, ray_c: Float) -> WallSight:
    """Return where unit rays (N, 3) in C from a camera pose T_pc (4, 4) meet the wall; NaN for none."""
    count = len(ray_c)
    place, point, normal = np.full((count, 2), np.nan), np.full((count, 3), np.nan), np.zeros((count, 3))
    axis, step = surface.axis, float(surface.distance_mm[1] - surface.distance_mm[0])
    _meet(
        axis.distance_mm, axis.origin_p, axis.R_pa, surface.radius_mm, surface.along, surface.around,
        float(surface.distance_mm[0]), step, surface.mean_radius_mm, np.ascontiguousarray(T_pc, float),
        np.ascontiguousarray(ray_c, float), place, point, normal,
    )  # fmt: skip
    return WallSight(place[:, 0].astype(np.float32), place[:, 1].astype(np.float32), point, normal)


@numba.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _bilinear(values, row, column):  # type: ignore[no-untyped-def]
    """Return a map's value at fractional row (held at the ends) and column (around the pipe)."""
    rows, columns = values.shape
    row = min(max(row, 0.0), rows - 1.0)
    i = min(int(row), rows - 2)
    j = int(np.floor(column))
    u, v = row - i, column - j
    j %= columns
    k = j + 1 if j + 1 < columns else 0
    return (1 - u) * ((1 - v) * values[i, j] + v * values[i, k]) + u * (
        (1 - v) * values[i + 1, j] + v * values[i + 1, k]
    )


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _section_of(axis_at, axis_origin, axis_frame, p, s, o, m, at):  # type: ignore[no-untyped-def]
    """Return a point's (3,) distance along the axis from a guess; writes its section and x, y there."""
    section_frame(axis_at, axis_origin, axis_frame, s, o, m)
    s += m[0, 2] * (p[0] - o[0]) + m[1, 2] * (p[1] - o[1]) + m[2, 2] * (p[2] - o[2])
    for k in range(2):
        at[k] = m[0, k] * (p[0] - o[0]) + m[1, k] * (p[1] - o[1]) + m[2, k] * (p[2] - o[2])
    return s


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _step(at, r, d, m, slope, gap, way, mean):  # type: ignore[no-untyped-def]
    """Return how far to go along a ray ``d`` (3,) for its radius to equal the wall's."""
    ax = m[0, 0] * d[0] + m[1, 0] * d[1] + m[2, 0] * d[2]
    ay = m[0, 1] * d[0] + m[1, 1] * d[1] + m[2, 1] * d[2]
    az = m[0, 2] * d[0] + m[1, 2] * d[1] + m[2, 2] * d[2]
    outward = (at[0] * ax + at[1] * ay) / r if r > 0 else np.sqrt(ax * ax + ay * ay)
    if outward < _LEAST_APPROACH and gap > 0:
        return mean  # inside and moving toward the axis: the ray meets the wall on the far side
    rate = max(outward - slope * az, 0.3 * outward)
    return min(max(gap / rate, -0.5 * way), 2.0 * mean)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _write_normal(at, r, m, along, around, normal):  # type: ignore[no-untyped-def]
    """Write the inward unit normal (3,) in P of wall with slopes ``along`` and ``around``."""
    c, s = at[0] / r, at[1] / r
    size = 1.0 / np.sqrt(1.0 + along * along + around * around)
    for i in range(3):
        outward, turning = c * m[i, 0] + s * m[i, 1], c * m[i, 1] - s * m[i, 0]
        normal[i] = (around * turning + along * m[i, 2] - outward) * size


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _meet(  # type: ignore[no-untyped-def]
    axis_at, axis_origin, axis_frame, radius, along, around, s_from, s_step, mean, T_pc, rays, place, point,
    normal,
):  # fmt: skip
    """Follow every ray by Newton steps to where its radius is the wall's, from its neighbour's result.

    ``place`` (N, 2) gets distance, mm, and azimuth, rad; ``point`` and ``normal`` (N, 3) are in C, as
    ``rays`` are.
    """
    o, m, at, p = np.empty(3), np.empty((3, 3)), np.empty(2), np.empty(3)
    d, inward, start = np.empty(3), np.empty(3), T_pc[:3, 3].copy()
    columns, far = radius.shape[1], _FAR_RADII * mean
    home = _section_of(axis_at, axis_origin, axis_frame, start, start[2], o, m, at)
    way, s = -1.0, home
    for n in range(len(rays)):
        if not np.isfinite(rays[n, 0]):
            continue
        if not 0.0 < way < far:
            way, s = mean, home
        for i in range(3):
            d[i] = T_pc[i, 0] * rays[n, 0] + T_pc[i, 1] * rays[n, 1] + T_pc[i, 2] * rays[n, 2]
        gap, r, psi, row, column = np.inf, 1.0, 0.0, 0.0, 0.0
        for _ in range(_STEPS):
            for i in range(3):
                p[i] = start[i] + way * d[i]
            s = _section_of(axis_at, axis_origin, axis_frame, p, s, o, m, at)
            r, psi = np.sqrt(at[0] * at[0] + at[1] * at[1]), np.arctan2(at[1], at[0])
            row, column = (s - s_from) / s_step, (psi + np.pi) / (2 * np.pi) * columns
            gap = _bilinear(radius, row, column) - r
            if abs(gap) < _CLOSE_MM or way > far:
                break
            way += _step(at, r, d, m, _bilinear(along, row, column), gap, way, mean)
        if not abs(gap) < _MET * _CLOSE_MM or way > far:
            way = -1.0
            continue
        place[n, 0], place[n, 1] = s, psi
        _write_normal(at, r, m, _bilinear(along, row, column), _bilinear(around, row, column), inward)
        for i in range(3):
            point[n, i] = way * rays[n, i]
            normal[n, i] = T_pc[0, i] * inward[0] + T_pc[1, i] * inward[1] + T_pc[2, i] * inward[2]
