"""Corrects frame times that scatter because the pictures of a regular camera were stamped on arrival."""

from __future__ import annotations

import numpy as np

from pipeline.adjustment.robust import root_mean_square, spread_about_median
from pipeline.arrays import Float
from pipeline.machine.stage import Context
from pipeline.recording.base import Recording
from stages.motion.tracking.landmarks import TrackedPoses

_SCATTER = 0.01
"""Smaller scatter of stamps, in frame times, does not matter: at 20 mm/s and 30 frames/s it makes 7 µm."""
_FARTHEST = 0.5
"""Stamps farther from an even rhythm, in frame times, are not scatter: frames are missing, or the rhythm
changes."""
_BETTER = 0.7
"""Equal intervals are used if they reduce the difference of encoder and wall to this share: if the stamps are
right, it rises. Not measured."""
_FEWEST = 10


def frame_times(recording: Recording, tracked: TrackedPoses, context: Context) -> Float:
    """Return the frames' times (N,): equal intervals where encoder and texture agree better with them."""
    stamps = recording.frames.time_s
    even = even_rhythm(stamps)
    if even is None or recording.encoder is None:
        return stamps
    found = ~tracked.lost[1:] & ~tracked.lost[:-1]
    if found.sum() < _FEWEST:
        return stamps
    by_wall = np.diff(tracked.T_pc[:, 2, 3])[found]
    apart = []
    for time_s in (stamps, even):
        read = np.interp(time_s[tracked.frames], recording.encoder.time_s, recording.encoder.distance_mm)
        step = np.diff(read)[found]
        apart.append(spread_about_median(by_wall - step * float(by_wall @ step) / float(step @ step + 1e-12)))
    if apart[1] > _BETTER * apart[0]:
        return stamps
    context.warn(
        f"the times in frames.csv scatter by {1e3 * root_mean_square(stamps - even):.1f} ms (1 σ) about "
        "equal intervals. Encoder and pictures agree better with equal intervals, which are used instead. "
        "What to do: let the camera stamp its pictures, not the computer that receives them"
    )
    return even


def even_rhythm(stamps: Float) -> Float | None:
    """Return times (N,) of equal intervals around which stamps (N,) scatter; None if there are none."""
    if len(stamps) < _FEWEST:
        return None
    k = np.arange(len(stamps))
    even = np.polyval(np.polyfit(k, stamps, 1), k)
    off, period = stamps - even, float(even[1] - even[0])
    if np.abs(off).max() > _FARTHEST * period or root_mean_square(off) < _SCATTER * period:
        return None
    return np.asarray(even, float)
