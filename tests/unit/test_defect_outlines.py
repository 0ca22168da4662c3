"""Outlines enclose an area, however slim the defect: the review draws them, and refuses any other."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from stages.defects.describe import _polygon

SLIM = {
    "one cell": ["#"],
    "along": ["#", "#", "#"],
    "around": ["####"],
    "aslant": ["#...", ".#..", "..#.", "...#"],
}


@pytest.mark.parametrize("cells", SLIM.values(), ids=SLIM)
def test_the_outline_of_a_region_one_cell_wide_runs_around_its_cells(cells: list[str]) -> None:
    mask = np.pad(np.array([[c == "#" for c in row] for row in cells], np.uint8), 1)
    polygon = _polygon(mask).astype(np.float32)
    assert len(polygon) >= 3
    assert 0.2 < cv2.contourArea(polygon) < mask.sum()
    for row, column in np.argwhere(mask):
        assert cv2.pointPolygonTest(polygon, (float(column), float(row)), False) >= 0


def test_the_outline_of_a_wide_region_runs_through_its_outer_cells() -> None:
    mask = np.pad(np.ones((4, 6), np.uint8), 1)
    np.testing.assert_array_equal(sorted(map(tuple, _polygon(mask))), [(1, 1), (1, 4), (6, 1), (6, 4)])
