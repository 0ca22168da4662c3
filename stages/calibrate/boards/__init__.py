"""Calibrates a camera from pictures of a chessboard or ChArUco board, and tests it on held-out views."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.errors import UnusableError
from pipeline.instrument.camera import Camera
from pipeline.instrument.camera.calibration import BoardView, CalibrationReport, CameraCalibration, ModelScore
from pipeline.machine.stage import Context, Parameters, Stage
from stages.calibrate.boards.bundle import Estimate
from stages.calibrate.boards.compare import (
    Part,
    deal,
    displacement_map,
    ranked,
    score,
    uncertainty_map,
)
from stages.calibrate.boards.fit import (
    MODEL_NAMES,
    NAME,
    BoardCalibrationParameters,
    ModelName,
    adjust,
    refuse_one_plane,
    refuse_too_few,
)
from stages.calibrate.boards.pictures import FoundBoards, Pictures, Target, find_boards, list_pictures
from stages.calibrate.boards.selection import without_outlier_corners, without_outlier_views, without_repeated
from stages.calibrate.boards.start import start

__all__ = ["BOARDS", "CAMERA", "CameraFile", "FoundBoards", "Pictures", "Target", "list_pictures"]


_CONTRADICTS = "its corners contradict the camera that the other images agree on"


@dataclass(frozen=True)
class CameraFile:
    """A camera read from a file, and the file's name; ``camera`` is None where no file was given."""

    camera: Camera | None = None
    name: str = ""


def calibrate_camera(
    found: FoundBoards, reference: CameraFile, *, parameters: BoardCalibrationParameters, context: Context
) -> CalibrationReport:
    """Fit camera models to the boards found: see `calibrate_boards`."""
    models = MODEL_NAMES if parameters.model == "best" else (parameters.model,)
    report = calibrate_boards(found.views, found.image_size, models, reference.camera, parameters, context)
    return report.with_rejected(found.rejected)


def calibrate_boards(
    views: Sequence[BoardView],
    image_size: tuple[int, int],
    models: Sequence[ModelName],
    reference: Camera | None,
    parameters: BoardCalibrationParameters,
    context: Context,
) -> CalibrationReport:
    """Fit camera models to board views and return the one that predicts held-out views best.

    Parameters
    ----------
    views
        Corners found, one entry an image; at least four corners each, not in one line.
    image_size
        Width and height, px.
    models
        Names of the camera models to try.
    reference
        A camera to compare with; without one, the best model is compared with the next best.

    Raises
    ------
    UnusableError
        When there are too few views, when plane boards all lie in one plane or in parallel ones, when the
        views leave the image scale undetermined, or when no model can project all corners.
    """
    refuse_too_few(views, parameters)
    first = start(views, image_size)
    refuse_one_plane(views, first, parameters)
    views, first, repeated = without_repeated(views, first)
    refuse_too_few(views, parameters)
    sound, trial = _sound_corners(views, first, with_shape(parameters, "bent"))
    lost = sum(len(v.uv) for v in views) - sum(len(v.uv) for v in sound)
    context.report("not used: corners that contradict the others of their picture", lost, "corners")
    used, first, outliers = without_outlier_views(sound, first, trial, parameters.outlier_view_factor)
    refuse_too_few(used, parameters)
    parameters, whole, parts = board_as_it_is(used, first, parameters)
    scores = _scores(whole, parts, models, parameters, context)
    ranking = ranked(scores)
    if not ranking:
        raise _no_model(scores)
    chosen = ranking[0]
    other = reference if reference is not None else next((c.camera for c in ranking[1:]), None)
    return CalibrationReport(
        chosen,
        scores,
        uncertainty_map(chosen),
        (*repeated, *((name, _CONTRADICTS) for name in outliers)),
        other,
        None if other is None else displacement_map(chosen.camera, other),
        parameters.board_shape,
        whole.survey,
    )


def _sound_corners(
    views: Sequence[BoardView], first: Estimate, parameters: BoardCalibrationParameters
) -> tuple[list[BoardView], CameraCalibration]:
    """Return the views without wrong corners, and a camera fitted to them.

    A board that reaches beyond the image circle, or is seen very obliquely, has single corners that are found
    elsewhere. They are removed until none is left, since they pulled the pose away from the others.
    """
    sound, trial = list(views), adjust(views, first, "kannala_brandt", parameters)
    while True:
        kept = without_outlier_corners(sound, trial, parameters.outlier_corner_factor)
        if sum(len(v.uv) for v in kept) == len(trial.uv):
            return sound, trial
        sound = kept
        trial = adjust(sound, replace(first, T_cb=trial.T_cb), "kannala_brandt", parameters)


def board_as_it_is(
    views: Sequence[BoardView], first: Estimate, parameters: BoardCalibrationParameters
) -> tuple[BoardCalibrationParameters, Part, tuple[Part, ...]]:
    """Return parameters with the board's shape decided, and the views divided for held-out tests.

    If ``board_shape`` is "best", a Kannala-Brandt camera is fitted with each shape, and the shape that
    predicts held-out views best is used.
    """
    if parameters.board_shape != "best":
        return parameters, *deal(views, first, parameters)
    tried = []
    for shape in ("bent", "surveyed"):
        definite = with_shape(parameters, shape)
        whole, parts = deal(views, first, definite)
        held_out = score(whole, parts, "kannala_brandt", definite).held_out_rms_px
        tried.append((np.nan_to_num(held_out, nan=np.inf), definite, whole, parts))
    return min(tried, key=lambda t: float(t[0]))[1:]


def with_shape(parameters: BoardCalibrationParameters, shape: str) -> BoardCalibrationParameters:
    """Return the parameters with another board shape."""
    return BoardCalibrationParameters.model_validate(parameters.model_dump() | {"board_shape": shape})


def _scores(
    whole: Part,
    parts: Sequence[Part],
    models: Sequence[ModelName],
    parameters: BoardCalibrationParameters,
    context: Context,
) -> tuple[ModelScore, ...]:
    scores = []
    for done, model in enumerate(models, start=1):
        scores.append(score(whole, parts, model, parameters))
        context.progress(done, len(models))
    return tuple(scores)


def _no_model(scores: Sequence[ModelScore]) -> UnusableError:
    reasons = "; ".join(f"{s.model}: {s.refusal}" for s in scores)
    return UnusableError(
        NAME,
        f"no camera model can be calibrated from these views: {reasons}",
        hint="tilt the board more, and show it at more places of the image, also near its edges",
    )


BOARDS = Stage("boards", "1", Parameters, find_boards, "pictures to the corners of the board in them")
CAMERA = Stage(
    "camera", "2", BoardCalibrationParameters, calibrate_camera, "corners of boards to a judged camera"
)
