"""Select the views and corners that a camera is fitted to: no repeated views, no outliers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.instrument.camera.calibration import BoardView, CameraCalibration, rms
from stages.calibrate.boards.bundle import Estimate
from stages.calibrate.boards.detect import LEAST_CORNERS

# Views whose corners differ by less, px rms, repeat each other: errors of a corner depend on its place
# between pixels, and are the same within half of one.
_SAME_PX = 0.5


def without_repeated(
    views: Sequence[BoardView], first: Estimate
) -> tuple[list[BoardView], Estimate, list[tuple[str, str]]]:
    """Return the views that repeat no earlier one, their poses, and the names of the others with the reason.

    Where all corners lie at the same places, they err alike: the picture is a copy, or nothing was moved.
    """
    kept: list[int] = []
    repeated: list[tuple[str, str]] = []
    for number, view in enumerate(views):
        same = next((views[k] for k in kept if _same_places(views[k], view)), None)
        if same is None:
            kept.append(number)
        else:
            repeated.append((view.name, f"shows the board where {same.name} does, and adds nothing to it"))
    return [views[k] for k in kept], replace(first, T_cb=first.T_cb[kept]), repeated


def _same_places(one: BoardView, other: BoardView) -> bool:
    return one.uv.shape == other.uv.shape and rms(one.uv - other.uv) < _SAME_PX


def without_outlier_corners(
    views: Sequence[BoardView], calibration: CameraCalibration, factor: float
) -> list[BoardView]:
    """Return the views without corners whose residual exceeds ``factor`` times the median of their view.

    A view that would keep fewer than `LEAST_CORNERS` is returned whole: it errs as a view.
    """
    length = np.nan_to_num(np.hypot(*calibration.residual_px.T), nan=np.inf)
    kept = []
    for number, view in enumerate(views):
        own = length[calibration.view == number]
        near = own <= factor * np.median(own)
        few = near.sum() < LEAST_CORNERS
        kept.append(view if few else replace(view, xyz_b=view.xyz_b[near], uv=view.uv[near]))
    return kept


def without_outlier_views(
    views: Sequence[BoardView], first: Estimate, calibration: CameraCalibration, factor: float
) -> tuple[list[BoardView], Estimate, list[str]]:
    """Return views with an rms of at most ``factor`` times the median, their poses, and the others' names."""
    view_rms = calibration.view_rms_px
    kept = view_rms <= factor * np.median(view_rms)
    names = [view.name for view, keep in zip(views, kept, strict=True) if not keep]
    remaining = [view for view, keep in zip(views, kept, strict=True) if keep]
    return remaining, replace(first, T_cb=first.T_cb[kept]), names
