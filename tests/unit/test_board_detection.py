"""Boards in rendered fisheye pictures: corners at their true places, and none where there is no board."""

import cv2
import numpy as np
import pytest

from pipeline.instrument.camera.calibration import BoardView
from pipeline.instrument.camera.fisheye import KannalaBrandt
from stages.calibrate.boards.detect import (
    WINDOW_SHARE,
    Charuco,
    Chessboard,
    detect,
    grid,
    refine,
    refine_in_windows,
)
from tests.board_scene import board_points, chessboard_picture, facing_pose, render

CAMERA = KannalaBrandt((800, 600), (230.0, 229.5), (398.3, 301.2), (-0.0118, 0.0008, -0.0008, 0.0001))
BOARD = Chessboard(8, 6, 20.0)
PX_PER_MM = 4.0
CHARUCO = Charuco(9, 7, 20.0, 15.0, "DICT_4X4_50")
# Detection of a corner in a picture with 1 % noise: a tenth of a pixel a coordinate is usual.
LIMIT_PX = 0.15


def _random():
    return np.random.default_rng(1)


def _chess_scene(T_cb, grey_sigma=2.0, picture=None):
    face, corners = chessboard_picture(BOARD.columns, BOARD.rows, int(BOARD.square_mm * PX_PER_MM), 60)
    points = board_points(corners, face, PX_PER_MM)
    true = CAMERA.project(points @ T_cb[:3, :3].T + T_cb[:3, 3]).uv
    shown = face if picture is None else picture(face)
    return render(CAMERA, T_cb, shown, PX_PER_MM, _random(), grey_sigma), true


@pytest.mark.parametrize("theta", [0.0, 0.5, 0.9])
def test_chessboard_corners_are_at_their_true_places(theta):
    T_cb = facing_pose([np.sin(theta), 0.4 * np.sin(theta), np.cos(theta)], 150.0, [0.2, -0.3, 0.15])
    image, true = _chess_scene(T_cb)
    view = detect(image, BOARD, "a.png")
    assert view is not None
    assert len(view.uv) == 48
    assert _rms_to_nearest(view.uv, true) < LIMIT_PX
    assert _grid_is_consistent(view)


def test_close_strongly_distorted_chessboard_is_found():
    """The board spans 130° of the view."""
    image, true = _chess_scene(facing_pose([0.05, 0.02, 1.0], 45.0, [0.05, 0.1, 0.02]))
    view = detect(image, BOARD, "a.png")
    assert view is not None
    assert _rms_to_nearest(view.uv, true) < 2 * LIMIT_PX


def test_part_of_a_chessboard_cut_by_the_border_is_used():
    image, true = _chess_scene(facing_pose([0.0, 0.0, 1.0], 100.0, [0.1, 0.1, 0.0]))
    cut = int(np.sort(true[:, 0])[36])
    view = detect(np.ascontiguousarray(image[:, :cut]), BOARD, "a.png")
    assert view is not None
    assert 12 <= len(view.uv) < 48
    assert _rms_to_nearest(view.uv, true) < LIMIT_PX
    assert _grid_is_consistent(view)


