"""The bundle adjustment of motion, landmarks and pipe, by Levenberg-Marquardt with robust losses.

D. Marquardt, "An algorithm for least-squares estimation of nonlinear parameters", 1963; the control of the
damping after H. Nielsen, "Damping parameter in Marquardt's method", IMM-REP-1999-05.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from pipeline.adjustment.bordered import Factor, Step
from pipeline.adjustment.robust import robust_spreads
from pipeline.arrays import Float, Int
from pipeline.errors import UnusableError
from pipeline.geometry.rigid import vector_from_rotation
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
_LEAST_DAMPING, _FIRST_DAMPING, _MOST_DAMPING = 1e-12, 1e-7, 1e6
"""Relative damping: without effect but for rounding; of the first step that is damped at all; where steps are
so short that none can help."""
_GROWTH = 8.0
"""Factor of the damping after the first failure; Nielsen has 2, but starts at far larger damping. Not
measured."""
_STRONGEST_FALL = 0.01
"""Factor of the damping after a step that gained all it promised; Nielsen has 1/3. Not measured."""
_FIRST_SCALES = Scales(3.0, 1.0)
"""Scales before there are residuals: wide, so that a poor start is not taken for outliers."""
_SMOOTHEST = np.array([1e-4] * 3 + [1e-6] * 3)
"""Smallest 1 σ, mm and rad, of third differences that is believed: that of the origin."""
_FEWEST_FRAMES = 8
"""Lit frames below which the smoothness of the motion is not estimated."""


@dataclass(frozen=True)
class Adjusted:
    """Where the adjustment ended.

    Attributes
    ----------
    state : State
    equations : Equations
        There.
    trials : int
        Steps tried.
    settled : bool
        Whether no step promises anything any more.
    """

    state: State
    equations: Equations
    trials: int
    settled: bool


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


def estimate_state(start: State, measured: Measurements, parameters: MotionParameters) -> Estimate:
    """Adjust with loose motion first, estimate from it how smooth the motion is, then adjust again.

    Raises
    ------
    UnusableError
        When the motion is not determined.
    """
    with _refusing_undetermined():
        loose = adjust(start, measured, parameters, ROUGHLY).state
        sigma = third_difference_sigma(loose, measured.tracks.poses.frames)
        smooth = adjust(loose, replace(measured, smooth_sigma=sigma), parameters, CLOSELY)
        return Estimate(smooth, smooth.equations.factor(), sigma)


def estimate_with_shared(
    state: State, measured: Measurements, shared: Float, smooth_sigma: Float, parameters: MotionParameters
) -> Estimate:
    """Adjust from a window's own optimum with the shared parameters (S,) held.

    Raises
    ------
    UnusableError
        When the motion is not determined.
    """
    held = replace(measured, smooth_sigma=smooth_sigma, shared=shared)
    with _refusing_undetermined():
        found = adjust(state.with_shared(shared), held, parameters, CLOSELY)
        return Estimate(found, found.equations.factor(), smooth_sigma)


def adjust(state: State, measured: Measurements, parameters: MotionParameters, enough: float) -> Adjusted:
    """Minimise the robust cost of all residuals, until a step promises less than the share ``enough`` of it.

    A step is judged by the scales it was computed with and counts only if it lowers the cost; then the scales
    of the residuals are estimated anew.

    Raises
    ------
    numpy.linalg.LinAlgError
        When the motion is not determined.
    """
    equations, scales = _with_new_scales(
        linearised(state, measured, parameters, _FIRST_SCALES), measured, parameters
    )
    damping = Damping()
    for trial in range(1, parameters.iterations + 1):
        step = _step(equations, damping)
        if step is None:
            damping = damping.after(0.0)
            continue
        cost, promised = equations.cost, equations.decrease(step)
        moved = state.step(step.frames, step.border, step.landmarks)
        del equations  # two sets of equations would be the largest memory that the stage needs
        equations = linearised(moved, measured, parameters, scales)
        gain = (cost - equations.cost) / promised
        if gain > 0:
            state = moved
            equations, scales = _with_new_scales(equations, measured, parameters)
        else:
            equations = linearised(state, measured, parameters, scales)
        if damping.is_exhausted or promised < damping.least_promise(gain, enough * cost):
            return Adjusted(state, equations, trial, True)
        damping = damping.after(gain)
    return Adjusted(state, equations, parameters.iterations, False)


@dataclass(frozen=True)
class Damping:
    """Relative damping of the steps, and how much it grows when the next one fails."""

    value: float = _LEAST_DAMPING
    growth: float = _GROWTH

    @property
    def is_slight(self) -> bool:
        """Whether steps are those of Gauss-Newton, in weakly determined directions too."""
        return self.value <= _FIRST_DAMPING

    @property
    def is_exhausted(self) -> bool:
        """Whether even the shortest steps failed."""
        return self.value > _MOST_DAMPING

    def least_promise(self, gain: float, enough: float) -> float:
        """Return the promised decrease below which a step that gained this share of it is the last."""
        if gain <= 0:
            return _ONE_SIGMA
        return enough if self.is_slight else 0.0

    def after(self, gain: float) -> Damping:
        """Return the damping after a step that gained this share of what it promised."""
        if gain <= 0:
            return Damping(max(self.value, _FIRST_DAMPING) * self.growth, 2 * self.growth)
        factor = max(_STRONGEST_FALL, 1 - (2 * min(gain, 1) - 1) ** 3)
        return Damping(max(self.value * factor, _LEAST_DAMPING))


def third_difference_sigma(state: State, lit: Int) -> Float:
    """Return the robust size (6,) of the pose's third differences, scaled from lit frames to all frames.

    They are divided by the square of the usual step s from one lit frame to the next. Motion driven by white
    jerk would ask for s^2.5, as the gauge calibration has it; why s² is used here is not known.
    """
    if len(lit) < _FEWEST_FRAMES:
        return 100 * _SMOOTHEST
    window = np.arange(len(lit) - 3)[:, None] + np.arange(4)
    T = state.T_pc[lit[window]]
    turn = vector_from_rotation(np.swapaxes(T[:, 1:2, :3, :3], -1, -2) @ T[..., :3, :3])
    pose = np.concatenate([T[..., :3, 3], turn], -1)
    third = np.einsum("k,nki->ni", np.array([-1.0, 3, -3, 1]), pose)
    stride = float(np.median(np.diff(lit)))
    return np.asarray(np.maximum(robust_spreads(third, axis=0) / stride**2, _SMOOTHEST))


def _step(equations: Equations, damping: Damping) -> Step | None:
    """Return the damped step, or None where rounding spoils the equations and damping may yet help."""
    try:
        return equations.step(damping.value)
    except np.linalg.LinAlgError:
        if damping.is_exhausted:
            raise
        return None


def _with_new_scales(
    equations: Equations, measured: Measurements, parameters: MotionParameters
) -> tuple[Equations, Scales]:
    scales = scales_of(equations, measured.tracks, parameters.alike)
    return rescaled(equations, measured.tracks, scales), scales


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
