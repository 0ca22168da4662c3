"""Motion: camera poses, pipe axis and encoder scale from texture, rings and encoder together.

The packages: ``tracking`` follows the wall's texture, ``bundle_adjustment`` estimates one window of frames,
``windows`` slides it over a long run and joins the windows, ``loops`` closes loops where a wall is seen
again. ``estimate`` is the stage. This module exports the names that other packages use.
"""

from stages.motion.bundle_adjustment import residuals
from stages.motion.bundle_adjustment.equations import MATCH_BIASES, Equations, Measurements
from stages.motion.bundle_adjustment.laser_knock import KnockTest
from stages.motion.bundle_adjustment.unknowns import State
from stages.motion.encoder import EncoderReadings, encoder_at_frames
from stages.motion.estimate import MOTION, JointEstimate, adjust_at_once, estimate_motion
from stages.motion.measuring import measure_run, places_of
from stages.motion.parameters import MotionParameters
from stages.motion.rings import RingBins, circles_in_rings, ring_bins
from stages.motion.tracking.landmarks import Tracks
from stages.motion.windows.steady_laser import with_steady_laser

__all__ = [
    "MATCH_BIASES",
    "MOTION",
    "EncoderReadings",
    "Equations",
    "JointEstimate",
    "KnockTest",
    "Measurements",
    "MotionParameters",
    "RingBins",
    "State",
    "Tracks",
    "adjust_at_once",
    "circles_in_rings",
    "encoder_at_frames",
    "estimate_motion",
    "measure_run",
    "places_of",
    "residuals",
    "ring_bins",
    "with_steady_laser",
]
