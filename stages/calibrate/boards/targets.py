"""Calibration boards: what they look like and where their corners are, in mm in the board's frame B."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from pipeline.arrays import Float


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
