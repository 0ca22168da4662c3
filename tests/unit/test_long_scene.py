"""The benchmark's long pipes have the requested length, and no two metres are equal."""

from __future__ import annotations

import numpy as np

from pipeline.simulator.motion import motion_of
from pipeline.simulator.scene import read_scene
from tests.benchmarks.bench_long_run import TEMPLATE
from tests.benchmarks.long_scene import lengthened


def test_all_parts_of_a_scene_are_made_longer() -> None:
    metre = read_scene(TEMPLATE)
    long = lengthened(metre, 4)
    last_s = (long.frames - 1) / long.frame_rate
    way_mm = float(motion_of(long.motion, last_s).distance_mm.at(np.array(last_s)))
    assert 3900 < way_mm < 4100 < long.pipe.to_mm
    assert [w.distance_mm for w in long.pipe.welds] == [500.0, 2500.0]
    assert len(long.pipe.defects) == 4 * len(metre.pipe.defects)
    assert len({(d.azimuth_deg, d.depth_mm) for d in long.pipe.defects}) == len(long.pipe.defects)
    assert all(-180 <= d.azimuth_deg < 180 for d in long.pipe.defects)
