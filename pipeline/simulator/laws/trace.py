"""Where the ring is seen, traced ray by ray without any table of the renderer, and what is made of it.

For straight pipes whose section does not change along the way: the bench's.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pipeline.arrays import Float
from pipeline.geometry.rigid import transform
from pipeline.simulator.instrument import TrueInstrument
from pipeline.simulator.rays import viewing_rays
from pipeline.simulator.sheet import sheet_table
from pipeline.simulator.truth import SceneTruth

_AZIMUTHS, _BISECTIONS, _WALL_STEPS = 144, 50, 8
_SEARCH_PX = (60.0, 560.0)


class TracedRing(NamedTuple):
    """A ring as it is and as it is read.

    Attributes
    ----------
    uv : (N, 2)
        Where the camera sees it, at evenly spaced image azimuths.
    xyz_c : (N, 3)
        The lit points of the wall.
    azimuth_rad, error_mm : (N,)
        Of the points that the stated instrument makes of ``uv``; radius about its axis, less the pipe's mean.
    """

    uv: Float
    xyz_c: Float
    azimuth_rad: Float
    error_mm: Float


def trace_ring(truth: SceneTruth, time_s: float = 0.0, azimuths: int = _AZIMUTHS) -> TracedRing:
    """Return the ring of a moment; with a rolling shutter each row is seen at its own."""
    instrument = truth.instrument_at(time_s)
    around = -np.pi + 2 * np.pi * np.arange(azimuths) / azimuths
    outward = np.stack([np.cos(around), np.sin(around)], -1)
    low, high = (np.full(azimuths, end) for end in _SEARCH_PX)
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        ahead = (
            _height(truth, instrument, time_s, truth.stated.camera.centre_px + middle[:, None] * outward)[0]
            > 0
        )
        low, high = np.where(ahead, middle, low), np.where(ahead, high, middle)
    uv = truth.stated.camera.centre_px + (0.5 * (low + high))[:, None] * outward
    read = truth.stated.triangulate(uv)
    error = np.hypot(read[:, 0], read[:, 1]) - float(truth.wall.radius_mm[0].astype(float).mean())
    point = _height(truth, instrument, time_s, uv)[1]
    return TracedRing(uv, point, np.arctan2(read[:, 1], read[:, 0]), error)


def _height(truth: SceneTruth, instrument: TrueInstrument, time_s: float, uv: Float) -> tuple[Float, Float]:
    """Return how far ahead of the sheet pixels (N, 2) see the wall, and the points (N, 3) in C."""
    origin, ray = viewing_rays(instrument.camera, uv)
    T_pc = truth.motion.pose(_row_time(instrument, time_s, uv[:, 1]), truth.wall.axis)
    R_pc = T_pc[:, :3, :3]
    way = _to_wall(truth, transform(T_pc, origin), np.einsum("nij,nj->ni", R_pc, ray))
    point = origin + way[:, None] * ray
    table = sheet_table((instrument.laser,))
    nodes = -np.pi + 2 * np.pi * np.arange(table.height.shape[1]) / table.height.shape[1]
    psi, q = np.arctan2(point[:, 1], point[:, 0]), np.hypot(point[:, 0], point[:, 1])
    base, slope = (np.interp(psi, nodes, part[0], period=2 * np.pi) for part in (table.height, table.slope))
    return point[:, 2] - base - q * slope, point


def _row_time(instrument: TrueInstrument, time_s: float, row: Float) -> Float:
    rows = instrument.camera.model.image_size[1]
    readout = instrument.shutter.readout_s if instrument.shutter.kind == "rolling" else 0.0
    return np.asarray(time_s + ((row + 0.5) / rows - 0.5) * readout)


def _to_wall(truth: SceneTruth, origin_p: Float, ray_p: Float) -> Float:
    """Return the way (N,) of rays in P to the wall, whose radius depends on the azimuth alone."""
    nodes, radii = truth.wall.shape.azimuth_rad, truth.wall.radius_mm[0].astype(float)
    o, d = origin_p[:, :2], ray_p[:, :2]
    a, b, c = np.sum(d * d, 1), np.sum(o * d, 1), np.sum(o * o, 1)
    radius = np.full(len(o), radii.mean())
    for _ in range(_WALL_STEPS):
        way = (np.sqrt(b * b + a * (radius**2 - c)) - b) / a
        x, y = (o + way[:, None] * d).T
        radius = np.interp(np.arctan2(y, x), nodes, radii, period=2 * np.pi)
    return np.asarray(way)
