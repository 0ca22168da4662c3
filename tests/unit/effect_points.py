"""Points of a line and of texture in one bore, on which effects are predicted."""

from dataclasses import replace

import numpy as np

from pipeline.instrument.camera.fisheye import KannalaBrandt
from pipeline.instrument.laser import LaserSheet
from pipeline.instrument.probe import Probe
from tests.unit.wall_points import Bore, ring_points, texture_points

BORE = Bore(42.0, (4.0, -7.0, 0.0), (0.03, -0.02, 1.0))


def known_probe():
    camera = KannalaBrandt((1600, 1200), (366.1, 366.1), (800.0, 600.0), (-0.0118, 0.0008, -0.0008, 0.0))
    laser = LaserSheet(23.4, 3e-4, -2e-4, cone_rad=-2e-4)
    return Probe(camera, laser, np.zeros((20, 20)))


def line(count=72):
    points = ring_points(known_probe(), BORE, count)
    slope = 0.2 * np.sin(3 * points.azimuth_rad)
    return replace(points, albedo_slope_per_mm=slope, distance_mm=np.full(count, 20.0))


def texture():
    points = texture_points(known_probe(), BORE)
    return replace(points, distance_mm=np.full(len(points.uv), 37.0))
