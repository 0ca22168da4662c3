"""Exact image position of the laser line by root finding, without the renderer's kernels."""

from __future__ import annotations

from collections.abc import Callable, Sequence

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

# Image radii between which the ring is searched: off the centre's few px, to beyond the corner of 2 MP
# (1000 px).
_SEARCH_PX = (20.0, 900.0)
# Step of that search: finer than the image of any step of the wall that a scene may have.
_SEARCH_STEP_PX = 4.0
# 4 px halved 34 times is 2e-10 px; Newton's steps converge quadratically.
_BISECTIONS, _NEWTON = 34, 12
# Sheet rays around the turn: linear between nodes 0.25° apart errs by (0.25°)²/8 = 2.4e-6 of a first
# harmonic.
_SHEET_NODES = 1440


def exact_rings(truth: SceneTruth, frames: Sequence[int], azimuth_rad: Float, centre_px: Float) -> Float:
    """Return the image radius (F, A) of the line's mean about ``centre_px``, px, at image azimuths (A,).

    It is the first point of the sheet, counted from the laser, that lies on the wall; NaN where there is none
    in view. The wall may hide the point from the camera, which is not tested. A rolling shutter is modelled
    by row.
    """
    return np.stack([_ring(truth, frame, azimuth_rad, centre_px) for frame in frames])


def _ring(truth: SceneTruth, frame: int, azimuth_rad: Float, centre_px: Float) -> Float:
    outward = np.stack([np.cos(azimuth_rad), np.sin(azimuth_rad)], -1)

    def room(radius_px: Float) -> Float:
        return room_mm(truth, frame, centre_px + radius_px[..., None] * outward)

    low, high = _bracket(room, len(azimuth_rad))
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        inside = room(middle) > 0
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    return 0.5 * (low + high)


def _bracket(room: Callable[[Float], Float], count: int) -> tuple[Float, Float]:
    """Return the first radii between which the sheet passes into the wall; NaN where it never does."""
    radii = np.arange(*_SEARCH_PX, _SEARCH_STEP_PX)
    left = np.stack([room(np.full(count, radius)) for radius in radii])
    entering = (left[:-1] > 0) & (left[1:] <= 0)
    first = np.argmax(entering, axis=0)
    found = entering.any(axis=0)
    return np.where(found, radii[first], np.nan), np.where(found, radii[first + 1], np.nan)


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
