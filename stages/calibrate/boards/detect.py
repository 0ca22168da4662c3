"""Calibration boards, in mm in the board's frame B, and detection of their corners in distorted images.

Chessboards are found by OpenCV's sector-based detector (A. Duda, U. Frese, "Accurate detection and
localization of checkerboard corners for calibration", BMVC 2018). A board that is not found whole is searched
again with more contrast and in the darkest colour channel, and at last in part: a part of a board is as
useful as the whole, since the pose of every view is free. Corners are refined to a fraction of a pixel if
that brings them nearer to a smooth image of the board.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import cv2
import numpy as np
from numpy.polynomial.polynomial import polyvander2d
from scipy.spatial import cKDTree

from pipeline.adjustment.robust import Cauchy, robust_spread, root_mean_square
from pipeline.arrays import Float, Image
from pipeline.instrument.camera.calibration import BoardView

# Corners that a view needs at least (chosen).
LEAST_CORNERS = 12
# Inner corners along the shorter side of a part of a chessboard, and rows or columns that it may lack
# (chosen).
_SHORTEST_SIDE = 4
_MOST_MISSING = 2
# Longer side, px, to which a picture is reduced while parts are searched: a bound on time.
_SEARCHED_SIDE_PX = 1000
_QUICK = cv2.CALIB_CB_ACCURACY
_THOROUGH = cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_ACCURACY
# Of OpenCV's CLAHE. In ten unevenly lit boards the same 360 corners are found with a limit of 2, 4 and 8.
_CONTRAST_LIMIT, _CONTRAST_TILES = 4.0, (8, 8)


@dataclass(frozen=True)
class Chessboard:
    """A chessboard of ``columns`` × ``rows`` inner corners with squares of ``square_mm``."""

    columns: int
    rows: int
    square_mm: float


@dataclass(frozen=True)
class Charuco:
    """A ChArUco board of ``columns`` × ``rows`` squares.

    Attributes
    ----------
    columns, rows : int
        Squares, not inner corners, as OpenCV counts them for this kind of board.
    square_mm, marker_mm : float
        Edges of a square and of a marker inside it.
    dictionary : str
        OpenCV's name, e.g. ``DICT_5X5_100``.
    """

    columns: int
    rows: int
    square_mm: float
    marker_mm: float
    dictionary: str

    def board(self, legacy: bool) -> cv2.aruco.CharucoBoard:
        """Return OpenCV's board; ``legacy`` places the markers as OpenCV did before 4.6."""
        dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, self.dictionary))
        board = cv2.aruco.CharucoBoard((self.columns, self.rows), self.square_mm, self.marker_mm, dictionary)
        board.setLegacyPattern(legacy)
        return board

    def fits_dictionary(self) -> bool:
        """Return whether the dictionary has a marker for every white square."""
        dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, self.dictionary))
        return self.columns * self.rows // 2 <= len(dictionary.bytesList)


Board = Chessboard | Charuco


def grid(columns: int, rows: int, square_mm: float) -> Float:
    """Return (columns · rows, 3) points of a plane grid, row by row."""
    x, y = np.meshgrid(np.arange(columns), np.arange(rows))
    return np.asarray(square_mm * np.stack([x, y, np.zeros_like(x)], -1).reshape(-1, 3), np.float64)


def detect(image: Image, board: Board, name: str) -> BoardView | None:
    """Return the corners of ``board`` in an image, or None where fewer than `LEAST_CORNERS` are seen.

    ``image`` is (H, W) grey or (H, W, 3) BGR.
    """
    if isinstance(board, Charuco):
        return _charuco(grey_of(image), board, name)
    return _chessboard(image, board, name)


def shows_whole(image: Image, board: Board) -> bool:
    """Return whether a quick search finds the board in an image; a chessboard must be seen whole."""
    grey = grey_of(image)
    if isinstance(board, Charuco):
        return _charuco(grey, board, "") is not None
    return bool(cv2.findChessboardCornersSB(grey, (board.columns, board.rows), flags=_QUICK)[0])


