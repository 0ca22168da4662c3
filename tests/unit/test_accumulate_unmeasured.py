"""Unmeasured places inside the wall are reported; ends, bridged gaps and slits are not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import yaml

from pipeline.arrays import Float
from pipeline.artefacts.measured import RadiusMap
from stages.accumulate.unmeasured import LONG_GAP_MM, unmeasured_places, warn_of_unmeasured
from tests.quiet import quiet_context
from tests.shared_data import PROJECT_ROOT

RADIUS, ROWS, COLUMNS = 50.0, 9000, 360
CELL_MM = 2 * np.pi * RADIUS / COLUMNS


def wall(*, from_row: int = 4000, from_column: int = 100, rows: int = 0, columns: int = 0) -> RadiusMap:
    """Return a wall with a hole; its ends are oblique, as rings are."""
    radius = np.full((ROWS, COLUMNS), RADIUS, np.float32)
    askew = np.rint(20 + 12 * np.sin(np.linspace(0, 2 * np.pi, COLUMNS))).astype(int)
    for column, missing in enumerate(askew):
        radius[:missing, column] = radius[ROWS - missing :, column] = np.nan
    radius[from_row : from_row + rows, np.arange(from_column, from_column + columns) % COLUMNS] = np.nan
    none, azimuth = np.zeros_like(radius), np.linspace(-np.pi, np.pi, COLUMNS, endpoint=False)
    return RadiusMap(0.5 * np.arange(ROWS), azimuth, radius, none, none, none.astype(int), none)


def every(step_mm: float) -> Float:
    """Return rings along the whole wall."""
    return np.arange(0, ROWS / 2, step_mm)


def told_of(radius_map: RadiusMap, gap_mm: float, ring_at_mm: Float) -> list[str]:
    words: list[str] = []
    warn_of_unmeasured(radius_map, RADIUS, gap_mm, ring_at_mm, replace(quiet_context(), warn=words.append))
    return words


def between_rings(ring_at_mm: Float, reach_mm: float) -> RadiusMap:
    """Return a wall that is measured only near rings."""
    found = wall()
    far = np.abs(found.distance_mm[:, None] - np.unique(ring_at_mm)).min(1) > reach_mm
    found.radius_mm[far] = np.nan
    return found


@pytest.mark.parametrize("from_column", [100, COLUMNS - 4])
def test_a_place_that_was_passed_but_not_measured_is_reported_once(from_column: int) -> None:
    told: list[str] = []
    hidden = wall(from_column=from_column, rows=14, columns=8)
    warn_of_unmeasured(hidden, RADIUS, 3.0, every(1.3), replace(quiet_context(), warn=told.append))
    assert len(told) == 1
    assert "1 place inside the wall, 49 mm² in all, could not be measured: at 2004 mm" in told[0]
    assert "(7 mm along, 7 mm around)" in told[0]


@pytest.mark.parametrize(("rows", "columns"), [(0, 0), (2, 8), (40, 1)])
def test_oblique_ends_gaps_and_slits_are_not_reported(rows: int, columns: int) -> None:
    assert unmeasured_places(wall(rows=rows, columns=columns), RADIUS, 3.0) == []


def test_a_sector_hidden_along_the_whole_wall_is_reported_for_each_block_of_rows() -> None:
    found = unmeasured_places(wall(from_row=0, rows=ROWS, columns=9), RADIUS, 3.0)
    assert len(found) == 3
    assert sum(p.area_mm2 for p in found) == pytest.approx(9 * CELL_MM * ROWS / 2, rel=0.02)


THERE = np.arange(0, ROWS / 2, 4.0)
FAST = np.r_[np.arange(0, 3000, 2.0), np.arange(3000, ROWS / 2, 6.0)]


@pytest.mark.parametrize(
    ("ring_at_mm", "apart"),
    [
        (THERE, "4.0"),
        (np.r_[np.zeros(2000), THERE], "4.0"),
        (np.r_[THERE, THERE[::-1] + 0.2], "3.8"),
        (np.where(np.arange(1800) % 2, np.nan, every(2.5)), "5.0"),
        (FAST, "6.0"),
    ],
    ids=["steady", "rests for half of the time", "twice at the same places", "each second lost", "faster"],
)
def test_rings_too_far_apart_are_named_as_the_cause(ring_at_mm: Float, apart: str) -> None:
    """A pull at three times the speed lost two of three defects; the advice was to clean the window."""
    known = ring_at_mm[np.isfinite(ring_at_mm)]
    words = told_of(between_rings(known, 0.8), 3.0, ring_at_mm)
    assert len(words) == 1
    assert f"of the pipe the rings lie {apart} mm apart" in words[0]
    assert "--config long" in words[0]


@pytest.mark.parametrize(
    "ring_at_mm", [np.r_[THERE, THERE[::-1] + 2], np.r_[every(1.3)[:1500], every(1.3)[1600:]]]
)
def test_a_hidden_place_is_reported_where_the_rings_of_all_passes_together_are_close(
    ring_at_mm: Float,
) -> None:
    """Two passes have rings every 4 mm, together 2 mm; only "rings are 4 mm apart" was reported."""
    words = told_of(wall(rows=14, columns=8), 3.0, ring_at_mm)
    assert len(words) == 1
    assert "1 place inside the wall" in words[0]


def test_a_hidden_place_is_reported_beside_rings_too_far_apart() -> None:
    sparse = between_rings(FAST, 0.8)
    sparse.radius_mm[2000:2014, 100:108] = np.nan
    words = told_of(sparse, 3.0, FAST)
    assert ["lie 6.0 mm apart" in w for w in words] == [True, False]
    assert "1 place inside the wall" in words[1]
    assert "at 1004 mm" in words[1]


def test_a_larger_limit_for_bridging_is_advised_only_where_it_bridges_more() -> None:
    ring_at_mm = every(14.0)
    words = told_of(between_rings(ring_at_mm, 3.0), LONG_GAP_MM, ring_at_mm)
    assert len(words) == 1
    assert "lie 14.0 mm apart" in words[0]
    assert "--config" not in words[0]
    stated = yaml.safe_load((PROJECT_ROOT / "configs/long.yaml").read_text())
    assert stated["accumulate"]["largest_gap_mm"] == LONG_GAP_MM
