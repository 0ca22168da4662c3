"""A camera from pictures of a chessboard or ChArUco board."""

from pipeline.machine.stage import Parameters, Stage
from stages.calibrate.boards.calibrate import CameraFile, calibrate_camera
from stages.calibrate.boards.fit import BoardCalibrationParameters
from stages.calibrate.boards.pictures import (
    FoundBoards,
    Pictures,
    Target,
    find_boards,
    list_pictures,
)

__all__ = ["BOARDS", "CAMERA", "CameraFile", "FoundBoards", "Pictures", "Target", "list_pictures"]

BOARDS = Stage("boards", "1", Parameters, find_boards, "pictures to the corners of the board in them")
CAMERA = Stage(
    "camera", "1", BoardCalibrationParameters, calibrate_camera, "corners of boards to a judged camera"
)
