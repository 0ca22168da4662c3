"""The bundle adjustment of motion, landmarks and pipe: `pipeline.adjustment.levenberg_marquardt`."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from pipeline.adjustment.bordered import Factor, Step
from pipeline.adjustment.levenberg_marquardt import Minimum, Stop, Watch, minimise, unwatched
from pipeline.adjustment.motion_priors import third_difference_sigma
from pipeline.arrays import Float
from pipeline.errors import UnusableError
from stages.motion.bundle_adjustment.equations import (
    Equations,
    Measurements,
    Scales,
    linearised,
    rescaled,
    scales_of,
)
from stages.motion.bundle_adjustment.unknowns import State
from stages.motion.parameters import MotionParameters

ROUGHLY, CLOSELY = 1e-2, 1e-5
"""Share of the cost that a step must promise, else the adjustment ends: at 1e-5, about a hundredth of the
cost of 1 σ on a window of some thousand equations. Before the motion's smoothness is known, 1e-2 suffices."""
_ONE_SIGMA = 0.5
"""Cost of 1 σ of any combination of unknowns. The derivatives leave out the turn of the axis' frames, so that
a step that promises less and yet fails may be due to that: it is the last."""
_FIRST_SCALES = Scales(3.0, 1.0)
"""Scales before there are residuals: wide, so that a poor start is not taken for outliers."""

Adjusted = Minimum[State, Equations]


@dataclass(frozen=True)
class Estimate:
    """The adjustment's end, the factorised equations there, and how smooth the motion was found (6,)."""

    adjusted: Adjusted
    factor: Factor
    smooth_sigma: Float

    @property
    def state(self) -> State:
        """Return the state at the optimum."""
        return self.adjusted.state


def estimate_state(
    start: State, measured: Measurements, parameters: MotionParameters, watch: Watch = unwatched
) -> Estimate:
    """Adjust with loose motion first, estimate from it how smooth the motion is, then adjust again.

    ``watch`` is called before every step.

    Raises
    ------
    UnusableError
        When the motion is not determined.
    """
    with _refusing_undetermined():
        loose = adjust(start, measured, parameters, ROUGHLY, watch).state
        sigma = third_difference_sigma(loose.T_pc, measured.tracks.poses.frames)
        smooth = adjust(loose, replace(measured, smooth_sigma=sigma), parameters, CLOSELY, watch)
        return Estimate(smooth, smooth.equations.factor(), sigma)


def estimate_with_shared(
    state: State,
    measured: Measurements,
    shared: Float,
    smooth_sigma: Float,
    parameters: MotionParameters,
    watch: Watch = unwatched,
) -> Estimate:
    """Adjust from a window's own optimum with the shared parameters (S,) held.

    ``watch`` is called before every step.

    Raises
    ------
    UnusableError
        When the motion is not determined.
    """
    held = replace(measured, smooth_sigma=smooth_sigma, shared=shared)
    with _refusing_undetermined():
        found = adjust(state.with_shared(shared), held, parameters, CLOSELY, watch)
        return Estimate(found, found.equations.factor(), smooth_sigma)


def adjust(
    state: State,
    measured: Measurements,
    parameters: MotionParameters,
    enough: float,
    watch: Watch = unwatched,
) -> Adjusted:
    """Minimise the robust cost of all residuals, until a step promises less than the share ``enough`` of it.

    Raises
    ------
    numpy.linalg.LinAlgError
        When the motion is not determined.
    """

    def equations_at(there: State, scales: Scales | None) -> Equations:
        return linearised(there, measured, parameters, scales or _FIRST_SCALES)

    def moved(there: State, step: Step) -> State:
        return there.step(step.frames, step.border, step.landmarks)

    def with_new_scales(equations: Equations) -> tuple[Equations, Scales | None]:
        scales = scales_of(equations, measured.tracks, parameters.alike)
        return rescaled(equations, measured.tracks, scales), scales

    stop = Stop(parameters.iterations, enough, _ONE_SIGMA)
    return minimise(state, equations_at, moved, with_new_scales, stop, watch)


@contextmanager
def _refusing_undetermined() -> Iterator[None]:
    """Turn equations that cannot be solved into an error that says what to do."""
    try:
        # More threads gain nothing on blocks this small, and stall when the machine is busy.
        with threadpool_limits(1):
            yield
    except np.linalg.LinAlgError as error:
        raise UnusableError(
            "motion",
            f"the motion is not determined by this recording ({error})",
            hint="record more lit frames or rings, or give an encoder",
        ) from error
