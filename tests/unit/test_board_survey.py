"""Measuring the board in its own views: offsets of corners, and orientation and place of partial views."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.instrument.camera.calibration import BoardView
from pipeline.instrument.camera.fisheye import KannalaBrandt
from stages.calibrate.boards import calibrate_boards
from stages.calibrate.boards.detect import grid
from stages.calibrate.boards.fit import BoardCalibrationParameters
from stages.calibrate.boards.start import start
from stages.calibrate.boards.survey import applied, nominal_board, placed, survey_board
from tests.board_scene import varied_poses
from tests.quiet import quiet_context

CAMERA = KannalaBrandt((640, 480), (146.0, 145.6), (318.9, 236.8), (-0.0118, 0.0008, -0.0008, 0.0001))
SURVEYED = BoardCalibrationParameters(board_shape="surveyed")
NOMINAL = grid(9, 6, 20.0)
NOISE_PX = 0.05


def _offsets(seed=3, sigma_mm=0.3):
    return np.random.default_rng(seed).normal(0, sigma_mm, NOMINAL.shape)


def _views(offset_mm, count=20, seed=1):
    """Return whole views of a board whose corners are displaced."""
    random = np.random.default_rng(seed)
    true = NOMINAL + offset_mm
    views = []
    for i, T_cb in enumerate(varied_poses(random, count, 0.9, (90.0, 150.0))):
        uv, valid = CAMERA.project((true - true.mean(0)) @ T_cb[:3, :3].T + T_cb[:3, 3])
        if valid.all() and np.all((uv > 0) & (uv < CAMERA.image_size)):
            views.append(BoardView(f"{i:02d}", NOMINAL, uv + random.normal(0, NOISE_PX, uv.shape)))
    return views


def _without_motion_and_scale(offset):
    """Return the part of the offsets that no movement and no scale of the whole board can make."""
    x, y, _ = (NOMINAL - NOMINAL.mean(0)).T
    zero, one = np.zeros_like(x), np.ones_like(x)
    motions = [(one, zero, zero), (zero, one, zero), (zero, zero, one), (-y, x, zero), (zero, zero, x)]
    motions += [(zero, zero, y), (x, y, zero)]
    basis = np.stack([np.stack(m, -1).ravel() for m in motions], -1)
    flat = offset.ravel()
    return (flat - basis @ np.linalg.lstsq(basis, flat, rcond=None)[0]).reshape(-1, 3)


def test_offsets_of_the_corners_are_found():
    true = _offsets()
    views = _views(true)
    survey, _, _ = survey_board(views, start(views, CAMERA.image_size), SURVEYED)
    # np.unique orders the nominal corners by x, then y
    order = np.lexsort((NOMINAL[:, 1], NOMINAL[:, 0]))
    found = np.empty_like(true)
    found[order] = survey.offset_mm
    error = _without_motion_and_scale(found - true)
    assert np.sqrt(np.mean(error[:, :2] ** 2)) < 0.06
    assert np.sqrt(np.mean(error[:, 2] ** 2)) < 0.15


def test_surveying_predicts_other_views_better():
    views = _views(_offsets())
    scores = {}
    for shape in ("flat", "bent", "surveyed"):
        parameters = BoardCalibrationParameters(board_shape=shape)
        report = calibrate_boards(
            views, CAMERA.image_size, ["kannala_brandt"], None, parameters, quiet_context()
        )
        scores[shape] = report.scores[0].held_out_rms_px
    assert scores["surveyed"] < 0.6 * min(scores["flat"], scores["bent"])


@pytest.mark.parametrize(("sigma_mm", "shape"), [(0.0, "bent"), (0.3, "surveyed")])
def test_the_shape_that_predicts_best_is_chosen(sigma_mm, shape):
    """Control: a perfect board is not surveyed."""
    views = _views(_offsets(sigma_mm=sigma_mm), count=12)
    report = calibrate_boards(
        views, CAMERA.image_size, ["kannala_brandt"], None, BoardCalibrationParameters(), quiet_context()
    )
    assert report.board_shape == shape


def test_the_place_of_inverted_and_partial_views_is_found():
    views = _views(_offsets())
    survey, _, estimate = survey_board(views, start(views, CAMERA.image_size), SURVEYED)
    upside_down = replace(views[2], uv=views[2].uv[::-1], numbered=False)
    inner = (NOMINAL[:, 0] >= 40) & (NOMINAL[:, 1] >= 20)
    shifted = NOMINAL[inner] - NOMINAL[inner].min(0)
    part = BoardView("part", shifted, views[3].uv[inner], numbered=False)
    found = placed(survey, upside_down, estimate.camera, 1.0)
    np.testing.assert_allclose(found.xyz_b, NOMINAL[::-1], atol=1e-6)
    np.testing.assert_allclose(placed(survey, part, estimate.camera, 1.0).xyz_b, NOMINAL[inner], atol=1e-6)


def test_numbered_views_keep_their_place():
    views = _views(_offsets())
    survey, _, estimate = survey_board(views, start(views, CAMERA.image_size), SURVEYED)
    wrong = replace(views[2], uv=views[2].uv[::-1])
    np.testing.assert_array_equal(placed(survey, wrong, estimate.camera, 1.0).xyz_b, wrong.xyz_b)


def test_a_corner_that_is_not_on_the_board_is_not_moved():
    survey = replace(nominal_board(_views(_offsets())), offset_mm=np.full((54, 3), 0.2))
    view = BoardView("x", np.array([[0.0, 0.0, 0.0], [500.0, 0.0, 0.0]]), np.zeros((2, 2)))
    np.testing.assert_allclose(applied(survey, view).xyz_b, [[0.2, 0.2, 0.2], [500, 0, 0]])
