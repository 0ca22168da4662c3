"""Finding board corners in strongly distorted images.

Chessboards by OpenCV's sector-based detector (A. Duda, U. Frese, "Accurate detection and localization of
checkerboard corners for calibration", BMVC 2018). A board that is not found whole is looked for with more
contrast and then in part: a part is as good as the whole, since the pose of every view is free.
"""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.instrument.camera.calibration import BoardView
from stages.calibrate.boards.targets import Board, Charuco, Chessboard, grid

Image = NDArray[np.uint8]
Float = NDArray[np.float64]

LEAST_CORNERS = 12
_SHORTEST_SIDE = 4
_MOST_MISSING = 2
_SECTOR_FLAGS = cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_ACCURACY
_CONTRAST_LIMIT, _CONTRAST_TILES = 4.0, (8, 8)


def detect(image: Image, board: Board, name: str) -> BoardView | None:
    """Return the corners of ``board`` in a grey image, or None where at least `LEAST_CORNERS` are not seen."""
    if isinstance(board, Charuco):
        return _charuco(image, board, name)
    return _chessboard(image, board, name)


def _chessboard(image: Image, board: Chessboard, name: str) -> BoardView | None:
    enhanced = cv2.createCLAHE(_CONTRAST_LIMIT, _CONTRAST_TILES).apply(image)
    for columns, rows in _sizes(board):
        for picture in (image, enhanced):
            found, uv = cv2.findChessboardCornersSB(picture, (columns, rows), flags=_SECTOR_FLAGS)
            if found:
                return BoardView(name, grid(columns, rows, board.square_mm), np.reshape(uv, (-1, 2)).astype(float))
    return None


def _sizes(board: Chessboard) -> Iterator[tuple[int, int]]:
    """Yield the whole board's size, then those of its parts, the largest first."""
    shorter = range(_MOST_MISSING + 1)
    parts = [(board.columns - a, board.rows - b) for a in shorter for b in shorter]
    usable = [p for p in parts if p == parts[0] or min(p) >= _SHORTEST_SIDE]
    yield from sorted(usable, key=lambda p: -p[0] * p[1])


def _charuco(image: Image, board: Charuco, name: str) -> BoardView | None:
    """Return the view under whichever of OpenCV's two marker layouts shows more corners."""
    views = [_charuco_layout(image, board.board(legacy), name) for legacy in (False, True)]
    best = max(views, key=lambda view: len(view.uv))
    return best if len(best.uv) >= LEAST_CORNERS and not _in_one_line(best.xyz_b) else None


def _charuco_layout(image: Image, board: cv2.aruco.CharucoBoard, name: str) -> BoardView:
    parameters = cv2.aruco.CharucoParameters()
    parameters.minMarkers = 1
    parameters.tryRefineMarkers = True
    parameters.checkMarkers = False
    detector = cv2.aruco.CharucoDetector(board, parameters)
    uv, ids, _, _ = detector.detectBoard(image)
    if ids is None or len(ids) == 0:
        return BoardView(name, np.zeros((0, 3)), np.zeros((0, 2)))
    points = np.asarray(board.getChessboardCorners(), float)
    return BoardView(name, points[np.ravel(ids)], np.reshape(uv, (-1, 2)).astype(float))


def _in_one_line(xyz_b: Float) -> bool:
    return bool(np.linalg.matrix_rank(xyz_b - xyz_b.mean(0), tol=1e-6) < 2)
