"""Pictures of another pattern than the stated one are refused by name; those of the stated one are not."""

import cv2
import numpy as np
import pytest

from pipeline.errors import UnusableError
from stages.calibrate.boards.detect import Charuco, Chessboard
from stages.calibrate.boards.pictures import refuse_another_pattern
from tests.board_scene import chessboard_picture

CHESS = Chessboard(8, 6, 20.0)
CHARUCO = Charuco(9, 7, 20.0, 15.0, "DICT_4X4_50")


def _blurred(face):
    """Return a picture as a camera would take it: blurred, dimmed, noisy, 800 × 600 px."""
    picture = cv2.resize(np.pad(face, 40, constant_values=230), (800, 600), interpolation=cv2.INTER_AREA)
    noisy = 0.8 * cv2.GaussianBlur(picture, (0, 0), 1.0) + np.random.default_rng(1).normal(0, 3, (600, 800))
    return np.clip(noisy, 0, 255).astype(np.uint8)


def _april_grid():
    tags = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    face = np.full((720, 960), 255, np.uint8)
    for i in range(12):
        y, x = 40 + 220 * (i // 4), 40 + 230 * (i % 4)
        face[y : y + 160, x : x + 160] = cv2.aruco.generateImageMarker(tags, i, 160)
    return face


def _circles(staggered):
    face = np.full((760, 1000), 255, np.uint8)
    for row in range(6):
        for column in range(8):
            x = 80 + (110 * column + 55 * (row % 2) if staggered else 110 * column)
            cv2.circle(face, (x, 80 + 110 * row // (1 + staggered)), 22, 0, -1)
    return face


def _charuco(board):
    return board.board(False).generateImage((900, 700))


@pytest.mark.parametrize(
    ("face", "stated", "named"),
    [
        (_april_grid(), CHESS, "AprilGrid"),
        (_circles(False), CHESS, "a grid of circles"),
        (_circles(True), CHESS, "a staggered grid of circles"),
        (_charuco(CHARUCO), CHESS, "ChArUco"),
        (_charuco(CHARUCO), Charuco(9, 7, 20.0, 15.0, "DICT_6X6_50"), "DICT_4X4"),
        (chessboard_picture(11, 9, 60, 60)[0], CHESS, "a chessboard of 11 × 9"),
        (chessboard_picture(8, 6, 60, 60)[0], CHARUCO, "a chessboard of 8 × 6"),
    ],
)
def test_another_pattern_is_named(face, stated, named, tmp_path):
    file = tmp_path / "a.png"
    cv2.imwrite(str(file), _blurred(face))
    with pytest.raises(UnusableError, match=named):
        refuse_another_pattern([file], stated)


@pytest.mark.parametrize(
    ("face", "stated"),
    [
        (chessboard_picture(8, 6, 60, 60)[0], CHESS),
        (chessboard_picture(8, 6, 60, 60)[0][:, 200:], CHESS),
        (_charuco(CHARUCO), CHARUCO),
        (np.full((600, 800), 128, np.uint8), CHESS),
        (np.random.default_rng(2).integers(0, 255, (600, 800)).astype(np.uint8), CHARUCO),
    ],
)
def test_the_stated_board_and_empty_pictures_are_not_refused(face, stated, tmp_path):
    file = tmp_path / "a.png"
    cv2.imwrite(str(file), _blurred(face))
    refuse_another_pattern([file], stated)
