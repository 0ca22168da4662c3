"""Cells of frames and sectors: how bright lit wall and line are there, from synthetic pictures."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
from scipy.ndimage import map_coordinates

from stages.twin.cells import SECTORS, CellsOfFrames, sector_azimuth_rad, sectors_of
from stages.twin.line_light import _plain_line
from stages.twin.render import Region, TwinFrame
from stages.twin.sums import Sums


def test_sectors_begin_at_minus_pi():
    phi = sector_azimuth_rad().astype(np.float32)
    np.testing.assert_array_equal(sectors_of(phi), np.arange(SECTORS))


def test_a_displaced_line_is_not_darker():
    across = np.arange(-12.0, 13.0)[:, None] + np.zeros(360)
    sector = np.tile(np.arange(360) // 10, (25, 1))
    level = (100 * np.exp(-0.5 * across**2)).astype(np.float32)
    unknown = np.full(level.shape, np.nan, np.float32)
    region = np.where(np.abs(across) < 8, Region.LINE_CORE, Region.DARK).astype(np.uint8)
    twin = TwinFrame(level, np.full_like(level, 2.0), region, unknown, unknown)
    taken = CellsOfFrames()
    for shift in (0.0, 2.0):
        recorded = (80 * np.exp(-0.5 * (across - shift) ** 2)).astype(np.float32)
        taken.add_line(0, recorded, twin, np.inf, sector)
    np.testing.assert_allclose(taken.cells().log_ratio, np.log(0.8), atol=1e-3)


def test_light_beside_the_line_is_none_of_the_laser():
    """Lamps that stay on from the middle of a run on were a laser that gains 167 %."""
    random = np.random.default_rng(1)
    across = np.arange(-12.0, 13.0)[:, None] + np.zeros(720)
    sector = np.tile(np.arange(720) // 20, (25, 1))
    level = (30 * np.exp(-0.5 * across**2)).astype(np.float32)
    unknown = np.full(level.shape, np.nan, np.float32)
    region = np.where(np.abs(across) < 2, Region.LINE_CORE, Region.LINE_FLANK).astype(np.uint8)
    taken = CellsOfFrames()
    for frame in range(16):
        light = 20.0 if frame >= 8 else 0.0
        seen = np.round(level + light + random.standard_normal(level.shape)).astype(np.float32)
        taken.add_line(
            frame, seen, TwinFrame(level, np.ones_like(level), region, unknown, unknown), 250, sector
        )
    ratio = taken.cells().log_ratio
    assert abs(ratio[8:].mean() - ratio[:8].mean()) < 0.01
    assert ratio.std() < 0.05


def test_a_dim_sector_has_the_right_depth_and_width_though_the_rendered_line_contains_it():
    """One of .8 over 20° was .988 ± .085 over 10°: the rendered power falls between the sectors' middles."""
    degree = np.arange(-180.0, 180.0, 0.5) + 0.25
    sector = np.tile((degree + 180).astype(int) // 10, (3, 1))
    left = np.where(np.abs(degree - 60) < 10, 0.2, 1.0)
    even = np.full(sector.shape, 100.0, np.float32)
    line = replace(_plain_line(0.2, 0.8), log_power=np.log(left.reshape(SECTORS, -1).mean(1)))
    power = map_coordinates(line.log_power, [(degree + 180) / 10 - 0.5], order=1, mode="grid-wrap")
    level, unknown = (even * np.exp(power)).astype(np.float32), np.full(sector.shape, np.nan, np.float32)
    region = np.full(sector.shape, Region.LINE_CORE, np.uint8)
    taken = CellsOfFrames()
    for frame in range(8):
        twin = TwinFrame(level, np.full_like(level, 2.0), region, unknown, unknown)
        taken.add_line(frame, (even * left).astype(np.float32), twin, np.inf, sector)
    state = SimpleNamespace(line_is_clipped=False, lamp=None, line=line)
    _, cells = Sums.cells(SimpleNamespace(_state=state, lit=CellsOfFrames(), line=taken))
    np.testing.assert_allclose(cells.log_ratio[0], np.log(left.reshape(SECTORS, -1).mean(1)), atol=0.05)
