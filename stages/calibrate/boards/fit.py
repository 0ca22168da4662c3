"""Fits one camera model to board views, and refuses views that cannot determine a camera."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
from pydantic import Field

from pipeline.arrays import Float
from pipeline.errors import UnusableError
from pipeline.instrument.camera import Camera
from pipeline.instrument.camera.calibration import BoardView, CameraCalibration
from pipeline.instrument.camera.scaramuzza import Scaramuzza
from pipeline.machine.stage import Parameters
from stages.calibrate.boards.bundle import BENT, FLAT, POSES_ONLY, Corners, Estimate, Free, covariance, solve
from stages.calibrate.boards.start import model_start, pose

NAME = "calibrate-camera"
ModelName = Literal["kannala_brandt", "scaramuzza", "unified", "equidistant", "pinhole"]
MODEL_NAMES: tuple[ModelName, ...] = ("kannala_brandt", "scaramuzza", "unified", "equidistant", "pinhole")


class BoardCalibrationParameters(Parameters):
    """Parameters of fitting a camera to board views, and of refusing views."""

    huber_px: float = Field(
        default=1.0, gt=0, le=20, description="residual beyond which a corner's cost is linear (Huber), px"
    )
    model: Literal["best", ModelName] = Field(
        default="best", description="camera model; best: the one that predicts held-out pictures best"
    )
    board_shape: Literal["flat", "bent", "surveyed", "best"] = Field(
        default="best",
        description="shape of the board: flat; with its sag estimated; with every corner estimated; or "
        "whichever of the latter two predicts held-out views best",
    )
    survey_sigma_mm: float = Field(
        default=0.3, gt=0, le=10, description="1 σ of a corner's offset from its nominal place, mm"
    )
    polynomial_degree: int = Field(
        default=7, ge=3, le=12, description="degree of Scaramuzza's polynomial; OCamCalib's own default is 4"
    )
    folds: int = Field(
        default=5, ge=2, le=50, description="parts for held-out reprojection, each left out once"
    )
    least_views: int = Field(default=4, ge=3, le=1000, description="fewer views than this are refused")
    least_tilt_deg: float = Field(
        default=8.0, ge=0, le=90, description="boards whose directions differ by less are refused, deg"
    )
    outlier_corner_factor: float = Field(
        default=5.0, gt=1, le=100,
        description="corners whose residual is this many times the median of their picture are left out; "
        "of Gaussian errors, 3 in 1e8 are",
    )  # fmt: skip
    outlier_view_factor: float = Field(
        default=4.0, gt=1, le=100, description="views whose rms is this many times the median are left out"
    )
    largest_scale_sigma: float = Field(
        default=0.02, gt=0, le=1, description="a larger relative 1 σ of the image scale is refused"
    )


def fit(
    views: Sequence[BoardView], first: Estimate, model: ModelName, parameters: BoardCalibrationParameters
) -> CameraCalibration:
    """Fit a camera model to board views, and refuse an unreliable fit: see `adjust`.

    Raises
    ------
    UnusableError
        When the model cannot project the boards, or the views leave the image scale undetermined.
    """
    calibration = adjust(views, first, model, parameters)
    _refuse_unseen(calibration)
    _refuse_undetermined(calibration, parameters)
    return calibration


def adjust(
    views: Sequence[BoardView], first: Estimate, model: ModelName, parameters: BoardCalibrationParameters
) -> CameraCalibration:
    """Fit a camera model to board views.

    Parameters
    ----------
    views
        At least as many as ``parameters.least_views``.
    first
        An equidistant camera and poses near the answer, from `stages.calibrate.boards.start.start`.
    """
    corners = Corners.of(views)
    camera = model_start(model, first, _widest_angle(first, corners), parameters.polynomial_degree)
    seed = replace(first, camera=camera)
    free = shared_parameters(seed.camera, corners, parameters)
    estimate = solve(
        solve(seed, corners, _flat(free), parameters.huber_px), corners, free, parameters.huber_px
    )
    residual = estimate.residuals(corners)
    spread, sigma_px = covariance(estimate, corners, free, parameters.huber_px)
    return CameraCalibration(
        estimate.camera,
        _embedded(spread, free, len(estimate.camera.parameters)),
        tuple(view.name for view in views),
        estimate.T_cb,
        estimate.shape_mm,
        corners.view,
        corners.uv,
        residual,
        sigma_px,
    )


def held_out_residuals(
    calibration: CameraCalibration, views: Sequence[BoardView], huber_px: float
) -> list[Float]:
    """Return residuals (N, 2), px, of views not used before: only their poses are fitted."""
    residuals = []
    for view in views:
        corners = Corners.of([view])
        posed = Estimate(calibration.camera, pose(view, calibration.camera)[None], calibration.shape_mm)
        residuals.append(solve(posed, corners, POSES_ONLY, huber_px).residuals(corners))
    return residuals


def shared_parameters(camera: Camera, corners: Corners, parameters: BoardCalibrationParameters) -> Free:
    """Return the parameters that are estimated in addition to the poses.

    Scaramuzza's e stays 0: a rotation of the sensor about the optical axis is compensated by rotating all
    board poses, so that c, d, e and the polynomial's scale have only three degrees of freedom.
    """
    plane = bool(np.ptp(corners.xyz_b[:, 2]) < 1e-9)
    shape = BENT if plane and parameters.board_shape == "bent" else FLAT
    indices = np.arange(len(camera.parameters))
    if isinstance(camera, Scaramuzza):
        indices = indices[indices != camera.parameter_names.index("e")]
    return Free(indices, shape)


def refuse_too_few(views: Sequence[BoardView], parameters: BoardCalibrationParameters) -> None:
    """Raise `UnusableError` when there are fewer views than a calibration needs."""
    if len(views) < parameters.least_views:
        raise UnusableError(
            NAME,
            f"the board was found in {len(views)} usable images",
            limit=f"at least {parameters.least_views}",
            hint="take more pictures, with the board at different places, distances and tilts",
        )


def refuse_one_plane(
    views: Sequence[BoardView], first: Estimate, parameters: BoardCalibrationParameters
) -> None:
    """Raise when plane boards all face the same way.

    Parallel boards constrain the camera hardly better than a single one: focal length and distance trade off.

    Raises
    ------
    UnusableError
        Saying by how much the boards' directions differ.
    """
    spread = np.rad2deg(_largest_tilt(first.T_cb))
    flat = max(float(np.ptp(v.xyz_b[:, 2])) for v in views) < 1e-9
    if flat and spread < parameters.least_tilt_deg:
        raise UnusableError(
            NAME,
            f"all {len(views)} views show the board in one plane or in parallel planes: "
            f"its direction changes by no more than {spread:.1f}°",
            limit=f"at least {parameters.least_tilt_deg:g}°",
            hint="tilt the board to all sides, by 20° to 50°, and move it into the corners of the image",
        )


def _largest_tilt(T_cb: Float) -> float:
    normal = T_cb[:, :3, 2]
    return float(np.arccos(np.clip(np.abs(normal @ normal.T), 0, 1)).max())


def _widest_angle(estimate: Estimate, corners: Corners) -> float:
    points = estimate.points(corners)
    return float(np.arctan2(np.hypot(points[:, 0], points[:, 1]), points[:, 2]).max())


def _flat(free: Free) -> Free:
    return Free(free.camera, FLAT)


def _embedded(spread: Float, free: Free, count: int) -> Float:
    """Return the camera's block of the shared covariance, zero for parameters that were held."""
    full = np.zeros((count, count))
    inner = len(free.camera)
    full[np.ix_(free.camera, free.camera)] = spread[:inner, :inner]
    return full


