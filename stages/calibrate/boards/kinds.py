"""Which kind of calibration pattern pictures show when it is not the one that was stated."""

from __future__ import annotations

import cv2
import numpy as np

from pipeline.arrays import Image
from stages.calibrate.boards.detect import Board, Charuco, grey_of, largest_grid

_LEAST_MARKERS = 4
"""Markers of one dictionary that make a pattern of it: single ones are read into noise."""
_TAGS = ("DICT_APRILTAG_36h11", "DICT_APRILTAG_25h9", "DICT_APRILTAG_16h5")
_MARKERS = ("DICT_4X4_1000", "DICT_5X5_1000", "DICT_6X6_1000", "DICT_7X7_1000", "DICT_ARUCO_ORIGINAL")
_LEAST_SIDE = 5
"""Inner corners a side that make a chessboard of another size: 4 × 4 is read into noise."""
_CIRCLES = {
    "a grid of circles": cv2.CALIB_CB_SYMMETRIC_GRID,
    "a staggered grid of circles": cv2.CALIB_CB_ASYMMETRIC_GRID,
}
_UNSUPPORTED = "boresight calibrates from chessboards and ChArUco boards; print one of these"


def pattern_seen(image: Image, stated: Board) -> tuple[str, str] | None:
    """Return which other pattern a picture shows, and what to do; None where none is recognised.

    ``image`` is (H, W) grey or (H, W, 3) BGR. AprilTags, ArUco markers and circle grids take a tenth of a
    second in 2 megapixels, a chessboard of another size half a second.
    """
    grey = grey_of(image)
    return _of_markers(grey, stated) or _of_circles(grey, stated) or _of_squares(grey, stated)


def _of_markers(grey: Image, stated: Board) -> tuple[str, str] | None:
    counts = {name: _markers(grey, name) for name in (*_TAGS, *_MARKERS)}
    name = max(counts, key=lambda n: counts[n])
    if counts[name] < _LEAST_MARKERS:
        return None
    seen = f"{counts[name]} markers of {name}"
    if name in _TAGS:
        return f"{seen}, as on an AprilGrid", _UNSUPPORTED
    if isinstance(stated, Charuco):
        return seen, f"check --dictionary, --columns and --rows: {stated.dictionary} was stated"
    return f"{seen}, as on a ChArUco board", "state --board charuco, --marker-mm and --dictionary"


def _markers(grey: Image, dictionary: str) -> int:
    known = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
    ids = cv2.aruco.ArucoDetector(known).detectMarkers(grey)[1]
    return 0 if ids is None else len(np.unique(ids))


def _of_circles(grey: Image, stated: Board) -> tuple[str, str] | None:
    for name, flags in _CIRCLES.items():
        if cv2.findCirclesGrid(grey, (stated.columns, stated.rows), flags=flags)[0]:
            return f"{name}, {stated.columns} × {stated.rows}", _UNSUPPORTED
    return None


def _of_squares(grey: Image, stated: Board) -> tuple[str, str] | None:
    corners = largest_grid(grey)
    if corners is None:
        return None
    short, long = sorted(corners.shape[:2])
    if short < _LEAST_SIDE:
        return None
    seen = f"a chessboard of {long} × {short} inner corners"
    if isinstance(stated, Charuco):
        return seen, "state --board chessboard, and --columns and --rows as inner corners"
    least, most = sorted((stated.rows, stated.columns))
    hint = "check --columns and --rows: they count inner corners, one fewer than squares"
    return None if short <= least and long <= most else (seen, hint)
