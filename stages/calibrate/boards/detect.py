"""Finding board corners in strongly distorted images.

Chessboards by OpenCV's sector-based detector (A. Duda, U. Frese, "Accurate detection and localization of
checkerboard corners for calibration", BMVC 2018). A board that is not found whole is looked for with more
contrast, in the darkest colour channel, and then in part: a part is as good as the whole, since the pose of
every view is free.
"""

from __future__ import annotations

from itertools import product

import cv2
import numpy as np
from scipy.spatial import cKDTree

from pipeline.arrays import Float, Image
from pipeline.instrument.camera.calibration import BoardView
from stages.calibrate.boards.targets import Board, Charuco, Chessboard, grid

LEAST_CORNERS = 12
_SHORTEST_SIDE = 4
_SEARCHED_SIDE_PX = 1000
_MOST_MISSING = 2
_QUICK = cv2.CALIB_CB_ACCURACY
_THOROUGH = cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_ACCURACY
_WINDOW_SHARE, _SMALLEST_WINDOW, _LARGEST_WINDOW = 0.33, 2, 20
_STOP = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 100, 1e-4)
_CONTRAST_LIMIT, _CONTRAST_TILES = 4.0, (8, 8)


def detect(image: Image, board: Board, name: str) -> BoardView | None:
    """Return the corners of ``board`` in an image, or None where fewer than `LEAST_CORNERS` are seen.

    ``image`` is (H, W) grey or (H, W, 3) BGR.
    """
    if isinstance(board, Charuco):
        return _charuco(_grey(image), board, name)
    return _chessboard(image, board, name)


def _chessboard(image: Image, board: Chessboard, name: str) -> BoardView | None:
    whole = (board.columns, board.rows)
    for picture, flags in product(_pictures(image), (_QUICK, _THOROUGH)):
        found, uv = cv2.findChessboardCornersSB(picture, whole, flags=flags)
        if found:
            return _view(picture, whole, board, name, np.array(uv, float).reshape(-1, 2))
    return _part_of_chessboard(image, board, name)


def _part_of_chessboard(image: Image, board: Chessboard, name: str) -> BoardView | None:
    """Look for the largest part in a picture of moderate size, and refine it in the image itself."""
    grey = _grey(image)
    scale = min(_SEARCHED_SIDE_PX / max(grey.shape), 1.0)
    small = np.asarray(cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), np.uint8)
    for size in _parts(board):
        for picture in _pictures(small):
            found, uv = cv2.findChessboardCornersSB(picture, size, flags=_THOROUGH)
            if found:
                coarse = (np.array(uv, float).reshape(-1, 2) + 0.5) / scale - 0.5
                return _view(grey, size, board, name, coarse)
    return None


def _view(picture: Image, size: tuple[int, int], board: Chessboard, name: str, uv: Float) -> BoardView:
    xyz_b = grid(*size, board.square_mm)
    return BoardView(name, xyz_b, _refined(picture, uv, _WINDOW_SHARE), numbered=False)


def _grey(image: Image) -> Image:
    return image if image.ndim == 2 else np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)


def _pictures(image: Image) -> list[Image]:
    """Return the ways to look at an image: as it is, its darkest channel, and with local contrast."""
    grey = _grey(image)
    enhanced = np.asarray(cv2.createCLAHE(_CONTRAST_LIMIT, _CONTRAST_TILES).apply(grey), np.uint8)
    coloured = image.ndim == 3 and bool(np.any(image != grey[..., None]))
    return [grey, np.ascontiguousarray(image.min(-1)), enhanced] if coloured else [grey, enhanced]


def _parts(board: Chessboard) -> list[tuple[int, int]]:
    """Return the sizes of the board's parts, the largest first."""
    shorter = range(_MOST_MISSING + 1)
    parts = [(board.columns - a, board.rows - b) for a in shorter for b in shorter if a + b > 0]
    return sorted((p for p in parts if min(p) >= _SHORTEST_SIDE), key=lambda p: -p[0] * p[1])


def _refined(picture: Image, uv: Float, share: float) -> Float:
    """Refine each corner in a window of ``share`` of its squares, whose size varies in a fisheye."""
    spacing = np.asarray(cKDTree(uv).query(uv, 2)[0])[:, 1]
    halves = np.clip(np.floor(share * spacing), _SMALLEST_WINDOW, _LARGEST_WINDOW).astype(int)
    refined = uv.astype(np.float32)
    for i, half in enumerate(halves):
        size = (int(half), int(half))
        refined[i] = cv2.cornerSubPix(picture, refined[i : i + 1].copy(), size, (-1, -1), _STOP)[0]
    return refined.astype(float)


def _charuco(grey: Image, board: Charuco, name: str) -> BoardView | None:
    """Return the view under whichever of OpenCV's two marker layouts shows more corners."""
    views = [_charuco_layout(grey, board.board(legacy), name) for legacy in (False, True)]
    best = max(views, key=lambda view: len(view.uv))
    if len(best.uv) < LEAST_CORNERS or _in_one_line(best.xyz_b):
        return None
    clear_of_markers = (board.square_mm - board.marker_mm) / 2 / board.square_mm
    return BoardView(name, best.xyz_b, _refined(grey, best.uv, min(clear_of_markers, _WINDOW_SHARE)))


def _charuco_layout(grey: Image, board: cv2.aruco.CharucoBoard, name: str) -> BoardView:
    parameters = cv2.aruco.CharucoParameters()
    parameters.minMarkers = 1
    parameters.tryRefineMarkers = True
    parameters.checkMarkers = False
    uv, ids, _, _ = cv2.aruco.CharucoDetector(board, parameters).detectBoard(grey)
    if ids is None or len(ids) == 0:
        return BoardView(name, np.zeros((0, 3)), np.zeros((0, 2)))
    points = np.array(board.getChessboardCorners(), float)
    return BoardView(name, points[np.ravel(ids)], np.array(uv, float).reshape(-1, 2))


def _in_one_line(xyz_b: Float) -> bool:
    return bool(np.linalg.matrix_rank(xyz_b - xyz_b.mean(0), tol=1e-6) < 2)
