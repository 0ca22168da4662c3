"""Published cameras give poses of the boards in their own photographs, but not in those of another camera."""

import pytest

from pipeline.instrument.camera.formats import read_camera
from stages.calibrate.boards.detect import Chessboard
from tests.board_sets import detected, matlab_camera, pose_rms_px
from tests.shared_data import shared


@pytest.mark.parametrize(
    ("image", "own", "other", "limit_px"),
    [
        ("Pro1.jpg", "Real1", "Real2old", 0.4),
        ("Pro2.jpg", "Real1", "Real2old", 0.4),
        ("recon_0001.jpg", "Real2old", "Real1", 0.5),
        ("testr26_1.jpg", "Real2old", "Real1", 0.5),
        ("testr28.jpg", "Real2old", "Real1", 0.5),
        ("testr30.jpg", "Real2old", "Real1", 0.5),
        ("testr28_1.jpg", "Real2old", "Real1", 0.5),
        ("testr32_1_2.jpg", "Real2old", "Real1", 0.5),
    ],
)
def test_matlab_cameras_give_the_poses_of_their_boards(image, own, other, limit_px):
    view = detected(
        shared("real", "omni_laser_zhang", "calib_experience_real", image), Chessboard(9, 6, 26.0)
    )
    assert view is not None
    assert pose_rms_px(view, matlab_camera(own)) <= limit_px
    assert pose_rms_px(view, matlab_camera(other)) > 1.3 * pose_rms_px(view, matlab_camera(own))


def test_the_ocamcalib_camera_gives_the_pose_of_a_red_and_white_board_far_off_its_axis():
    """The only photograph there shows the board at 63°, where the published camera is 1.6 px off."""
    camera = read_camera(shared("real", "ocam_umh", "calib_results.txt"))
    image = shared("real", "ocam_umh", "images", "1686048866194162000.png")
    view = detected(image, Chessboard(9, 6, 59.4))
    assert view is not None
    assert len(view.uv) == 54
    assert pose_rms_px(view, camera) <= 1.7
