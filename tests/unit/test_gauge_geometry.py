"""The gauge as points on its wall."""

import numpy as np

from stages.calibrate.gauge.geometry import gauge_of
from tests.gauge_runs import facts


def test_the_distance_to_the_nearest_fiducial_agrees_with_the_plain_formula() -> None:
    gauge, random = gauge_of(facts(), facts().fiducials), np.random.default_rng(5)
    s, a = random.uniform(-50, 300, 4000), random.uniform(-np.pi, np.pi, 4000)
    half, nearest = gauge.fiducials.size_mm / 2, np.full(4000, np.inf)
    for marker in gauge.fiducials.markers:
        along = np.maximum(np.abs(s - marker.distance_mm) - half, 0)
        turn = np.angle(np.exp(1j * (a - np.radians(marker.azimuth_deg))))
        around = np.maximum(np.abs(turn) * gauge.radius_mm[gauge.section(s)] - half, 0)
        nearest = np.minimum(nearest, np.hypot(along, around))
    assert (nearest == 0).any()
    np.testing.assert_allclose(gauge.from_fiducial_edge_mm(s, a), nearest, atol=1e-9)
