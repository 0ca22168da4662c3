"""How far a pixel's ray meets the laser sheet off the wall: exact, without the renderer's kernels."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import map_coordinates

from pipeline.arrays import Float
from pipeline.geometry.axis import to_pipe
from pipeline.geometry.rigid import transform
from pipeline.simulator.instrument import TrueInstrument
from pipeline.simulator.rays import viewing_rays
from pipeline.simulator.sheet import sheet_rays
from pipeline.simulator.truth import SceneTruth
from pipeline.simulator.wall.grid import Wall

# Newton's steps converge quadratically.
_NEWTON = 12
# Sheet rays around the turn: linear between nodes 0.25° apart errs by (0.25°)²/8 = 2.4e-6 of a first
# harmonic.
_SHEET_NODES = 1440


def room_mm(truth: SceneTruth, frame: int, uv: Float) -> Float:
    """Return the wall's radius less that of the sheet's points which pixels (A, 2) see; NaN without one.

    It is 0 where the line's mean lies on the wall.
    """
    time_s = float(truth.frames.time_s[frame])
    instrument = truth.instrument_at(time_s)
    point_c = _on_sheet(instrument, *viewing_rays(instrument.camera, uv))
    rows = instrument.camera.model.image_size[1]
    readout = instrument.shutter.readout_s if instrument.shutter.kind == "rolling" else 0.0
    seen_s = time_s + ((uv[:, 1] + 0.5) / rows - 0.5) * readout
    T_pc = truth.motion.pose(seen_s, truth.wall.axis)
    s, psi, r = to_pipe(truth.wall.axis, transform(T_pc, np.nan_to_num(point_c)))
    return np.where(np.isfinite(point_c[:, 2]), wall_radius(truth.wall, s, psi) - r, np.nan)


def _on_sheet(instrument: TrueInstrument, origin: Float, ray: Float) -> Float:
    """Return where viewing rays (A, 3) meet the sheet, in C: fixed-point steps of its azimuth."""
    nodes = -np.pi + 2 * np.pi * np.arange(_SHEET_NODES) / _SHEET_NODES
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
    """Return the way at which rays reach z = height + slope q, by steps of q."""
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
