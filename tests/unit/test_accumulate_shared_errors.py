"""Wall seen through dirt on the window, after correction, counts only where the probe rolls.

Its σ remains large.
"""

from __future__ import annotations

import tracemalloc
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pipeline.arrays import Float
from pipeline.artefacts.measured import RingSamples, Trajectory, Wall
from pipeline.artefacts.moved_back import kept_by_roll
from pipeline.geometry.axis import straight_axis
from pipeline.geometry.rigid import from_parts, rotation_from_vector
from pipeline.machine.scratch import Scratch
from stages.accumulate import AccumulateParameters, accumulate_wall
from stages.accumulate.grid import MapGrid
from stages.accumulate.shared_errors import shared_on_wall
from stages.rings.behind_dirt import set_right
from stages.triangulate import TriangulateParameters, triangulate_rings
from tests.drawn_run import BASELINE, RADIUS, rings_on_wall, round_wall, small_probe
from tests.quiet import quiet_context

RINGS, STEP_MM, AZIMUTHS, HALF = 80, 1.0, 360, 0.05  # HALF a width, rad, of the departure at azimuth 0
RIM_PX, RIM_MM = 0.6, 0.9  # at 108 px a pixel is 1.5 mm of a wall of 50 mm
ROLL, LITTLE = (
    0.6,
    0.15,
)  # rad, and half of the rings lie within half of it: more than three widths, and less than one


def motion(roll_rad: float) -> Trajectory:
    k = np.arange(RINGS)
    random = np.random.default_rng(1)
    turn = np.stack([0 * k, 0 * k, roll_rad * k / RINGS], -1)
    origin = np.stack([*random.normal(0, 0.5, (2, RINGS)), STEP_MM * k], -1)
    T_pc = from_parts(rotation_from_vector(turn), origin)
    axis = straight_axis(-50.0, STEP_MM * RINGS + 100)
    return Trajectory(k, k / 30, T_pc, np.zeros((RINGS, 6, 6)), axis, RADIUS, 1.0, 0.0, 0.0, ())


def near(azimuth: Float) -> Float:
    return np.asarray(np.abs((azimuth + np.pi) % (2 * np.pi) - np.pi) < HALF, float)


def seam(s: Float, psi: Float) -> Float:
    return RADIUS - 0.5 * near(psi)


def put_right(run: Trajectory, wall=round_wall, rim_px: float = 0.0) -> RingSamples:
    """Return rings whose line the rim of a drop moves, corrected as the rings stage does."""
    probe = small_probe()
    rings = rings_on_wall(probe, run.T_pc, run.frame, np.random.default_rng(0), wall, 0.05, AZIMUTHS)
    rings.radius_px[:] += rim_px * near(rings.azimuth_rad)
    radius_px = float(np.median(rings.radius_px))
    place = (rings.centre_px[0] + radius_px, rings.centre_px[1], 0.08 * radius_px)
    return set_right(rings, (place,), quiet_context())


def measured(roll_rad: float, wall=round_wall, rim_px: float = 0.0, shared_px: float | None = None) -> Wall:
    run, probe = motion(roll_rad), replace(small_probe(), covariance=np.zeros((20, 20)))
    rings = put_right(run, wall, rim_px)
    if shared_px is not None:
        rings = replace(rings, shared_px=(shared_px * near(rings.azimuth_rad)).astype(np.float32))
    points = triangulate_rings(rings, probe, TriangulateParameters(), quiet_context())
    chosen = AccumulateParameters(azimuth_samples=AZIMUTHS)
    return accumulate_wall(probe, rings, points, run, chosen, quiet_context())


def behind(wall: Wall, roll_rad: float) -> tuple[Float, Float]:
    """Return radius and σ of cells behind the middle of the departure, without the first and last rings."""
    of = wall.radius_map
    row = np.arange(20, len(of.distance_mm) - 20)
    roll = roll_rad * (of.distance_mm[row] - BASELINE) / (STEP_MM * RINGS)
    column = np.rint((roll + np.pi) / (2 * np.pi) * AZIMUTHS).astype(int) % AZIMUTHS
    return of.radius_mm[row, column], of.sigma_mm[row, column]


