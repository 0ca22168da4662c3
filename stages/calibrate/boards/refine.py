"""Corners of a board refined to a fraction of a pixel, where refining makes them better."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.polynomial.polynomial import polyvander2d
from scipy.spatial import cKDTree

from pipeline.adjustment.robust import Cauchy, robust_spread
from pipeline.arrays import Float, Image

WINDOW_SHARE = 0.33
"""Half the window of refinement over the distance to the next corner: no other corner's edges are in it."""
_SMALLEST_WINDOW, _LARGEST_WINDOW = 2, 20
_STOP = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 100, 1e-4)
_DEGREE = 4
"""Of the polynomial that stands for the board's smooth picture: it leaves 0.1-0.5 px of a fisheye's."""
_ROUNDS = 3
_WORSE_VIEW, _WORSE = 1.3, 3.0
"""Misfit of a view, and of a corner in robust σ, from which the refined places are the worse ones. In
33 rendered boards, blurred by 0 to 5 px, the places err by 0.16 px rms (detected 0.42, refined 0.25)."""


def refine(picture: Image, uv: Float, xyz_b: Float, share: float) -> Float:
    """Refine detected corners, and keep the detected places where refining fails.

    Where blur is as wide as the squares, refining runs to other edges; where squares are seen at a slant, the
    detector errs by some px. Lens and board are smooth: a polynomial of the place on the board tells which of
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
    return float(np.sqrt(np.mean((uv - _robust_fit(terms, uv)) ** 2)))


def refine_in_windows(picture: Image, uv: Float, share: float) -> Float:
    """Return corners (N, 2), px, each refined in a window of ``share`` of the squares around it."""
    spacing = np.asarray(cKDTree(uv).query(uv, 2)[0])[:, 1]
    halves = np.clip(np.floor(share * spacing), _SMALLEST_WINDOW, _LARGEST_WINDOW).astype(int)
    refined = uv.astype(np.float32)
    for i, half in enumerate(halves):
        size = (int(half), int(half))
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
