"""Error that matches near one polar angle share: its size in a recording, and its effect on distances."""

from __future__ import annotations

import numpy as np

from pipeline.instrument.camera import Camera
from stages.motion.parameters import MotionParameters
from stages.motion.tracking.strips import StripGrid

_SHARED_ERROR = 1 / 3
"""Radial error that matches share over their median reprojection error: compared with a calibrated probe 0.05
of 0.14 px in open-1-field, 0.2 of 0.60 px in its copy at crf 30."""
_MOST_SHARED_PX = 2.0
"""Where matches disagree by more, the parameter's own limit holds."""


def with_shared_error(parameters: MotionParameters, reprojection_px: float) -> MotionParameters:
    """Return the parameters with the size of the radial error that the matches of this recording may share.

    Blur and compression move all matches near one polar angle equally. A scale along the pipe absorbs such an
    error without a residual, so its size is estimated from the scatter of the matches (`_SHARED_ERROR`).
    """
    shared = _SHARED_ERROR * reprojection_px
    if shared <= parameters.match_bias_px:
        return parameters
    return parameters.model_copy(update={"match_bias_px": min(shared, _MOST_SHARED_PX)})


def scale_by_lag(lag_px: float, grid: StripGrid, camera: Camera) -> float:
    """Return the relative 1 σ of distances if templates are cut with an error ``lag_px`` far ahead.

    A codec drops the texture of the dim wall far ahead and repeats it from the picture before. While the
    camera passes such a template, its error shrinks, exactly as if the probe had moved farther, without a
    residual.
    """
    ends = np.array([[grid.radius_mm, 0, grid.far_mm + ahead] for ahead in (-0.5, 0.5)])
    px_per_mm = float(np.linalg.norm(np.diff(camera.project(ends).uv, axis=0)))
    return lag_px / px_per_mm / grid.length_mm