@pytest.mark.parametrize("roll_rad", [0.0, LITTLE])
def test_without_roll_the_wall_behind_dirt_is_unknown(roll_rad: float) -> None:
    """Formerly a seam behind dirt was levelled, and the wall there was reported as measured and sound."""
    radius, _ = behind(measured(0.0, seam), 0.0)
    assert np.isnan(radius).mean() > 0.9
    radius, _ = behind(measured(roll_rad, rim_px=RIM_PX), roll_rad)
    assert np.isnan(radius).mean() > 0.9


def test_with_roll_the_wall_behind_the_rim_of_a_drop_is_known_and_sigma_includes_the_whole_correction() -> (
    None
):
    """All rings share the error; when it was counted for each ring, it shrank in their mean."""
    moved = measured(ROLL, rim_px=RIM_PX)
    radius, sigma = behind(moved, ROLL)
    assert np.isfinite(radius).mean() > 0.95
    assert np.median(np.abs(radius - RADIUS)) < 0.06
    assert sigma.min() > RIM_MM
    clean = measured(ROLL).radius_map.sigma_mm
    assert np.nanmedian(moved.radius_map.sigma_mm) < 1.1 * np.nanmedian(clean)


def test_residual_errors_of_a_line_fixed_to_image_rows_do_not_average_out_over_rings() -> None:
    """This error was only in the σ of each ring, and shrank in their mean."""
    _, sigma = behind(measured(0.0, shared_px=RIM_PX), 0.0)
    assert sigma.min() > RIM_MM
    assert sigma.max() < 1.2 * RIM_MM
    _, elsewhere = behind(measured(0.0), 0.0)
    assert elsewhere.max() < 0.2 * RIM_MM


@pytest.mark.parametrize("roll_rad", [0.0, ROLL])
def test_points_of_the_wall_are_those_of_the_rings_selected_by_roll(roll_rad: float) -> None:
    """If their numbers differed, the defects stage could not look up the line's brightness at a finding."""
    run = motion(roll_rad)
    told = kept_by_roll(put_right(run, rim_px=RIM_PX), run)
    points = np.bincount(measured(roll_rad, rim_px=RIM_PX).cloud.frame, minlength=RINGS)
    np.testing.assert_array_equal(points, told.valid.sum(1))


def shared(distance_mm: Float, rows: int, columns: int, by_dirt: bool = True) -> Float:
    """Return the shared error on a map with rows of 1 mm, for samples at azimuth −π with an error of 1 mm."""
    sample = distance_mm[:, None]
    one = np.ones_like(sample)
    samples = SimpleNamespace(valid=one > 0, distance_mm=sample, azimuth_rad=-np.pi * one, sigma_mm=0.1 * one)
    rings = SimpleNamespace(
        rings=SimpleNamespace(
            moved_px=one if by_dirt else None, shared_px=None if by_dirt else one[0], sigma_px=0.1 * one
        ),
        samples=lambda which: SimpleNamespace(**{k: v[which] for k, v in vars(samples).items()}),
    )
    grid = MapGrid(np.arange(float(rows)), 2 * np.pi * np.arange(columns) / columns - np.pi)
    got = shared_on_wall(rings, grid, 3.0, Scratch())
    assert got is not None
    return got


@pytest.mark.parametrize("by_dirt", [True, False])
def test_shared_errors_spread_equally_everywhere_and_not_from_beyond_the_map(by_dirt: bool) -> None:
    """Formerly a sample beyond the map was counted on its first or last row."""
    got = shared(np.array([-40.0, 0.0, 508.0, 512.0, 515.0, 1500.0]), 1200, 8, by_dirt)
    row, column = np.nonzero(got)
    assert np.unique(column).tolist() == [0, 1, 7]
    assert np.unique(row).tolist() == [0, 1, 2, 3, *range(505, 519)]
    assert got.max() == pytest.approx(1.0)


def test_a_long_map_of_shared_errors_stays_on_the_disk() -> None:
    """Formerly all of it was copied into memory: 2.3 GB for 100 m of pipe."""
    rows, columns = 12_000, 720
    assert rows * columns * 4 > 1 << 25  # smaller ones are kept in memory
    tracemalloc.start()
    try:
        shared(np.array([5.0]), rows, columns)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < rows * columns * 4 / 4
