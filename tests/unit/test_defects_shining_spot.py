"""A bright spot of the wall stays in place as the line passes beside it; relief moves on with the line."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import numpy as np
import pytest

from pipeline.arrays import Float
from pipeline.artefacts.measured import RingSamples, RingValidity, Trajectory
from pipeline.geometry.axis import straight_axis
from pipeline.recording.base import Recording
from stages.defects.parallax import LitPictures
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
NO_RECORDING = cast(Recording, None)


def relief(radius_mm: Float | float = RADIUS) -> Relief:
    """Return a wall with a radius, or one for each row (S,)."""
    radius = np.broadcast_to(np.reshape(radius_mm, (-1, 1)), (len(DISTANCE), len(AZIMUTH)))
    wall = wall_of(DISTANCE, AZIMUTH, radius, 0.02)
    return smooth_shape_removed(wall.radius_map, DefectParameters()).rows(slice(0, len(DISTANCE)))


def pictures(line_mm: Float = LINE_MM) -> LitPictures:
    """Return pictures that are not read, of which the poses are known."""
    count = len(line_mm)
    T_pc = np.tile(np.eye(4), (count, 1, 1))
    T_pc[:, 2, 3] = line_mm - BASELINE_MM
    axis, frame = straight_axis(-40.0, 80.0), np.arange(count)
    poses = np.zeros((count, 6, 6))
    motion = Trajectory(frame, frame / 15.0, T_pc, poses, axis, RADIUS, 1.0, 0.01, 0.0, ())
    return LitPictures(NO_RECORDING, PROBE, motion)


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


def spots_in(shown: RingSamples, depth_mm: dict[int, float]) -> list[int]:
    row = int(LINE_MM[min(depth_mm)] / 0.5)
    region = Region(row, 2 * COLUMNS.start - 1, np.ones((6, 2 * (COLUMNS.stop - COLUMNS.start)), bool), 1.0)
    return frames_with_spots(region, max(depth_mm.values(), key=abs), relief(), shown, pictures())


def spots(depth_mm: dict[int, float], brightness: float, rejected: tuple[int, ...] = ()) -> list[int]:
    return spots_in(rings(depth_mm, brightness, rejected), depth_mm)


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


def test_a_spot_on_a_dark_patch_is_compared_with_the_line_beside_the_spot() -> None:
    """Beside the patch the line was brighter than the spot on it: corrosion of 9.0 mm, probability .98."""
    shown = rings(spot_depths(10, 11, 12), 4.0)
    shown.amplitude[:, COLUMNS.start - 15 : COLUMNS.stop + 15] /= 5
    row = int(LINE_MM[10] / 0.5)
    wide = Region(row, 2 * COLUMNS.start - 31, np.ones((6, 74), bool), 1.0)
    depth = max(spot_depths(10, 11, 12).values(), key=abs)
    assert frames_with_spots(wide, depth, relief(), shown, pictures()) == [10, 11, 12]


def test_a_spot_whose_edges_shine_is_not_compared_with_them() -> None:
    """The edges depart less than half as far as the spot; they counted as the line beside it."""
    shown, depths = rings(spot_depths(10, 11, 12), 4.0), spot_depths(10, 11, 12)
    for ring, depth in depths.items():
        for edge in (slice(COLUMNS.start - 4, COLUMNS.start), slice(COLUMNS.stop, COLUMNS.stop + 4)):
            shown.radius_px[ring, edge] = radius_px(BASELINE_MM, RADIUS + 0.4 * depth)
            shown.amplitude[ring, edge] *= 4.0
    wide = Region(int(LINE_MM[10] / 0.5), 2 * COLUMNS.start - 21, np.ones((6, 54), bool), 1.0)
    depth = max(depths.values(), key=abs)
    assert frames_with_spots(wide, depth, relief(), shown, pictures()) == [10, 11, 12]


def test_a_spot_is_found_in_a_long_finding_of_a_pipe_that_grows_wider() -> None:
    """The wall of each ring is that at its line: in the middle of the finding it was 1.1 mm wider."""
    wider = 0.2 * (np.array(LINE_MM) - LINE_MM[10])
    shown = rings(spot_depths(10, 11, 12), 4.0)
    plain = np.float32(radius_px(BASELINE_MM, RADIUS))
    own = np.array([radius_px(BASELINE_MM, RADIUS + w) for w in wider], np.float32)
    shown = replace(shown, radius_px=np.where(shown.radius_px == plain, own[:, None], shown.radius_px))
    long = Region(20, 2 * COLUMNS.start - 11, np.ones((70, 34), bool), 1.0)
    wall = relief(RADIUS + 0.2 * (DISTANCE - LINE_MM[10]))
    found = frames_with_spots(long, 1.5, wall, shown, pictures())
    assert set(found) >= {10, 11, 12}


@pytest.mark.parametrize("wild_px", [560.0, 600.0])
def test_light_far_beyond_the_wall_or_beside_the_laser_sheet_does_not_hide_a_spot(wild_px: float) -> None:
    """A line of sight at 560 px meets the laser sheet 1.4 m away, one at 600 px nowhere."""
    shown = rings(spot_depths(10, 11, 12), 4.0)
    shown.radius_px[10:13, COLUMNS.start] = wild_px
    shown.validity[10:13, COLUMNS.start] = RingValidity.OUTLIER
    assert spots_in(shown, spot_depths(10, 11, 12)) == [10, 11, 12]


def test_only_the_rings_of_a_finding_are_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each ring asked for the validity of all: a second a finding in a run of 100 000 rings."""

    def of_all(rings: RingSamples) -> None:
        raise AssertionError("reads all rings")

    monkeypatch.setattr(RingSamples, "valid", property(of_all))
    assert spots(spot_depths(10, 11, 12), 4.0) == [10, 11, 12]


@pytest.mark.timeout(15)
def test_a_finding_of_very_many_rings_is_looked_at_quickly() -> None:
    """Each light was compared with all others: 1600 rings took a minute."""
    line_mm = 10 + 0.02 * np.arange(1500)
    shown = rings({10: 1.5}, 4.0)
    many = [np.repeat(x[10:11], 1500, 0) for x in (shown.radius_px, shown.sigma_px, shown.width_px)]
    rest = [np.repeat(x[10:11], 1500, 0) for x in (shown.amplitude, shown.validity)]
    samples = RingSamples(np.arange(1500), IMAGE, shown.centre_px, *many, *rest)
    long = Region(16, 2 * COLUMNS.start - 1, np.ones((70, 14), bool), 1.0)
    assert frames_with_spots(long, 1.5, relief(), samples, pictures(line_mm)) == []
