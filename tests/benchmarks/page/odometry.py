"""Textbook visual odometry: features from frame to frame, essential matrix, pose, scale.

D. Scaramuzza, F. Fraundorfer, "Visual odometry, part I", IEEE RAM 2011, with functions of OpenCV. Pixels
become rays by the probe's own fisheye model, so that the wide angle is no disadvantage. Steps are scaled by
the pipe's known radius; a textbook's chain of relative scales would only drift away from it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise

import cv2
import numpy as np

from pipeline.instrument.probe import Probe

Pairs = tuple[np.ndarray, np.ndarray]
Tracker = Callable[[np.ndarray, np.ndarray, np.ndarray], Pairs]
_FEATURES, _QUALITY, _APART_PX = 2000, 0.01, 9
_KLT = {"winSize": (21, 21), "maxLevel": 3}
_ROUND_TRIP_PX, _RATIO = 0.5, 0.8
_NEAR_RAD, _FAR_RAD = np.radians(20), np.radians(78)
_THRESHOLD_PX, _CONFIDENCE = 0.7, 0.9999
_FEWEST = 8


def klt(before: np.ndarray, after: np.ndarray, mask: np.ndarray) -> Pairs:
    """Follow corners by pyramidal Lucas-Kanade, forward and back."""
    corners = cv2.goodFeaturesToTrack(before, _FEATURES, _QUALITY, _APART_PX, mask=mask)
    there, found, _ = cv2.calcOpticalFlowPyrLK(before, after, corners, None, **_KLT)
    back, found_back, _ = cv2.calcOpticalFlowPyrLK(after, before, there, None, **_KLT)
    apart = np.linalg.norm(back - corners, axis=-1).ravel()
    good = (found.ravel() > 0) & (found_back.ravel() > 0) & (apart < _ROUND_TRIP_PX)
    return corners[good, 0].astype(float), there[good, 0].astype(float)


def orb(before: np.ndarray, after: np.ndarray, mask: np.ndarray) -> Pairs:
    """Match ORB descriptors with a test of the best against the second best."""
    detector = cv2.ORB_create(_FEATURES, fastThreshold=8)
    (first, a), (second, b) = (detector.detectAndCompute(image, mask) for image in (before, after))
    matches = cv2.BFMatcher(cv2.NORM_HAMMING).knnMatch(a, b, k=2)
    good = [
        m for m, other in (pair for pair in matches if len(pair) == 2) if m.distance < _RATIO * other.distance
    ]
    return np.array([first[m.queryIdx].pt for m in good]), np.array([second[m.trainIdx].pt for m in good])


def odometry(images: Sequence[np.ndarray], probe: Probe, radius_mm: float, tracker: Tracker) -> np.ndarray:
    """Return camera poses (N, 4, 4) in the first camera's frame; a frame that fails repeats the last step."""
    mask = _wall_mask(probe)
    poses, step = [np.eye(4)], np.eye(4)
    equalise = cv2.createCLAHE(3.0, (16, 16))
    flat = [equalise.apply(image) for image in images]
    for before, after in pairwise(flat):
        found = _step(tracker(before, after, mask), probe, radius_mm)
        step = step if found is None else found
        poses.append(poses[-1] @ step)
    return np.array(poses)


def _step(pairs: Pairs, probe: Probe, radius_mm: float) -> np.ndarray | None:
    """Return the second camera's pose in the first's, or None where the essential matrix is not found."""
    first, second = (_normalised(probe, uv) for uv in pairs)
    good = np.isfinite(first).all(1) & np.isfinite(second).all(1)
    if good.sum() < _FEWEST:
        return None
    first, second = first[good], second[good]
    threshold = _THRESHOLD_PX / float(probe.camera.parameters[0])
    essential, inlier = cv2.findEssentialMat(first, second, np.eye(3), cv2.RANSAC, _CONFIDENCE, threshold)
    if essential is None or essential.shape != (3, 3):
        return None
    _, R, t, seen, points = cv2.recoverPose(
        essential, first, second, np.eye(3), distanceThresh=1e4, mask=inlier
    )
    xyz = (points[:3] / points[3]).T[seen.ravel() > 0]
    if len(xyz) < _FEWEST:
        return None
    T_21 = np.eye(4)
    T_21[:3, :3], T_21[:3, 3] = R, t.ravel() * radius_mm / np.median(np.hypot(xyz[:, 0], xyz[:, 1]))
    return np.linalg.inv(T_21)


def _normalised(probe: Probe, uv: np.ndarray) -> np.ndarray:
    """Return rays (N, 2) at unit depth; NaN where too near the axis or too far from it."""
    ray = probe.camera.unproject(uv).ray
    theta = np.arctan2(np.hypot(ray[:, 0], ray[:, 1]), ray[:, 2])
    inside = (theta > _NEAR_RAD) & (theta < _FAR_RAD)
    return np.where(inside[:, None], ray[:, :2] / np.where(inside, ray[:, 2], 1)[:, None], np.nan)


def _wall_mask(probe: Probe) -> np.ndarray:
    """Return the mask of the pixels in which features of the wall are searched."""
    width, height = probe.camera.image_size
    centre = tuple(round(float(c)) for c in probe.camera.centre_px)
    low, high = (int(r) for r in _ring_radii(probe))
    mask = cv2.circle(np.zeros((height, width), np.uint8), centre, high, 255, -1)
    return cv2.circle(mask, centre, low, 0, -1)


def _ring_radii(probe: Probe) -> Iterator[float]:
    for theta in (_NEAR_RAD, _FAR_RAD):
        uv = probe.camera.project(np.array([[np.sin(theta), 0.0, np.cos(theta)]])).uv
        yield float(np.linalg.norm(uv[0] - probe.camera.centre_px))
