"""Calibrations with published real sets: held-out reprojection errors, and boards found."""

import numpy as np
import pytest

from pipeline.instrument.camera.calibration import rms
from stages.calibrate.boards import calibrate_boards
from stages.calibrate.boards.detect import Chessboard
from stages.calibrate.boards.fit import BoardCalibrationParameters, fit, held_out_residuals
from stages.calibrate.boards.start import start
from tests.board_sets import babelcalib, detected
from tests.quiet import quiet_context
from tests.shared_data import shared


@pytest.mark.parametrize(("name", "limit_px"), [("ov_plane", 0.475), ("ov_cube", 0.294)])
def test_babelcalib_held_out(name, limit_px):
    """Kannala-Brandt, Huber 1 px, a flat board and fixed intrinsics, like the published check."""
    parameters = BoardCalibrationParameters(board_shape="flat", huber_px=1.0)
    train, size = babelcalib(name, "train")
    test, _ = babelcalib(name, "test")
    found = fit(train, start(train, size), "kannala_brandt", parameters)
    residuals = np.concatenate(held_out_residuals(found, test, parameters.huber_px))
    assert rms(residuals) <= limit_px
    assert len(residuals) == sum(len(v.uv) for v in test)


def test_babelcalib_plane_is_bent():
    """Estimating the sag of the printed board also improves the prediction of boards not fitted."""
    train, size = babelcalib("ov_plane", "train")
    test, _ = babelcalib("ov_plane", "test")
    found = fit(train, start(train, size), "kannala_brandt", BoardCalibrationParameters(board_shape="bent"))
    assert rms(np.concatenate(held_out_residuals(found, test, 1.0))) <= 0.43


def test_urban_fisheye_boards_are_found_and_fitted():
    """The published 0.241 px is a mean distance, with board "rotations" left free to be any matrix.

    Ours is the root mean square distance with rigid poses, and the corners of the board were estimated as
    well.
    """
    files = sorted(shared("real", "fisheye_urban_ocamcalib", "fish_1").glob("*.jpg"))
    seen = [detected(file, Chessboard(8, 6, 32.5)) for file in files]
    views = [view for view in seen if view is not None]
    assert sum(len(view.uv) == 48 for view in views) >= 9
    report = calibrate_boards(
        views,
        (1032, 778),
        ["kannala_brandt", "scaramuzza"],
        None,
        BoardCalibrationParameters(),
        quiet_context(),
    )
    assert report.board_shape == "surveyed"
    for score in report.scores:
        assert score.rms_px <= 0.241
        assert score.held_out_rms_px <= 0.29