def test_red_and_white_board_is_found_in_its_darkest_channel():
    """Red squares as bright as the white ones in red, and dark in blue."""
    T_cb = facing_pose([0.1, 0.1, 1.0], 120.0, [0.2, 0.1, 0.0])
    dark, true = _chess_scene(T_cb)
    bright = np.clip(dark.astype(int) // 20 + 200, 0, 255).astype(np.uint8)
    view = detect(np.stack([dark, dark, bright], -1), BOARD, "a.png")
    assert view is not None
    assert _rms_to_nearest(view.uv, true) < LIMIT_PX


def test_refinement_is_chosen_where_it_helps_in_a_defocused_picture():
    """Blur is as wide as the slanted squares: OpenCV's detector and its refinement both err by up to some px.

    The result must be better than the detected corners and than corners that are always refined.
    """
    random = np.random.default_rng(11)
    errors = {"detected": [], "refined": [], "chosen": []}
    for blur_px, theta in ((0.0, 0.6), (3.0, 0.6), (5.0, 0.1), (5.0, 0.5)):
        T_cb = facing_pose([np.sin(theta), 0.4 * np.sin(theta), np.cos(theta)], 110.0, [0.3, -0.3, 0.2])
        image, true = _chess_scene(T_cb)
        image = np.asarray(cv2.GaussianBlur(image, (0, 0), blur_px)) if blur_px else image
        image = np.clip(image + random.normal(0, 3, image.shape), 0, 255).astype(np.uint8)
        found, uv = cv2.findChessboardCornersSB(image, (8, 6), flags=cv2.CALIB_CB_EXHAUSTIVE)
        assert found
        uv = uv.reshape(-1, 2).astype(float)
        chosen = refine(image, uv, grid(8, 6, BOARD.square_mm), WINDOW_SHARE)
        always = refine_in_windows(image, uv, WINDOW_SHARE)
        for name, places in (("detected", uv), ("refined", always), ("chosen", chosen)):
            errors[name].append(_rms_to_nearest(places, true))
    rms = {name: np.sqrt(np.mean(np.square(e))) for name, e in errors.items()}
    assert rms["chosen"] < min(rms["detected"], rms["refined"]), (rms, errors)


def test_corners_beside_the_picture_are_not_refined():
    image, uv = _chess_scene(facing_pose([0.0, 0.0, 1.0], 90.0, [0.1, 0.2, 0.0]))
    uv = np.concatenate([uv, [[-0.4, 20.0], [799.6, 599.6], [800.3, 30.0]]])
    refined = refine_in_windows(image, uv, WINDOW_SHARE)
    assert refined[[-3, -1]] == pytest.approx(uv[[-3, -1]], abs=1e-4)
    assert np.abs(refined[:-3] - uv[:-3]).max() < LIMIT_PX * 3


def test_a_picture_without_a_board_gives_no_corners():
    random = _random()
    noise = random.integers(0, 255, (150, 200)).astype(np.uint8)
    blurred = np.asarray(cv2.GaussianBlur(noise, (0, 0), 6))
    for image in (np.full((150, 200), 128, np.uint8), noise, blurred):
        assert detect(image, BOARD, "a.png") is None
        assert detect(image, CHARUCO, "a.png") is None


@pytest.mark.parametrize("legacy", [False, True])
@pytest.mark.parametrize("theta", [0.0, 0.8])
def test_charuco_corners_are_at_their_true_places(legacy, theta):
    T_cb = facing_pose([np.sin(theta), -0.3 * np.sin(theta), np.cos(theta)], 130.0, [0.2, 0.25, -0.1])
    image, board = _charuco_scene(T_cb, legacy)
    view = detect(image, CHARUCO, "a.png")
    assert view is not None
    assert len(view.uv) >= 40
    true = CAMERA.project((view.xyz_b - board) @ T_cb[:3, :3].T + T_cb[:3, 3]).uv
    assert np.sqrt(np.mean(np.sum((view.uv - true) ** 2, -1))) < LIMIT_PX


def test_charuco_cut_by_the_border_keeps_its_numbering():
    T_cb = facing_pose([0.0, 0.0, 1.0], 100.0, [0.1, 0.1, 0.0])
    image, board = _charuco_scene(T_cb, False)
    view = detect(np.ascontiguousarray(image[:, 380:]), CHARUCO, "a.png")
    assert view is not None
    assert 12 <= len(view.uv) < 40
    view = BoardView(view.name, view.xyz_b, np.add(view.uv, [380.0, 0.0]))
    true = CAMERA.project((view.xyz_b - board) @ T_cb[:3, :3].T + T_cb[:3, 3]).uv
    assert np.sqrt(np.mean(np.sum((view.uv - true) ** 2, -1))) < LIMIT_PX


def test_charuco_of_another_dictionary_is_not_mistaken():
    image, _ = _charuco_scene(facing_pose([0.0, 0.0, 1.0], 130.0, [0.2, 0.25, -0.1]), False)
    other = Charuco(9, 7, 20.0, 15.0, "DICT_6X6_50")
    assert detect(image, other, "a.png") is None


def _charuco_scene(T_cb, legacy):
    size = (int(9 * 20 * PX_PER_MM), int(7 * 20 * PX_PER_MM))
    face = CHARUCO.board(legacy).generateImage(size)
    face = np.pad(face, 40, constant_values=255)
    return render(CAMERA, T_cb, face, PX_PER_MM, _random()), np.array([90.0, 70.0, 0.0])


def _rms_to_nearest(uv, true):
    distance = np.linalg.norm(uv[:, None] - true[None], axis=-1)
    assert len(set(distance.argmin(1))) == len(uv)
    return np.sqrt(np.mean(distance.min(1) ** 2))


def _grid_is_consistent(view):
    """A homography would fit only a flat patch.

    Tested here: neighbours on the board are near in the image.
    """
    spacing = np.linalg.norm(view.uv[1:] - view.uv[:-1], axis=1)
    row = np.isclose(np.linalg.norm(view.xyz_b[1:] - view.xyz_b[:-1], axis=1), BOARD.square_mm)
    return spacing[row].max() < 6 * np.median(spacing[row])
