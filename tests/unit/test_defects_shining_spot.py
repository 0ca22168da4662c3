"""A bright spot of the wall stays in place as the line passes beside it; relief moves on with the line."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.artefacts.measured import RingSamples, RingValidity, Trajectory
from pipeline.geometry.axis import straight_axis
from stages.defects.parameters import DefectParameters
from stages.defects.relief import Relief, smooth_shape_removed
from stages.defects.segment import Region
from stages.defects.shining_spot import frames_with_spots
from tests.synthetic_wall import wall_of
from tests.unit.wall_points import BASELINE_MM, plain_probe

RADIUS, STEP = 38.0, 1.2
DISTANCE, AZIMUTH = np.arange(0, 60, 0.5), -np.pi + np.arange(720) * np.pi / 360
IMAGE = -np.pi + np.arange(360) * np.pi / 180
COLUMNS = slice(240, 247)
LINE_MM = 10 + STEP * np.arange(30)
SPOT_MM = float(LINE_MM[10]) - 1.5
PROBE = plain_probe()


def relief() -> Relief:
    wall = wall_of(DISTANCE, AZIMUTH, np.full((len(DISTANCE), len(AZIMUTH)), RADIUS), 0.02)
    return smooth_shape_removed(wall.radius_map, DefectParameters()).rows(slice(0, len(DISTANCE)))


def motion() -> Trajectory:
    count = len(LINE_MM)
    T_pc = np.tile(np.eye(4), (count, 1, 1))
    T_pc[:, 2, 3] = LINE_MM - BASELINE_MM
    axis, frame = straight_axis(-40.0, 80.0), np.arange(count)
    return Trajectory(frame, frame / 15.0, T_pc, np.zeros((count, 6, 6)), axis, RADIUS, 1.0, 0.01, 0.0, ())


def radius_px(along_c_mm: float, radius_mm: float) -> float:
    """Return how far from the centre of the picture a point of the wall is seen."""
    uv = PROBE.camera.project(np.array([[radius_mm, 0.0, along_c_mm]])).uv
    return float(uv[0, 0] - PROBE.camera.centre_px[0])


def rings(depth_mm: dict[int, float], brightness: float, rejected: tuple[int, ...] = ()) -> RingSamples:
    """Return rings of which some show a depth (ring to mm) in the columns, so many times as bright."""
    shape = (len(LINE_MM), len(IMAGE))
    radius = np.full(shape, radius_px(BASELINE_MM, RADIUS), np.float32)
    amplitude, validity = np.full(shape, 40, np.float32), np.full(shape, RingValidity.VALID, np.uint8)
    for ring, depth in depth_mm.items():
        radius[ring, COLUMNS] = radius_px(BASELINE_MM, RADIUS + depth)
        amplitude[ring, COLUMNS] *= brightness
        validity[ring, COLUMNS] = RingValidity.OUTLIER if ring in rejected else RingValidity.VALID
    noise = np.full(shape, 0.1, np.float32)
    return RingSamples(
        np.arange(len(LINE_MM)),
        IMAGE,
        np.array(PROBE.camera.centre_px),
        radius,
        noise,
        noise,
        amplitude,
        validity,
    )


def spot_depths(*shown: int) -> dict[int, float]:
    """Return the depths at which a spot of the smooth wall is triangulated in the rings that show it."""
    return {k: RADIUS * BASELINE_MM / (BASELINE_MM + SPOT_MM - float(LINE_MM[k])) - RADIUS for k in shown}


def spots(depth_mm: dict[int, float], brightness: float, rejected: tuple[int, ...] = ()) -> list[int]:
    row = int(LINE_MM[min(depth_mm)] / 0.5)
    region = Region(row, 2 * COLUMNS.start - 1, np.ones((6, 2 * (COLUMNS.stop - COLUMNS.start)), bool), 1.0)
    deepest = max(depth_mm.values(), key=abs)
    return frames_with_spots(
        region, deepest, relief(), rings(depth_mm, brightness, rejected), PROBE, motion()
    )


def test_a_spot_beside_the_line_is_found_in_every_ring_that_shows_it() -> None:
    assert spots(spot_depths(10, 11, 12), 4.0) == [10, 11, 12]


def test_a_ring_whose_samples_were_rejected_tells_on_the_next_one() -> None:
    assert spots(spot_depths(10, 11), 4.0, rejected=(10,)) == [10, 11]


@pytest.mark.parametrize(
    "depth_mm", [{10: 0.5, 11: 1.5, 12: 0.5}, {10: -0.5, 11: -1.5, 12: -0.5}, {10: 1.5, 11: 1.5}]
)
def test_relief_however_bright_moves_on_with_the_line(depth_mm: dict[int, float]) -> None:
    assert spots(depth_mm, 4.0) == []


def test_a_flank_as_steep_as_the_line_of_sight_is_no_spot_unless_it_is_brighter_than_the_line() -> None:
    assert spots(spot_depths(10, 11), 1.0) == []