def _refuse_unseen(calibration: CameraCalibration) -> None:
    lost = int(np.isnan(calibration.residual_px).any(1).sum())
    if lost:
        raise UnusableError(
            NAME,
            f"the model {calibration.camera.model} cannot project {lost} of {len(calibration.uv)} corners",
            hint="choose a model that sees this far from its axis: kannala_brandt, scaramuzza or unified",
        )


def _refuse_undetermined(calibration: CameraCalibration, parameters: BoardCalibrationParameters) -> None:
    """Raise when the image scale is too uncertain: relative 1 σ of the image radius of the median corner."""
    camera = calibration.camera
    radius = np.hypot(*(calibration.uv - camera.centre_px).T)
    typical = calibration.uv[np.argsort(radius)[len(radius) // 2]]
    ray = camera.unproject(typical).ray
    jacobian = camera.project_jacobian(ray).by_parameters
    outward = (typical - camera.centre_px) / np.linalg.norm(typical - camera.centre_px)
    centre = np.array([n in ("cx", "cy") for n in camera.parameter_names])
    row = np.where(centre, 0.0, outward @ jacobian)
    relative = float(np.sqrt(row @ calibration.covariance @ row) / np.linalg.norm(typical - camera.centre_px))
    if not relative <= parameters.largest_scale_sigma:
        weakest = _weakest_direction(calibration)
        raise UnusableError(
            NAME,
            f"the views leave the image scale uncertain by {100 * relative:.1f} % (1 σ); "
            f"weakest direction: {weakest}",
            limit=f"{100 * parameters.largest_scale_sigma:g} %",
            hint="tilt the board more, and show it at more places of the image",
        )


def _weakest_direction(calibration: CameraCalibration) -> str:
    sigma = np.sqrt(np.maximum(np.diag(calibration.covariance), 1e-300))
    correlation = calibration.covariance / sigma / sigma[:, None]
    vector = np.linalg.eigh(correlation)[1][:, -1]
    strongest = np.argsort(-np.abs(vector))[:3]
    names = calibration.camera.parameter_names
    return ", ".join(f"{vector[i]:+.2f} {names[i]}" for i in strongest)
