"""The laser's light as tables over azimuth: the sheet outside all windows, and its reflection by the wall.

`room_mm` gives, without tables or kernels, the distance from the wall at which a pixel's ray meets the sheet.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.ndimage import map_coordinates

from pipeline.arrays import Float
from pipeline.geometry.axis import to_pipe
from pipeline.geometry.rigid import transform
from pipeline.simulator.instrument import LineProfile, TrueInstrument, TrueLaser
from pipeline.simulator.kernel import kernel
from pipeline.simulator.raycast import first_hit, normal_at
from pipeline.simulator.rays import viewing_rays
from pipeline.simulator.surface import Surface
from pipeline.simulator.truth import SceneTruth, row_late_s
from pipeline.simulator.wall.grid import Wall
from pipeline.simulator.window import refracted

# Number of sheet rays: linear interpolation between nodes 0.25° apart errs by (0.25°)²/8 = 2.4e-6 of a first
# harmonic.
_NODES = 1440
# Nodes over about 11 σ: linear interpolation errs by (11/4000)²/8 = 1e-6 of the peak.
_PROFILE_NODES = 4001
# Precision of a hit, as for the line itself.
_CLOSE_MM = 2e-5


class SheetTable(NamedTuple):
    """A surface of light z = height(ψ) + q · slope(ψ) in C, with its brightness, at (T, N) nodes.

    Attributes
    ----------
    height, slope, weight : (T, N)
        At T moments of an exposure and N azimuths −π + k 2π/N.
    """

    height: Float
    slope: Float
    weight: Float


class ProfileTable(NamedTuple):
    """Density of light, 1/mm, over heights from ``low`` in steps of ``step``."""

    density: Float
    low: float
    step: float


def profile_table(profile: LineProfile) -> ProfileTable:
    """Return the profile as a table fine enough for linear interpolation."""
    low, high = profile.reach_mm()
    height = np.linspace(low, high, _PROFILE_NODES)
    return ProfileTable(profile.density(height), low, float(height[1] - height[0]))


def sheet_rays(laser: TrueLaser, azimuth_rad: Float) -> tuple[Float, Float]:
    """Return origins and unit directions (N, 3) in C of the sheet's rays, outside all windows."""
    slope = laser.sheet.slope(azimuth_rad)
    for wave in laser.waves:
        slope = slope + wave.cos_rad * np.cos(wave.order * azimuth_rad)
        slope = slope + wave.sin_rad * np.sin(wave.order * azimuth_rad)
    ray = np.stack([np.cos(azimuth_rad), np.sin(azimuth_rad), slope], -1)
    origin = np.zeros_like(ray)
    origin[..., 2] = laser.sheet.height(azimuth_rad)
    return refracted(laser.windows, origin, ray / np.linalg.norm(ray, axis=-1, keepdims=True))


def sheet_table(lasers: tuple[TrueLaser, ...]) -> SheetTable:
    """Return the sheet at several moments."""
    azimuth = -np.pi + 2 * np.pi * np.arange(_NODES) / _NODES
    tables = [_tabled(*sheet_rays(laser, azimuth), _weight(laser, azimuth), azimuth) for laser in lasers]
    return SheetTable(*(np.stack(part) for part in zip(*tables, strict=True)))


def ghost_table(surface: Surface, laser: TrueLaser, T_wc: Float, distance_mm: float) -> SheetTable | None:
    """Return the light that the wall reflects across the bore, for a camera at ``T_wc`` (3, 4).

    Each ray of the sheet is reflected where it hits the wall. Its weight is that of the line, times the
    reflected share and the density of reflected rays in azimuth. None where nothing is reflected.
    """
    if laser.ghost_relative <= 0:
        return None
    azimuth = -np.pi + 2 * np.pi * np.arange(_NODES) / _NODES
    origin, ray = sheet_rays(laser, azimuth)
    R, t = T_wc[:, :3], T_wc[:, 3]
    hits = np.full((_NODES, 9), np.nan)
    rays = np.concatenate([origin @ R.T + t, ray @ R.T], 1)
    _write_mirrored(surface, rays, distance_mm, np.empty((5, 3)), np.empty(6), np.empty(6), hits)
    second, onward = (hits[:, 3:6] - t) @ R, (hits[:, 6:9]) @ R
    final = np.unwrap(np.arctan2(second[:, 1], second[:, 0]))
    crowding = np.clip(np.abs(2 * np.pi / _NODES / np.gradient(final)), 0.0, 4.0)
    weight = laser.ghost_relative * _weight(laser, azimuth) * crowding
    along, across = onward[:, 2], np.hypot(onward[:, 0], onward[:, 1])
    q = np.hypot(second[:, 0], second[:, 1])
    slope = along / np.maximum(across, 1e-6)
    return _resampled(final, second[:, 2] - q * slope, slope, weight, azimuth)


