"""Fiducials found in the frames in which the wall is lit."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import cv2
import numpy as np

from pipeline.arrays import Float, Image, Int
from stages.calibrate.gauge.geometry import Gauge


@dataclass(frozen=True)
class Sighting:
    """Fiducials of the gauge seen in one frame.

    Attributes
    ----------
    frame : int
    marker : (M,) int
        Places in the gauge's list.
    corner_px : (M, 4, 2)
        Corners, clockwise from the pattern's top left, to about a pixel.
    strangers : (K,) int
        Numbers of markers seen that the gauge does not have.
    """

    frame: int
    marker: Int
    corner_px: Float
    strangers: Int


def detector(dictionary: str) -> cv2.aruco.ArucoDetector:
    """Return a detector of the markers of OpenCV's dictionary so named."""
    parameters = cv2.aruco.DetectorParameters()
    parameters.adaptiveThreshWinSizeMin = 7
    parameters.adaptiveThreshWinSizeMax = 47
    parameters.adaptiveThreshWinSizeStep = 8
    known = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
    return cv2.aruco.ArucoDetector(known, parameters)


def find_fiducials(
    images: Iterable[tuple[int, Image | None]], gauge: Gauge
) -> Iterator[tuple[Sighting, Image]]:
    """Yield what is seen in each image that could be read, with the image."""
    finder = detector(gauge.fiducials.dictionary)
    place = {int(number): k for k, number in enumerate(gauge.ids)}
    for frame, image in images:
        if image is None:
            continue
        numbers, corners = detect(finder, image)
        known = np.array([int(n) in place for n in numbers], bool)
        marker = np.array([place[int(n)] for n in numbers[known]], np.int64)
        yield Sighting(frame, marker, corners[known], numbers[~known]), image


def detect(finder: cv2.aruco.ArucoDetector, image: Image) -> tuple[Int, Float]:
    """Return numbers (M,) and corners (M, 4, 2) of the markers in an image."""
    corners, numbers, _ = finder.detectMarkers(image)
    if numbers is None or not len(numbers):
        return np.zeros(0, np.int64), np.zeros((0, 4, 2))
    return np.ravel(numbers).astype(np.int64), np.array(corners, float).reshape(-1, 4, 2)