def _chessboard(image: Image, board: Chessboard, name: str) -> BoardView | None:
    whole = (board.columns, board.rows)
    for picture, flags in product(_pictures(image), (_QUICK, _THOROUGH)):
        found, uv = cv2.findChessboardCornersSB(picture, whole, flags=flags)
        if found:
            return _view(picture, whole, board, name, np.array(uv, float).reshape(-1, 2))
    return _part_of_chessboard(image, board, name)


def _part_of_chessboard(image: Image, board: Chessboard, name: str) -> BoardView | None:
    """Search the largest part of the board in a reduced picture, and refine its corners in the image."""
    grey = grey_of(image)
    scale = min(_SEARCHED_SIDE_PX / max(grey.shape), 1.0)
    small = np.asarray(cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), np.uint8)
    for picture in _pictures(small):
        part = _upright(largest_grid(picture), board)
        if part is not None:
            coarse = (part.reshape(-1, 2) + 0.5) / scale - 0.5
            return _view(grey, (part.shape[1], part.shape[0]), board, name, coarse)
    return None


def largest_grid(grey: Image) -> Float | None:
    """Return the corners (R, C, 2), px, of the largest chessboard in a picture; None where none is seen."""
    smallest, flags = (_SHORTEST_SIDE, _SHORTEST_SIDE), _THOROUGH | cv2.CALIB_CB_LARGER
    found, uv, cells = cv2.findChessboardCornersSBWithMeta(grey, smallest, flags)
    return np.array(uv, float).reshape(*cells.shape[:2], 2) if found else None


def _upright(corners: Float | None, board: Chessboard) -> Float | None:
    """Return a grid (R, C, 2) turned so that its rows are the board's; None if it lacks too many of them.

    At most `_MOST_MISSING` rows and as many columns may be missing.
    """
    if corners is None:
        return None
    for turned in (corners, np.rot90(corners)):
        missing = np.subtract((board.rows, board.columns), turned.shape[:2])
        if missing.min() >= 0 and missing.max() <= _MOST_MISSING:
            return np.ascontiguousarray(turned)
    return None


def _view(picture: Image, size: tuple[int, int], board: Chessboard, name: str, uv: Float) -> BoardView:
    xyz_b = grid(*size, board.square_mm)
    return BoardView(name, xyz_b, refine(picture, uv, xyz_b, WINDOW_SHARE), numbered=False)


def grey_of(image: Image) -> Image:
    """Return an image (H, W) or (H, W, 3), BGR, in grey."""
    return image if image.ndim == 2 else np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)


def _pictures(image: Image) -> list[Image]:
    """Return versions of an image: unchanged, its darkest channel, and with local contrast."""
    grey = grey_of(image)
    enhanced = np.asarray(cv2.createCLAHE(_CONTRAST_LIMIT, _CONTRAST_TILES).apply(grey), np.uint8)
    coloured = image.ndim == 3 and bool(np.any(image != grey[..., None]))
    return [grey, np.ascontiguousarray(image.min(-1)), enhanced] if coloured else [grey, enhanced]


def _charuco(grey: Image, board: Charuco, name: str) -> BoardView | None:
    """Return the view under whichever of OpenCV's two marker layouts shows more corners."""
    views = [_charuco_layout(grey, board.board(legacy), name) for legacy in (False, True)]
    best = max(views, key=lambda view: len(view.uv))
    if len(best.uv) < LEAST_CORNERS or _in_one_line(best.xyz_b):
        return None
    clear_of_markers = (board.square_mm - board.marker_mm) / 2 / board.square_mm
    refined = refine(grey, best.uv, best.xyz_b, min(clear_of_markers, WINDOW_SHARE))
    return BoardView(name, best.xyz_b, refined)


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


