"""Points of a round bore as an instrument sees them; rings are found by bisection along the image radius."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Float
from pipeline.instrument.camera.fisheye import Equidistant
from pipeline.instrument.laser import LaserSheet
from pipeline.instrument.probe import Probe
from stages.diagnose.effects.base import ImagePoints

FOCAL_PX, BASELINE_MM, CENTRE = 360.0, 22.0, (800.0, 600.0)


def plain_probe(laser: LaserSheet | None = None) -> Probe:
    """The instrument of the physics notes: equidistant, 360 px/rad, baseline 22 mm."""
    camera = Equidistant((1600, 1200), (FOCAL_PX, FOCAL_PX), CENTRE)
    return Probe(camera, laser or LaserSheet(BASELINE_MM), np.zeros((16, 16)))


@dataclass(frozen=True)
class Bore:
    """A straight round bore in C: its radius, a point of its axis and the axis' direction."""

    radius_mm: float
    on_axis_c: tuple[float, float, float] = (0.0, 0.0, 0.0)
    along_c: tuple[float, float, float] = (0.0, 0.0, 1.0)

    def away(self, xyz_c: Float) -> Float:
        """Return the vectors (M, 3) from the axis to points."""
        along = np.array(self.along_c) / np.linalg.norm(self.along_c)
        from_axis = xyz_c - np.array(self.on_axis_c)
        return from_axis - (from_axis @ along)[:, None] * along


def ring_radius_px(
    triangulate: Callable[[Float], Float], bore: Bore, azimuth_rad: Float, centre: Sequence[float] = CENTRE
) -> Float:
    """Return distances (M,) of the line from the stated centre, for an instrument with this triangulation."""
    low, high = np.full(len(azimuth_rad), 60.0), np.full(len(azimuth_rad), 520.0)
    for _ in range(60):
        middle = (low + high) / 2
        xyz = triangulate(pixels(middle, azimuth_rad, centre))
        inside = np.linalg.norm(bore.away(xyz), axis=1) < bore.radius_mm
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    return (low + high) / 2


def pixels(rho_px: Float, azimuth_rad: Float, centre: Sequence[float]) -> Float:
    return np.array(centre) + rho_px[:, None] * np.stack([np.cos(azimuth_rad), np.sin(azimuth_rad)], axis=1)


def ring_points(probe: Probe, bore: Bore, count: int = 360, time_s: float = 5.0) -> ImagePoints:
    """Return the line's points in a bore for the parameters of ``probe``."""
    azimuth = np.linspace(-np.pi, np.pi, count, endpoint=False)
    centre = probe.camera.centre_px
    rho = ring_radius_px(probe.triangulate, bore, azimuth, centre)
    xyz_c = probe.triangulate(pixels(rho, azimuth, centre))
    return image_points(probe, bore, xyz_c, on_line=True, time_s=time_s)


def texture_points(probe: Probe, bore: Bore, distance_mm: float = 40.0, count: int = 60) -> ImagePoints:
    """Return wall points in the plane z = ``distance_mm`` of C, which the line does not touch."""
    azimuth = np.linspace(-np.pi, np.pi, count, endpoint=False)
    flat = np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros(count)], axis=1) * bore.radius_mm
    centre = np.array(bore.on_axis_c) + distance_mm * np.array(bore.along_c)
    return image_points(probe, bore, flat + centre, on_line=False, time_s=5.0)


def image_points(probe: Probe, bore: Bore, xyz_c: Float, on_line: bool, time_s: float) -> ImagePoints:
    count = len(xyz_c)
    away = bore.away(xyz_c)
    return ImagePoints(
        probe=probe,
        frame=np.zeros(count, int),
        time_s=np.full(count, time_s),
        uv=probe.camera.project(xyz_c).uv,
        xyz_c=xyz_c,
        normal_c=away / np.linalg.norm(away, axis=1)[:, None],
        along_c=np.tile(np.array(bore.along_c) / np.linalg.norm(bore.along_c), (count, 1)),
        velocity_px=np.tile([30.0, -20.0], (count, 1)),
        speed_mm_s=np.full(count, 12.0),
        on_line=on_line,
        line_width_px=np.full(count, 1.2 if on_line else np.nan),
    )
