"""Decides whether texture farther along than any ring lies on wall of the rings' radius."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.adjustment.levenberg_marquardt import Watch
from pipeline.geometry.axis import to_pipe
from stages.motion.bore import Bore
from stages.motion.bundle_adjustment.equations import Measurements
from stages.motion.bundle_adjustment.solver import ROUGHLY, Estimate, estimate_again, estimate_state
from stages.motion.bundle_adjustment.unknowns import State
from stages.motion.parameters import MotionParameters


def known_everywhere(bore: Bore) -> Bore:
    """Return the bore with the width of its first and last ring also before and beyond these."""
    return replace(bore, measured_mm=(-np.inf, np.inf))


def is_known_everywhere(bore: Bore) -> bool:
    """Return whether the bore's width is known before and beyond the rings, too."""
    return bool(np.isinf(bore.measured_mm).all())


def estimate_with_wall_beyond(
    start: State, measured: Measurements, parameters: MotionParameters, watch: Watch
) -> Estimate:
    """Adjust with texture beyond the rings held to their radius, unless it shows a step of the bore.

    An adjustment in which it is free tells which, and need not be exact for that.

    Raises
    ------
    UnusableError
        When rings and texture do not determine the motion.
    """
    free = estimate_state(start, measured, parameters, watch, ROUGHLY)
    held = held_beyond_rings(free, measured, parameters, watch)
    return estimate_again(free, measured, parameters, watch) if held is free else held


def held_beyond_rings(
    free: Estimate, measured: Measurements, parameters: MotionParameters, watch: Watch
) -> Estimate:
    """Adjust again with texture beyond the rings held to their radius, unless it shows a step of the bore.

    Free, its radius follows from parallax alone, whose errors moved the sheet of open-3 by 14 σ.

    Parameters
    ----------
    free : Estimate
        With texture beyond the rings at any radius. It is returned itself if it shows a step there.

    Raises
    ------
    UnusableError
        When rings and texture do not determine the motion.
    """
    state = free.state
    at_mm, _, _ = to_pipe(state.axis, state.xyz_p)
    if state.bore.steps_beyond(at_mm, free.adjusted.equations.texture.surface_residual):
        return free
    held = replace(state, bore=known_everywhere(state.bore))
    before = replace(free, adjusted=replace(free.adjusted, state=held))
    return estimate_again(before, measured, parameters, watch)
