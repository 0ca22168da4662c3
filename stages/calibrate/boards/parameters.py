"""Parameters of camera calibration from boards."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from pipeline.machine.stage import Parameters

ModelName = Literal["kannala_brandt", "scaramuzza", "unified", "equidistant", "pinhole"]
MODEL_NAMES: tuple[ModelName, ...] = ("kannala_brandt", "scaramuzza", "unified", "equidistant", "pinhole")


class BoardCalibrationParameters(Parameters):
    """How a camera is fitted to board views, and what makes views unfit for it."""

    huber_px: float = Field(
        default=1.0, gt=0, le=20, description="residual beyond which a corner counts linearly, px"
    )
    model: Literal["best", ModelName] = Field(
        default="best", description="camera model; best: the one that predicts held-out pictures best"
    )
    board_shape: Literal["flat", "bent", "surveyed", "best"] = Field(
        default="best",
        description="board taken for flat, its sag estimated, every corner estimated, or whichever of the "
        "latter two predicts held-out views best",
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
        default=8.0,
        ge=0,
        le=90,
        description="boards whose directions differ by less are refused, deg",
    )
    outlier_view_factor: float = Field(
        default=4.0, gt=1, le=100, description="views whose rms is this many times the median are left out"
    )
    largest_scale_sigma: float = Field(
        default=0.02,
        gt=0,
        le=1,
        description="a larger relative 1 σ of the image scale is refused",
    )
