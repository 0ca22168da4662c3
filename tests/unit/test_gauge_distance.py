"""Distance along a gauge whose pictures are too coarse for the borders of fiducials across it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stages.calibrate.gauge.adjust import NEAR_SIGMA, adjust
from tests.gauge_runs import USUAL, made_run, measured_run


def test_without_visible_borders_across_the_gauge_the_first_poses_keep_the_distance() -> None:
    given = measured_run(made_run(1))
    along = np.abs(given.measured.edges.outward_p[:, 2]) < 0.5
    measured = replace(given.measured, edges=given.measured.edges.select(along))
    found = adjust(given.start, measured, USUAL, enough=NEAR_SIGMA).state
    moved_mm = found.T_pc[given.posed, 2, 3] - given.start.T_pc[given.posed, 2, 3]
    assert np.abs(moved_mm).max() < 2.0
