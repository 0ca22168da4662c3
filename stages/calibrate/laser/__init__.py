"""The laser plane from pictures of a board with the laser line across it."""

from pipeline.machine.stage import Stage
from stages.calibrate.laser.calibrate import LaserCalibration, calibrate_laser
from stages.calibrate.laser.line import LaserPlaneParameters

__all__ = ["LASER_PLANE", "LaserCalibration"]

LASER_PLANE = Stage(
    "laser_plane", "1", LaserPlaneParameters, calibrate_laser, "laser lines on boards to the laser's plane"
)
