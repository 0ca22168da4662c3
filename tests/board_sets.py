"""Published real board views from the shared folder, for the calibration tests."""

import json
from pathlib import Path

import cv2
import numpy as np
import scipy.io

from pipeline.instrument.camera import Camera
from pipeline.instrument.camera.calibration import BoardView, rms
from pipeline.instrument.camera.scaramuzza import Scaramuzza
from stages.calibrate.boards.bundle import POSES_ONLY, Corners, Estimate, solve
from stages.calibrate.boards.detect import Chessboard, detect
from stages.calibrate.boards.start import pose
from tests.shared_data import shared


def babelcalib(name: str, part: str) -> tuple[list[BoardView], tuple[int, int]]:
    """Return the published corners of one part of a BabelCalib set, and the image size."""
    file = shared("real", "babelcalib_ov", name, f"{part}.mat")
    content = scipy.io.loadmat(file, squeeze_me=True, struct_as_record=False)
    boards = np.atleast_1d(content["boards"])
    views = []
    for i, corners in enumerate(np.atleast_1d(content["corners"])):
        xyz = [
            boards[b - 1].Rt[:, :2] @ boards[b - 1].X[:, point - 1] + boards[b - 1].Rt[:, 3]
            for point, b in corners.cspond.T
        ]
        views.append(BoardView(f"{part} {i}", np.array(xyz, float), corners.x.T.astype(float)))
    height, width = (int(n) for n in content["imgsize"])
    return views, (width, height)


def detected(file: Path, board: Chessboard) -> BoardView | None:
    """Return the board found in an image file."""
    return detect(cv2.imread(str(file)), board, file.name)


def matlab_camera(name: str) -> Scaramuzza:
    """Return MATLAB's fisheyeParameters as a camera.

    Pixels count from 1, the stretch is scaled to c = 1 for u.
    """
    file = shared("real", "omni_laser_zhang", "published_calibration", f"fisheyeCameraParams{name}.json")
    values = json.loads(file.read_text())["any"][0]["Intrinsics"]["any"][0]
    a0, a2, a3, a4 = values["MappingCoefficients"][0]
    (c, d), (e, _) = values["StretchMatrix"]
    u, v = values["DistortionCenter"][0]
    polynomial = tuple(-c * a / c**k for k, a in enumerate((a0, 0.0, a2, a3, a4)))
    return Scaramuzza((1920, 1080), (u - 1, v - 1), polynomial, (1 / c, e / c, d / c))


def pose_rms_px(view: BoardView, camera: Camera) -> float:
    """Return the rms distance, px, of a board's corners from their projection after fitting only the pose."""
    corners = Corners.of([view])
    posed = solve(Estimate(camera, pose(view, camera)[None], np.zeros(3)), corners, POSES_ONLY, 2.0)
    return rms(posed.residuals(corners))
