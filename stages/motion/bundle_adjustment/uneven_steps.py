"""Finds from the encoder how unevenly the probe moves between the lit pictures.

The smoothness of the motion is estimated from the lit pictures. A crawler that takes two pictures, moves on,
and takes two again has smooth lit pictures, and yet its laser pictures do not lie half-way between them. Only
the encoder shows that.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from pipeline.adjustment.motion_priors import TREMBLING_GROWTH, third_difference_coefficients
from pipeline.adjustment.robust import robust_spread
from pipeline.arrays import Bool, Float
from stages.motion.encoder import EncoderReadings
from stages.motion.tracking.landmarks import TrackedPoses

_FEWEST = 8
"""Lit pictures whose texture must show the noise of the readings, as many as show the motion's smoothness."""
_BEYOND_NOISE = 3.0
"""Ratio to the third differences of noise alone from which the motion is uneven. Chosen: with eight lit
pictures the spread of noise comes out three times too small once in 25 times, with twenty hardly ever."""
_ALONG = 2


def uneven_steps(encoder: EncoderReadings | None, poses: TrackedPoses, time_s: Float) -> Float:
    """Return the 1 σ (6,) of third differences that readings (N,) show beyond their noise; 0 without any.

    The noise of the readings is that of their difference from texture in the lit pictures: where the readings
    or the times of the frames are noisy, the motion is not uneven. Only the coordinate along the pipe of
    frame P differs from 0.
    """
    uneven, lit = np.zeros(6), poses.known
    if encoder is None or len(lit) < _FEWEST:
        return uneven
    steps = _third_differences(encoder.distance_mm, time_s, encoder.known)
    at_lit = encoder.distance_mm[lit] - poses.T_pc[np.isin(poses.frames, lit), _ALONG, 3]
    noise = _third_differences(at_lit, time_s[lit], encoder.known[lit])
    if not len(noise):
        return uneven
    by_noise = max(robust_spread(noise), TREMBLING_GROWTH * encoder.sigma_mm)
    if robust_spread(steps) > _BEYOND_NOISE * by_noise:
        uneven[_ALONG] = robust_spread(steps)
    return uneven


def _third_differences(distance_mm: Float, time_s: Float, known: Bool) -> Float:
    """Return the third differences (M,) of distances (N,) at all four successive frames that are known."""
    if len(time_s) < 4:
        return np.zeros(0)
    whole = sliding_window_view(known, 4).all(1)
    coefficient = third_difference_coefficients(sliding_window_view(time_s, 4)[whole])
    return np.asarray(np.sum(coefficient * sliding_window_view(distance_mm, 4)[whole], axis=1))
