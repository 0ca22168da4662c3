"""Measures the true positions of the board's corners, from the same views that calibrate the camera.

Printed boards are neither flat nor true to scale everywhere. Every corner gets an offset in mm, shared by all
views, with a prior at zero (K. Strobl, G. Hirzinger, "More accurate pinhole camera calibration with
imperfect planar target", ICCV workshops 2011). Camera and poses are solved with the offsets fixed, then the
offsets with camera and poses fixed, alternately: the corners are then independent of each other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from pipeline.arrays import Float, Int
from pipeline.geometry.rigid import rotation_from_vector
from pipeline.instrument.camera import Camera
from pipeline.instrument.camera.calibration import BoardSurvey, BoardView
from stages.calibrate.boards.bundle import FLAT, POSES_ONLY, Corners, Estimate, Free, cost, solve, weights
from stages.calibrate.boards.fit import BoardCalibrationParameters
from stages.calibrate.boards.start import model_start, pose

# Corners of two views are one when their nominal places agree so well: squares are mm wide, rounding is nm.
_SAME_MM = 1e-3
# Turns between camera and offsets, and how often the views are placed on the board anew (chosen).
_TURNS = 6
_PLACINGS = 2
_CAMERA = Free(np.arange(8), FLAT)
# Polar angle up to which the first camera follows the equidistant one; 1 and 3 rad lead to the same result.
_WIDEST_RAD = 2.0
_QUARTER_TURNS = tuple(rotation_from_vector(np.array([0.0, 0.0, k * np.pi / 2])).round() for k in range(4))


def nominal_board(views: Sequence[BoardView]) -> BoardSurvey:
    """Return the board that the views show, with its corners at their nominal places."""
    points = np.unique(np.round(np.concatenate([v.xyz_b for v in views]) / _SAME_MM), axis=0) * _SAME_MM
    return BoardSurvey(points, np.zeros_like(points))


def applied(survey: BoardSurvey, view: BoardView) -> BoardView:
    """Return a view with its corners at their measured places."""
    index = _index(survey, view.xyz_b)
    known = index < len(survey.nominal_mm)
    offset = np.where(known[:, None], survey.offset_mm[np.where(known, index, 0)], 0.0)
    return replace(view, xyz_b=view.xyz_b + offset)


def placed(survey: BoardSurvey, view: BoardView, camera: Camera, huber_px: float) -> BoardView:
    """Return a view with its corners numbered as they agree best with the measured board.

    A chessboard may be seen upside down or in part, and a part turned sideways. All placements that its grid
    allows differ only by the board's own irregularities, so each is tried.
    """
    places = [view] if view.numbered else _placements(survey, view) or [view]
    return min(places, key=lambda v: _pose_cost(applied(survey, v), camera, huber_px))


def survey_board(
    views: Sequence[BoardView], first: Estimate, parameters: BoardCalibrationParameters
) -> tuple[BoardSurvey, list[BoardView], Estimate]:
    """Measure the board in its own calibration views.

    Returns
    -------
    survey
    views
        Views placed on the board, with nominal corners.
    estimate
        A Kannala-Brandt camera and the poses.
    """
    survey, shown = nominal_board(views), list(views)
    camera = model_start("kannala_brandt", first, _WIDEST_RAD, parameters.polynomial_degree)
    estimate = Estimate(camera, first.T_cb, np.zeros(3))
    for turn in range(_PLACINGS + 1):
        survey, estimate = _refined(survey, shown, estimate, parameters)
        if turn < _PLACINGS:
            shown = [placed(survey, view, estimate.camera, parameters.huber_px) for view in shown]
            poses = [_pose_of(applied(survey, view), estimate.camera, parameters.huber_px) for view in shown]
            estimate = replace(estimate, T_cb=np.concatenate([p.T_cb for p in poses]))
    return survey, shown, estimate


def _refined(
    survey: BoardSurvey,
    views: Sequence[BoardView],
    estimate: Estimate,
    parameters: BoardCalibrationParameters,
) -> tuple[BoardSurvey, Estimate]:
    """Return board and estimate after solving camera and poses, then the offsets, `_TURNS` times."""
    index = np.concatenate([_index(survey, view.xyz_b) for view in views])
    for _ in range(_TURNS):
        corners = Corners.of([applied(survey, view) for view in views])
        estimate = solve(estimate, corners, _CAMERA, parameters.huber_px)
        survey = replace(survey, offset_mm=_offsets(survey, index, corners, estimate, parameters))
    return survey, estimate


def _offsets(
    survey: BoardSurvey,
    index: Int,
    corners: Corners,
    estimate: Estimate,
    parameters: BoardCalibrationParameters,
) -> Float:
    """Return the offsets (N, 3) of least cost with camera and poses fixed: one Gauss-Newton step each."""
    residual = estimate.residuals(corners)
    weight = weights(residual, parameters.huber_px)
    rotation = estimate.T_cb[corners.view][:, :3, :3]
    jacobian = estimate.camera.project_jacobian(estimate.points(corners)).by_point @ rotation
    sound = weight > 0
    jacobian, residual = np.where(sound[:, None, None], jacobian, 0), np.where(sound[:, None], residual, 0)
    noise = float(np.average(np.sum(residual**2, -1), weights=weight)) / 2
    prior = noise / parameters.survey_sigma_mm**2
    normal = np.zeros((len(survey.nominal_mm), 3, 3))
    gradient = prior * survey.offset_mm
    np.add.at(normal, index, weight[:, None, None] * np.einsum("mki,mkj->mij", jacobian, jacobian))
    np.add.at(gradient, index, weight[:, None] * np.einsum("mki,mk->mi", jacobian, residual))
    step = np.linalg.solve(normal + prior * np.eye(3), gradient[..., None])[..., 0]
    return np.asarray(survey.offset_mm - step)


def _index(survey: BoardSurvey, xyz_b: Float) -> Int:
    """Return which corner each nominal point (M, 3) is; N where it is none."""
    distance, index = cKDTree(survey.nominal_mm).query(xyz_b, distance_upper_bound=10 * _SAME_MM)
    return np.where(np.isfinite(distance), index, len(survey.nominal_mm)).astype(np.int64)


def _placements(survey: BoardSurvey, view: BoardView) -> list[BoardView]:
    found = []
    for turned in (view.xyz_b @ R_bb for R_bb in _QUARTER_TURNS):
        for corner in survey.nominal_mm:
            moved = turned + (corner - turned[0])
            if np.all(_index(survey, moved) < len(survey.nominal_mm)):
                found.append(replace(view, xyz_b=moved))
    return found


def _pose_of(view: BoardView, camera: Camera, huber_px: float) -> Estimate:
    start = Estimate(camera, pose(view, camera)[None], np.zeros(3))
    return solve(start, Corners.of([view]), POSES_ONLY, huber_px)


def _pose_cost(view: BoardView, camera: Camera, huber_px: float) -> float:
    return cost(_pose_of(view, camera, huber_px).residuals(Corners.of([view])), huber_px)
