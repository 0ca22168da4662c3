"""Places inside the wall that no ring measured are told; ends, gaps that are bridged, and slits are none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.artefacts.measured import RadiusMap
from stages.accumulate.unmeasured import unmeasured_places, warn_of_unmeasured
from tests.quiet import quiet_context

RADIUS, ROWS, COLUMNS = 50.0, 9000, 360
CELL_MM = 2 * np.pi * RADIUS / COLUMNS


def wall(*, from_row: int = 4000, from_column: int = 100, rows: int = 0, columns: int = 0) -> RadiusMap:
    """Return a wall with a hole; its ends lie askew, as rings do."""
    radius = np.full((ROWS, COLUMNS), RADIUS, np.float32)
    askew = np.rint(20 + 12 * np.sin(np.linspace(0, 2 * np.pi, COLUMNS))).astype(int)
    for column, missing in enumerate(askew):
        radius[:missing, column] = radius[ROWS - missing :, column] = np.nan
    radius[from_row : from_row + rows, np.arange(from_column, from_column + columns) % COLUMNS] = np.nan
    none, azimuth = np.zeros_like(radius), np.linspace(-np.pi, np.pi, COLUMNS, endpoint=False)
    return RadiusMap(0.5 * np.arange(ROWS), azimuth, radius, none, none, none.astype(int), none)


@pytest.mark.parametrize("from_column", [100, COLUMNS - 4])
def test_a_place_that_was_passed_and_not_measured_is_told_once(from_column: int) -> None:
    told: list[str] = []
    hidden = wall(from_column=from_column, rows=14, columns=8)
    warn_of_unmeasured(hidden, RADIUS, 3.0, 1.3, replace(quiet_context(), warn=told.append))
    assert len(told) == 1
    assert "1 place inside the wall, 49 mm² in all, could not be measured: at 2004 mm" in told[0]
    assert "(7 mm along, 7 mm around)" in told[0]


@pytest.mark.parametrize(("rows", "columns"), [(0, 0), (2, 8), (40, 1)])
def test_ends_askew_gaps_and_slits_are_no_places(rows: int, columns: int) -> None:
    assert unmeasured_places(wall(rows=rows, columns=columns), RADIUS, 3.0) == []


def test_a_sector_hidden_all_along_is_a_place_of_each_lot_of_rows() -> None:
    found = unmeasured_places(wall(from_row=0, rows=ROWS, columns=9), RADIUS, 3.0)
    assert len(found) == 3
    assert sum(p.area_mm2 for p in found) == pytest.approx(9 * CELL_MM * ROWS / 2, rel=0.02)


@pytest.mark.parametrize(("spacing_mm", "told"), [(2.9, False), (4.0, True)])
def test_rings_too_far_apart_are_named_as_the_cause(spacing_mm: float, told: bool) -> None:
    """A pull at three times the speed lost two of three defects, and the window was to be cleaned."""
    words: list[str] = []
    sparse = wall(from_row=100, rows=4500, columns=COLUMNS)
    warn_of_unmeasured(sparse, RADIUS, 3.0, spacing_mm, replace(quiet_context(), warn=words.append))
    assert len(words) == 1
    assert ("rings are 4.0 mm apart" in words[0] and "50 % of the wall" in words[0]) is told
