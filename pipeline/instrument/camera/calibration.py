"""What a camera calibration from boards consists of: board views, the fitted camera and its covariance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Float, Int
from pipeline.instrument.camera import Camera


@dataclass(frozen=True)
class BoardView:
    """Corners of a board found in one image.

    Attributes
    ----------
    name : str
        File name of the image.
    xyz_b : (N, 3)
        The corners on the board, mm, in the board's frame B.
    uv : (N, 2)
        The same corners in the image.
    numbered : bool
        Whether it is known which corners of the board these are, as on ChArUco boards; otherwise they are
        known up to a shift on the board and half a turn.
    """

    name: str
    xyz_b: Float
    uv: Float
    numbered: bool = True


@dataclass(frozen=True)
class CameraCalibration:
    """A camera fitted to board views.

    Attributes
    ----------
    camera
    covariance : (P, P)
        Of ``camera.parameters``, with the boards' poses marginalised; scaled by the spread of the residuals.
    names : tuple of str
        The V views used.
    T_cb : (V, 4, 4)
        Board to camera, mm.
    shape_mm : (3,)
        Sag of the board along x², xy and y² about its centre, at its half diagonal.
    view : (M,) int
        The view that each corner belongs to.
    uv, residual_px : (M, 2)
        Observed corners, and projected minus observed.
    sigma_px : float
        1 σ of a corner coordinate, estimated robustly from the residuals.
    """

    camera: Camera
    covariance: Float
    names: tuple[str, ...]
    T_cb: Float
    shape_mm: Float
    view: Int
    uv: Float
    residual_px: Float
    sigma_px: float

    @property
    def rms_px(self) -> float:
        """Root mean square distance of a corner from its projection."""
        return rms(self.residual_px)

    @property
    def view_rms_px(self) -> Float:
        """(V,) the same of each view."""
        return np.array([rms(self.residual_px[self.view == v]) for v in range(len(self.names))])


@dataclass(frozen=True)
class ModelScore:
    """How well one camera model predicts the views; all models are evaluated on the same ones.

    Attributes
    ----------
    model : str
    calibration
        Fitted to all views; None when the model was refused.
    parameters : int
        Number of parameters estimated.
    rms_px, held_out_rms_px : float
        Of the views fitted to, and of views held out in turn; NaN when refused.
    refusal : str
        Why the model was refused, or empty.
    """

    model: str
    calibration: CameraCalibration | None
    parameters: int
    rms_px: float
    held_out_rms_px: float
    refusal: str


@dataclass(frozen=True)
class UncertaintyMap:
    """1 σ of the projection, px, at pixels ``uv`` (R, C, 2); NaN where the model has no ray.

    Attributes
    ----------
    sigma_px : (R, C)
        After the best rotation of the camera is removed.
    raw_sigma_px : (R, C)
        In the camera's own frame.
    """

    uv: Float
    sigma_px: Float
    raw_sigma_px: Float


@dataclass(frozen=True)
class DisplacementMap:
    """Displacement, px, of the same directions in another camera, at pixels ``uv`` (R, C, 2).

    Attributes
    ----------
    displacement_px : (R, C, 2)
        NaN where either camera has no such ray.
    rotation_rad : (3,)
        Rotation between the two cameras that was removed, as a vector.
    """

    uv: Float
    displacement_px: Float
    rotation_rad: Float


@dataclass(frozen=True)
class BoardSurvey:
    """A board as measured: nominal corners (N, 3) and their offsets (N, 3), mm in B."""

    nominal_mm: Float
    offset_mm: Float


@dataclass(frozen=True)
class CalibrationReport:
    """Everything a camera calibration found.

    Attributes
    ----------
    calibration
        Of the chosen model.
    scores
        Of every model that was tried.
    uncertainty
    rejected : tuple of (str, str)
        Images not used, and why.
    compared_with
        The camera compared with: a given one, or the next best model's.
    displacement
        From the calibration to that camera.
    board_shape : str
        Assumed shape of the board: flat, bent or surveyed.
    survey
        The board's corners, when they were measured.
    """

    calibration: CameraCalibration
    scores: tuple[ModelScore, ...]
    uncertainty: UncertaintyMap
    rejected: tuple[tuple[str, str], ...]
    compared_with: Camera | None = None
    displacement: DisplacementMap | None = None
    board_shape: str = "flat"
    survey: BoardSurvey | None = None

    def with_rejected(self, rejected: Sequence[tuple[str, str]]) -> CalibrationReport:
        """Return the report with further images that were not used."""
        return replace(self, rejected=(*rejected, *self.rejected))


def rms(residual_px: Float) -> float:
    """Return the root mean square length of (M, 2) residuals."""
    return float(np.sqrt(np.mean(np.sum(residual_px**2, -1))))