def _weight(laser: TrueLaser, azimuth: Float) -> Float:
    cos, sin = laser.brightness
    weight = laser.power_mm * (1 + cos * np.cos(azimuth) + sin * np.sin(azimuth))
    for sector in laser.sectors:
        weight = weight * sector.left(azimuth)
    return np.asarray(weight)


def _tabled(origin: Float, ray: Float, weight: Float, azimuth: Float) -> tuple[Float, Float, Float]:
    """Return height, slope and weight over azimuth of rays that leave the axis nearly radially."""
    across = np.hypot(ray[:, 0], ray[:, 1])
    slope = ray[:, 2] / across
    height = origin[:, 2] - slope * np.hypot(origin[:, 0], origin[:, 1])
    final = np.arctan2(ray[:, 1], ray[:, 0])
    turned = azimuth + np.angle(np.exp(1j * (final - azimuth)))
    parts = (np.interp(azimuth, turned, part, period=2 * np.pi) for part in (height, slope, weight))
    height, slope, weight = parts
    return height, slope, weight


def _resampled(final: Float, height: Float, slope: Float, weight: Float, azimuth: Float) -> SheetTable:
    known = np.isfinite(final) & np.isfinite(height)
    if not known.any():
        return SheetTable(*(np.zeros((1, _NODES)) for _ in range(3)))
    parts = [
        np.interp(azimuth, final[known], part[known], period=2 * np.pi)[None]
        for part in (height, slope, weight)
    ]
    return SheetTable(*parts)


@kernel
def _write_mirrored(
    surface: Surface, rays: Float, s: float, room: Float, hit: Float, ray: Float, out: Float
) -> None:
    """Write first hit, second hit and direction between them (N, 9) of rays (N, 6) mirrored at the wall."""
    o, R, normal = room[0], room[1:4], room[4]
    for n in range(rays.shape[0]):
        for k in range(6):  # a slice might overlap, and numba would make an array for it
            ray[k] = rays[n, k]
        if not np.isfinite(ray.sum()) or not first_hit(surface, ray, s, _CLOSE_MM, o, R, hit):
            continue
        normal_at(surface, hit, R, normal)
        sink = 2.0 * (ray[3] * normal[0] + ray[4] * normal[1] + ray[5] * normal[2])
        for k in range(3):
            out[n, k] = ray[k] + hit[0] * ray[3 + k]
            ray[3 + k] -= sink * normal[k]
            ray[k] = out[n, k] + 0.02 * normal[k]
        if not first_hit(surface, ray, hit[1], _CLOSE_MM, o, R, hit):
            continue
        for k in range(3):
            out[n, 3 + k] = ray[k] + hit[0] * ray[3 + k]
            out[n, 6 + k] = ray[3 + k]


@kernel
def sheet_at(table: SheetTable, moment: float, azimuth: float) -> tuple[float, float, float]:
    """Return height, slope and weight at a moment (0 to 1 of the table's span) and an azimuth."""
    times, nodes = table.height.shape
    x = (azimuth + np.pi) * nodes / (2.0 * np.pi)
    j = int(x)
    wx = x - j
    j0, j1 = j % nodes, (j + 1) % nodes
    y = moment * (times - 1)
    i0 = min(int(y), times - 1)
    i1 = min(i0 + 1, times - 1)
    wy = y - i0
    height = _mix(table.height, i0, i1, j0, j1, wx, wy)
    slope = _mix(table.slope, i0, i1, j0, j1, wx, wy)
    return height, slope, _mix(table.weight, i0, i1, j0, j1, wx, wy)


