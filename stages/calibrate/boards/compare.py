"""Measures the quality of a camera calibration.

The measures are the reprojection of held-out views, the uncertainty over the image, and the displacement
relative to the image of another camera.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Bool, Float
from pipeline.errors import UnusableError
from pipeline.geometry.rigid import rotation_from_vector, skew
from pipeline.instrument.camera import Camera
from pipeline.instrument.camera.calibration import (
    BoardSurvey,
    BoardView,
    CameraCalibration,
    DisplacementMap,
    ModelScore,
    UncertaintyMap,
    rms,
)
from stages.calibrate.boards.bundle import Estimate
from stages.calibrate.boards.fit import BoardCalibrationParameters, ModelName, fit, held_out_residuals
from stages.calibrate.boards.survey import applied, placed, survey_board

# Places across the image at which the maps of uncertainty and displacement are computed.
_GRID_COLUMNS = 41
# Most Gauss-Newton steps of the rotation between two cameras; steps below 1e-12 rad end them earlier.
_TURNING_STEPS = 20


@dataclass(frozen=True)
class Part:
    """Views that a camera is fitted to, and views held out to test it.

    Attributes
    ----------
    inside, outside
        Fitted views, and held-out views; ``outside`` is empty if all views are fitted. Both have the board's
        corners as measured in the fitted views.
    first
        Start of the fit: a camera and the poses of the views inside.
    survey
        The board as measured in the fitted views; None if the board was not measured.
    """

    inside: list[BoardView]
    outside: list[BoardView]
    first: Estimate
    survey: BoardSurvey | None = None


def deal(
    views: Sequence[BoardView], first: Estimate, parameters: BoardCalibrationParameters
) -> tuple[Part, tuple[Part, ...]]:
    """Return a part that fits all views, and ``parameters.folds`` parts that each hold out other views."""
    index = np.arange(len(views))
    folds = min(parameters.folds, len(views))
    masks = [index % folds == fold for fold in range(folds)]
    whole = _part(views, first, np.zeros(len(views), bool), parameters)
    return whole, tuple(_part(views, first, mask, parameters) for mask in masks)


def _part(
    views: Sequence[BoardView], first: Estimate, out: Bool, parameters: BoardCalibrationParameters
) -> Part:
    inside = [view for view, left in zip(views, out, strict=True) if not left]
    outside = [view for view, left in zip(views, out, strict=True) if left]
    start = replace(first, T_cb=first.T_cb[~out])
    if parameters.board_shape != "surveyed":
        return Part(inside, outside, start)
    survey, shown, estimate = survey_board(inside, start, parameters)
    elsewhere = [placed(survey, view, estimate.camera, parameters.huber_px) for view in outside]
    return Part(
        [applied(survey, view) for view in shown],
        [applied(survey, view) for view in elsewhere],
        replace(start, T_cb=estimate.T_cb),
        survey,
    )


def score(
    whole: Part, parts: Sequence[Part], model: ModelName, parameters: BoardCalibrationParameters
) -> ModelScore:
    """Return the residuals of a model, for the fitted and for the held-out views.

    ``parameters.board_shape`` must be the shape with which the parts were made, not "best".
    """
    try:
        fitted = fit(whole.inside, whole.first, model, parameters)
        residuals = [_held_out(part, model, parameters) for part in parts]
    except UnusableError as error:
        return ModelScore(model, None, 0, np.nan, np.nan, error.problem)
    held_out = np.concatenate(residuals)
    if np.isnan(held_out).any():
        return ModelScore(
            model, fitted, 0, fitted.rms_px, np.nan, "cannot project corners that were held out"
        )
    free = int(np.count_nonzero(np.diag(fitted.covariance)))
    return ModelScore(model, fitted, free, fitted.rms_px, rms(held_out), "")


def ranked(scores: Sequence[ModelScore]) -> list[CameraCalibration]:
    """Return the calibrations that were not refused, the one that predicts held-out views best first."""
    usable = [s for s in scores if s.calibration is not None and np.isfinite(s.held_out_rms_px)]
    ordered = sorted(usable, key=lambda s: s.held_out_rms_px)
    return [s.calibration for s in ordered if s.calibration is not None]


def uncertainty_map(calibration: CameraCalibration) -> UncertaintyMap:
    """Return 1 σ, px, of the projection of a direction, over the image.

    A small rotation of the camera together with all boards changes no picture. So ``sigma_px`` excludes the
    rotation that best compensates a change of parameters over the image; ``raw_sigma_px`` includes it.
    """
    camera = calibration.camera
    uv, ray, valid = _grid_rays(camera)
    jacobian = camera.project_jacobian(ray)
    turning = -jacobian.by_point @ skew(ray)
    undone = np.linalg.lstsq(turning[valid].reshape(-1, 3), _flat(jacobian.by_parameters[valid]), rcond=None)[
        0
    ]
    left = jacobian.by_parameters - turning @ undone
    covariance = calibration.covariance
    return UncertaintyMap(uv, _root_trace(left, covariance), _root_trace(jacobian.by_parameters, covariance))


def displacement_map(camera: Camera, other: Camera) -> DisplacementMap:
    """Return the displacement, px, between the projections of a direction by ``camera`` and ``other``.

    The rotation between the two cameras that minimises the displacement is removed and returned.
    """
    uv, ray, valid = _grid_rays(camera)
    rotation = np.zeros(3)
    for _ in range(_TURNING_STEPS):
        turned = ray @ rotation_from_vector(rotation).T
        seen = valid & other.project(turned).valid
        difference = other.project(turned[seen]).uv - uv[seen]
        weight = 1 / np.maximum(np.hypot(*difference.T), 1.0)
        by_rotation = -other.project_jacobian(turned[seen]).by_point @ skew(turned[seen])
        rows, right = (by_rotation * weight[:, None, None]).reshape(-1, 3), difference * weight[:, None]
        step = np.linalg.lstsq(rows, -right.ravel(), rcond=None)[0]
        rotation = rotation + step
        if np.abs(step).max() < 1e-12:
            break
    turned = ray @ rotation_from_vector(rotation).T
    return DisplacementMap(uv, other.project(turned).uv - uv, rotation)


def _held_out(part: Part, model: ModelName, parameters: BoardCalibrationParameters) -> Float:
    fitted = fit(part.inside, part.first, model, parameters)
    return np.concatenate(held_out_residuals(fitted, part.outside, parameters.huber_px))


def _grid_rays(camera: Camera) -> tuple[Float, Float, Bool]:
    width, height = camera.image_size
    rows = max(round(_GRID_COLUMNS * height / width), 2)
    u, v = np.meshgrid(np.linspace(0, width - 1, _GRID_COLUMNS), np.linspace(0, height - 1, rows))
    uv = np.stack([u, v], -1)
    rays = camera.unproject(uv)
    return uv, rays.ray, rays.valid


def _flat(array: Float) -> Float:
    return array.reshape(-1, array.shape[-1])


def _root_trace(jacobian: Float, covariance: Float) -> Float:
    """Return the root of the mean variance of the two pixel coordinates."""
    variance = np.einsum("...ip,pq,...iq->...", jacobian, covariance, jacobian) / 2
    return np.asarray(np.sqrt(variance))
