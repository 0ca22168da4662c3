"""Depths from few points: a bell, nothing that stands out, no point at all, or wall with larger scatter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.artefacts.measured import PointCloud
from stages.defects.clean import CleanWall
from stages.defects.depth import SHARPENING, Noise, _between_rings, fit_bell, measure_depth
from stages.defects.measure import is_measured
from stages.defects.relief import Relief, Typical
from stages.defects.segment import Region
from stages.defects.surface import DeviationPoints, Surface

_ROWS, _COLUMNS, _RADIUS_MM = 40, 720, 50.0


def relief() -> Relief:
    flat = np.zeros((_ROWS, _COLUMNS))
    azimuth = np.linspace(-np.pi, np.pi, _COLUMNS, endpoint=False)
    distance = 0.5 * np.arange(_ROWS)
    harmonics, typical = np.zeros((_ROWS, 5)), Typical(0.02, 0.02)
    return Relief(distance, azimuth, _RADIUS_MM, flat, flat, flat + 0.02, flat + 0.02, (), harmonics, typical)


def points(height_mm: float, rows_apart: float = 0.5, skew: float = 0.0) -> DeviationPoints:
    """Return a point every half column about the middle of the map, on a bell 2 mm wide, with noise.

    Askew, its half widths are 3 mm along and 0.8 mm around.
    """
    random = np.random.default_rng(0)
    row, column = (g.ravel() for g in np.meshgrid(np.arange(10, 30, rows_apart), np.arange(345, 375, 0.5)))
    x, y = (row - 20.5) * 0.5, (column - 360) * 2 * np.pi / _COLUMNS * _RADIUS_MM
    off = (x / 3) ** 2 + ((y - skew * x) / 0.8) ** 2 if skew else (x * x + y * y) / 4.0
    deviation = height_mm * np.exp(-off) + 0.01 * random.standard_normal(len(row))
    return DeviationPoints(np.zeros(1, np.int64), row, column, deviation, np.ones(len(row)), 2.0)


def noise(shared: bool = False) -> Noise:
    """Return noise of 0.01 mm, independent in every cell or shared by all."""
    random = np.random.default_rng(3)
    wall = np.full((_ROWS, _COLUMNS), 0.01) if shared else 0.01 * random.standard_normal((_ROWS, _COLUMNS))
    return Noise(CleanWall(wall, np.ones(wall.shape, bool), 1.0), 1.0, relief().cell_mm, 50, random)


def test_the_height_of_a_bell_is_found() -> None:
    found = fit_bell(relief(), Region(14, 350, np.ones((12, 20), bool), 1.0), points(1.0), noise())
    assert found is not None
    assert found.height_mm == pytest.approx(0.96, abs=0.04)


@pytest.mark.parametrize("skew", [1.0, -1.0])
def test_an_oblique_ridge_keeps_its_height_between_rings(skew: float) -> None:
    """With rings 2.5 mm apart, a bell along and around the pipe was reported as twice as high."""
    region = Region(12, 346, np.ones((16, 28), bool), 1.0)
    found = fit_bell(relief(), region, points(1.0, 5.0, skew), noise())
    assert found is not None
    x, y = np.meshgrid(*2 * [(np.arange(101) - 50) / 101])
    true = np.exp(-((x / 3) ** 2) - ((y - skew * x) / 0.8) ** 2).mean()
    assert found.height_mm == pytest.approx(true, abs=0.03)


def test_where_no_bell_fits_sigma_includes_that_the_peak_may_lie_between_rings() -> None:
    """A pit 3 mm wide between rings 1 mm apart was .33 ± .04 mm, and is .45 mm deep."""
    region, uneven = Region(14, 350, np.ones((12, 20), bool), 1.0), points(1.0)
    uneven = replace(uneven, deviation_mm=uneven.deviation_mm + 0.4 * np.sin(2 * uneven.column))
    depth, sigma = _between_rings(relief(), region, uneven, noise(), 0.4, 0.04)
    assert depth == 0.4
    assert sigma == pytest.approx(np.hypot(0.04, SHARPENING * 0.4))


def test_noise_that_points_share_is_part_of_the_sigma_of_a_height() -> None:
    region = Region(14, 350, np.ones((12, 20), bool), 1.0)
    apart, shared = (fit_bell(relief(), region, points(1.0), noise(which)) for which in (False, True))
    assert apart is not None
    assert shared is not None
    assert shared.sigma_mm > 3 * apart.sigma_mm


def test_where_no_point_stands_out_there_is_no_bell() -> None:
    sunk = points(0.0)
    below = replace(sunk, deviation_mm=sunk.deviation_mm - 0.5)
    region = Region(14, 350, np.ones((12, 20), bool), 1.0)
    assert fit_bell(relief(), region, below, noise()) is None
    assert fit_bell(relief(), region, sunk, noise()) is not None, "control: noise alone does stand out"


def test_a_finding_between_rings_without_any_points_is_not_measured() -> None:
    cloud = PointCloud(*[np.zeros((0, 3), np.float32)] * 2, *[np.zeros(0, np.float32)] * 4, np.zeros(0, int))
    unseen = np.full((_ROWS, _COLUMNS), np.nan)
    row = Region(14, 350, np.ones((1, 7), bool), -1.0)
    assert not is_measured(Surface(relief(), unseen, unseen, unseen, cloud, points(0.0)), row)
    unseen[14, 353] = 0.1
    assert is_measured(Surface(relief(), unseen, unseen, unseen, cloud, points(0.0)), row)


def test_where_the_map_is_noisier_the_sigma_of_a_depth_is_larger() -> None:
    """On rust in transcoded recordings, depths of .4 mm were .58 ± .06.

    The noise was taken to be as elsewhere.
    """
    noise = 0.02 * np.random.default_rng(1).standard_normal((_ROWS, _COLUMNS))
    clean = CleanWall(noise, np.ones(noise.shape, bool), 1.0)
    region, dent = Region(10, 300, np.ones((20, 40), bool), 1.0), np.zeros((_ROWS, _COLUMNS))
    dent[10:30, 300:340] = 0.4
    cloud = PointCloud(*[np.zeros((0, 3), np.float32)] * 2, *[np.zeros(0, np.float32)] * 4, np.zeros(0, int))

    def measured(times: float):  # type: ignore[no-untyped-def]
        wall = replace(relief(), noise_mm=np.where(dent > 0, 0.02 * times, 0.02))
        surface = Surface(wall, dent, dent, dent, cloud, points(0.0))
        return measure_depth(region, surface, clean, 200, np.random.default_rng(2))

    usual, unsure = measured(1.0), measured(3.0)
    assert unsure.bias_mm == pytest.approx(3 * usual.bias_mm, rel=0.1)
    assert unsure.sigma_mm > 1.3 * usual.sigma_mm