@kernel
def _mix(values: Float, i0: int, i1: int, j0: int, j1: int, wx: float, wy: float) -> float:
    upper = (1.0 - wx) * values[i0, j0] + wx * values[i0, j1]
    if wy == 0.0:
        return float(upper)
    return float((1.0 - wy) * upper + wy * ((1.0 - wx) * values[i1, j0] + wx * values[i1, j1]))


@kernel
def density_at(table: ProfileTable, height: float) -> float:
    """Return the density of light at a height above the sheet; 0 outside the table."""
    x = (height - table.low) / table.step
    if not (x >= 0.0 and x < table.density.shape[0] - 1):
        return 0.0
    j = int(x)
    return float((1.0 - (x - j)) * table.density[j] + (x - j) * table.density[j + 1])


# Newton's steps converge quadratically.
_NEWTON = 12


def room_mm(truth: SceneTruth, frame: int, uv: Float) -> Float:
    """Return the wall's radius less that of the sheet's points which pixels (A, 2) see; NaN without one.

    It is 0 where the line's mean lies on the wall.
    """
    time_s = float(truth.frames.time_s[frame])
    instrument = truth.instrument_at(time_s)
    point_c = _on_sheet(instrument, *viewing_rays(instrument.camera, uv))
    seen_s = time_s + truth.late_s(instrument) + row_late_s(instrument, uv[:, 1])
    T_pc = truth.motion.pose(seen_s, truth.wall.axis)
    s, psi, r = to_pipe(truth.wall.axis, transform(T_pc, np.nan_to_num(point_c)))
    return np.where(np.isfinite(point_c[:, 2]), wall_radius(truth.wall, s, psi) - r, np.nan)


def _on_sheet(instrument: TrueInstrument, origin: Float, ray: Float) -> Float:
    """Return where viewing rays (A, 3) meet the sheet, in C: fixed-point steps of its azimuth."""
    nodes = -np.pi + 2 * np.pi * np.arange(_NODES) / _NODES
    start, way = sheet_rays(instrument.laser, nodes)
    slope = way[:, 2] / np.hypot(way[:, 0], way[:, 1])
    height = start[:, 2] - slope * np.hypot(start[:, 0], start[:, 1])
    leaves = np.arctan2(way[:, 1], way[:, 0])
    psi = np.arctan2(ray[:, 1], ray[:, 0])
    for _ in range(_NEWTON):
        h, k = (np.interp(psi, leaves, part, period=2 * np.pi) for part in (height, slope))
        with np.errstate(divide="ignore", invalid="ignore"):
            t = _distance_to_sheet(origin, ray, h, k)
        point = origin + t[:, None] * ray
        psi = np.arctan2(point[:, 1], point[:, 0])
    return np.where((t > 0)[:, None], point, np.nan)


def _distance_to_sheet(origin: Float, ray: Float, height: Float, slope: Float) -> Float:
    """Return the distance at which rays reach z = height + slope q, by iteration of q."""
    t = (height - origin[:, 2]) / ray[:, 2]
    for _ in range(_NEWTON):
        q = np.hypot(origin[:, 0] + t * ray[:, 0], origin[:, 1] + t * ray[:, 1])
        growth = np.hypot(ray[:, 0], ray[:, 1])
        t = t - (origin[:, 2] + t * ray[:, 2] - height - slope * q) / (ray[:, 2] - slope * growth)
    return np.asarray(np.where(ray[:, 2] - slope * np.hypot(ray[:, 0], ray[:, 1]) > 1e-9, t, np.nan))


def wall_radius(wall: Wall, distance_mm: Float, azimuth_rad: Float) -> Float:
    """Return the wall's radius (...) at distances and azimuths (...), linear between samples."""
    grid = wall.shape
    row = np.clip((distance_mm - grid.distance_from_mm) / grid.step_mm, 0, grid.rows - 1)
    column = (azimuth_rad + np.pi) * grid.columns / (2 * np.pi) + 0.5
    wide = np.concatenate([wall.radius_mm[:, -1:], wall.radius_mm, wall.radius_mm[:, :1]], 1)
    return np.asarray(map_coordinates(wide.astype(float), [row, column], order=1, mode="nearest"))