WINDOW_SHARE = 0.33
"""Half the window of refinement over the distance to the next corner: no other corner's edges are in it."""
_SMALLEST_WINDOW, _LARGEST_WINDOW = 2, 20
# A corner has converged when it moves by less than a thousandth of the corners' errors, px.
_STOP = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 100, 1e-4)
_DEGREE = 4
"""Degree of the polynomial that models the board's smooth image; it fits a fisheye's to 0.1 to 0.5 px."""
_ROUNDS = 3
_WORSE_VIEW, _WORSE = 1.3, 3.0
"""Limits above which refined places are rejected: a view's misfit over that of the detected places, and a
corner's excess of distance in robust σ. In 33 rendered boards, blurred by 0 to 5 px, the chosen places err by
0.16 px rms; the detected ones by 0.42, the refined ones by 0.25."""


def refine(picture: Image, uv: Float, xyz_b: Float, share: float) -> Float:
    """Refine detected corners, and keep the detected places where refining fails.

    If the blur is as wide as the squares, refining moves to other edges; if squares are seen obliquely, the
    detector errs by some px. Lens and board are smooth: a polynomial of the place on the board shows which of
    the two is wrong, for a view as a whole and then for each corner.

    Parameters
    ----------
    picture : (H, W) array, grey
    uv : (N, 2) array
        Detected corners, px.
    xyz_b : (N, 3) array
        The same corners on the board, mm, frame B.
    share : float
        Half the window over the distance to the next corner.

    Returns
    -------
    (N, 2) array, px
    """
    first, second = refine_in_windows(picture, uv, share), uv
    terms = _polynomial(xyz_b)
    if len(uv) < 2 * terms.shape[1]:
        return first
    if _misfit(terms, first) > _WORSE_VIEW * _misfit(terms, second):
        first, second = second, first
    chosen = first
    for _ in range(_ROUNDS):
        smooth = _robust_fit(terms, chosen)
        worse = _distance(first, smooth) - _distance(second, smooth)
        chosen = np.where((worse > _WORSE * robust_spread(chosen - smooth))[:, None], second, first)
    return chosen


def _misfit(terms: Float, uv: Float) -> float:
    return root_mean_square(uv - _robust_fit(terms, uv))


def refine_in_windows(picture: Image, uv: Float, share: float) -> Float:
    """Return corners (N, 2), px, each refined in a window of ``share`` of the squares around it.

    Corners that the detector places outside the picture are not changed.
    """
    spacing = np.asarray(cKDTree(uv).query(uv, 2)[0])[:, 1]
    halves = np.clip(np.floor(share * spacing), _SMALLEST_WINDOW, _LARGEST_WINDOW).astype(int)
    refined = uv.astype(np.float32)
    inside = ((refined >= 0) & (refined < picture.shape[1::-1])).all(1)
    for i in np.flatnonzero(inside):
        size = (int(halves[i]), int(halves[i]))
        refined[i] = cv2.cornerSubPix(picture, refined[i : i + 1].copy(), size, (-1, -1), _STOP)[0]
    return refined.astype(float)


def _polynomial(xyz_b: Float) -> Float:
    """Return the terms (N, T) of a polynomial of the place on the board, in units of its half width."""
    centred = xyz_b[:, :2] - (xyz_b[:, :2].max(0) + xyz_b[:, :2].min(0)) / 2
    x, y = (centred / np.abs(centred).max(0)).T
    order = np.add.outer(np.arange(_DEGREE + 1), np.arange(_DEGREE + 1)).ravel()
    return np.asarray(polyvander2d(x, y, [_DEGREE, _DEGREE])[:, order <= _DEGREE], np.float64)


def _robust_fit(terms: Float, uv: Float) -> Float:
    """Return the polynomial's places (N, 2) by iteratively reweighted least squares."""
    weight = np.ones(len(uv))
    for _ in range(_ROUNDS + 3):
        root = np.sqrt(weight)[:, None]
        smooth = np.asarray(terms @ np.linalg.lstsq(terms * root, uv * root, rcond=None)[0], np.float64)
        sigma = np.full(len(uv), robust_spread(uv - smooth) + 1e-9)
        weight = Cauchy().weight(_distance(uv, smooth), sigma)
    return smooth


def _distance(a: Float, b: Float) -> Float:
    return np.asarray(np.linalg.norm(a - b, axis=1), np.float64)
