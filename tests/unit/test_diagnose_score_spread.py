"""The variance of scores from errors that neighbours share, across cells of wall and without poses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from pipeline.adjustment.normal_equations import Marginal
from pipeline.adjustment.robust import cluster_variance
from pipeline.adjustment.rows import Rows
from pipeline.arrays import Float
from stages.calibrate.gauge.terms import WALL_CELL_MM, wall_cells
from stages.diagnose.gauge.elimination import eliminate_poses
from stages.diagnose.gauge.equations import RING, Equations, of_no_edge
from stages.diagnose.gauge.score_spread import beyond_cells, score_inflation

_DRAWS, _POINTS = 60, 6000


def drawn_scores(correlated: float) -> tuple[Float, Float, Float]:
    """Return the scores (D, K) of draws, their variance by cells, and the part between cells."""
    random = np.random.default_rng(0)
    wall = np.stack([random.uniform(0, 130, _POINTS), random.uniform(-80, 80, _POINTS)], -1)
    follow = np.stack([np.cos(wall[:, 1] / 25), np.cos(wall[:, 0] / 20 + 1)])
    weight, scores, cells, beyond = np.full(_POINTS, 4.0), [], [], []
    for _ in range(_DRAWS):
        # Linear between independent nodes half a cell apart, as print and stains are within some mm.
        nodes = random.normal(0, correlated, (64, 64))
        shared = map_coordinates(nodes, wall.T / (WALL_CELL_MM / 2), order=1, mode="grid-wrap")
        error = shared + random.normal(0, 0.5, _POINTS)
        scores.append(follow * weight @ error)
        cells.append(cluster_variance((follow * weight * error).T, wall_cells(wall)))
        beyond.append(beyond_cells(follow, weight, np.stack([error, error]), wall))
    return np.array(scores), np.mean(cells, 0), np.mean(beyond, 0)


def test_the_spread_of_scores_is_the_part_of_cells_and_the_part_between_them():
    scores, cells, beyond = drawn_scores(correlated=1.0)
    # 60 draws determine a variance to 18 %.
    assert cells + beyond == pytest.approx(scores.var(0), rel=0.4)
    # Cells alone miss a third.
    assert np.all(beyond > 0.3 * cells)


def test_independent_errors_add_next_to_nothing():
    _, cells, beyond = drawn_scores(correlated=0.0)
    assert np.all(beyond < 0.15 * cells)


def test_no_rings_add_nothing():
    none = np.zeros(0)
    assert beyond_cells(np.zeros((3, 0)), none, np.zeros((3, 0)), np.zeros((0, 2))) == pytest.approx(0)


def test_shared_errors_that_poses_absorb_are_not_missed():
    random = np.random.default_rng(1)
    frames, cells, points, draws, together = 60, 16, 7, 100, 5
    frame = np.repeat(np.arange(frames), cells * points)
    # Five frames each see the same cells, whose errors are equal in all of them.
    cell = cells * (frame // together) + np.tile(np.repeat(np.arange(cells), points), frames)
    by_cell = random.normal(size=(cell.max() + 1, 7))[cell]
    wall = np.stack([40.0 * (cell // cells), 40.0 * (cell % cells)], -1)
    empty = Equations(
        frame, by_cell[:, :6], by_cell[:, 6:], np.zeros(len(cell)), np.ones(len(cell)), cell,
        np.full(len(cell), RING), wall, *of_no_edge(len(cell)),
    )  # fmt: skip
    window = np.arange(frames - 3)[:, None] + np.arange(4)
    free = Rows(
        window, np.full((len(window), 4, 6), 1e-6), np.zeros((len(window), 0)), np.zeros(len(window)),
        np.ones(len(window)),
    )  # fmt: skip
    none, one = np.zeros(0, np.int64), np.zeros(1, np.int64)
    scores, told = [], []
    for _ in range(draws):
        shared = random.normal(size=cell.max() + 1)[cell]
        e = replace(empty, residual=shared + random.normal(0, 0.3, len(cell)))
        reduced = eliminate_poses(e, free, frames)
        left = Marginal(reduced.information, reduced.right, np.eye(1), np.zeros(1), 0.0)
        inflation, _ = score_inflation(e, reduced, left, none, one, np.zeros((0, 0)))
        scores.append(reduced.right[0] / np.sqrt(reduced.information[0, 0]))
        told.append(inflation[0] ** 2)
    expected = together * points + 0.3**2
    # 100 draws determine a variance to 14 %.
    assert np.var(scores) == pytest.approx(expected, rel=0.35)
    # Six of sixteen cells' errors are absorbed by the poses: without that part it would be 0.7 of that.
    assert np.mean(told) == pytest.approx(expected, rel=0.15)
