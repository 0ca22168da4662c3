"""What a camera calibration from boards consists of: board views, the fitted camera and its covariance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.instrument.camera.base import Camera

Float = NDArray[np.float64]
Int = NDArray[np.int64]


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
    """

    name: str
    xyz_b: Float
    uv: Float


@dataclass(frozen=True)
class CameraCalibration:
    """A camera fitted to board views.

    Attributes
    ----------
    camera
    covariance : (P, P)
        Of ``camera.parameters``, the boards' poses marginalised, from the residuals' own spread.
    names : tuple of str
        The V views used.
    T_cb : (V, 4, 4)
        Board to camera, mm.
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


def rms(residual_px: Float) -> float:
    """Return the root mean square length of (M, 2) residuals."""
    return float(np.sqrt(np.mean(np.sum(residual_px**2, -1))))
