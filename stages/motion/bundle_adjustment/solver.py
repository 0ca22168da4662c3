"""The joint robust estimate of motion, landmarks and pipe, by Levenberg-Marquardt.

D. Marquardt, "An algorithm for least-squares estimation of nonlinear parameters", 1963; the control of the
damping after H. Nielsen, "Damping parameter in Marquardt's method", IMM-REP-1999-05.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.adjustment.bordered import Step
from pipeline.adjustment.robust import robust_spreads
from pipeline.arrays import Float, Int
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

_DOUBTFUL = 0.5  # one σ of any combination of unknowns; derivatives leave out what may be as much
_LEAST_DAMPING, _FIRST_DAMPING, _MOST_DAMPING = 1e-12, 1e-7, 1e6
_FIRST = Scales(3.0, 1.0)


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
class Damping:
    """Relative damping of the steps, and how much it grows when the next one fails."""

    value: float = _LEAST_DAMPING
    growth: float = 8.0

    @property
    def slight(self) -> bool:
        """Whether steps are those of Gauss-Newton, in weakly held directions too."""
        return self.value <= _FIRST_DAMPING

    @property
    def spent(self) -> bool:
        """Whether even the shortest steps failed."""
        return self.value > _MOST_DAMPING

    def believed(self, gain: float, enough: float) -> float:
        """Return the promise below which a step that gained this share of it is the last."""
        if gain <= 0:
            return _DOUBTFUL
        return enough if self.slight else 0.0

    def after(self, gain: float) -> Damping:
        """Return the damping after a step that gained this share of what it promised."""
        if gain <= 0:
            return Damping(max(self.value, _FIRST_DAMPING) * self.growth, 2 * self.growth)
        return Damping(max(self.value * max(0.01, 1 - (2 * min(gain, 1) - 1) ** 3), _LEAST_DAMPING))


def adjust(state: State, measured: Measurements, parameters: MotionParameters, enough: float) -> Adjusted:
    """Minimise the robust cost of all residuals together, until a step promises less than this share of it.

    A step is judged by the scales it was computed with and counts only if it lowers the cost; then the
    residuals' scales are measured anew.

    Raises
    ------
    numpy.linalg.LinAlgError
        When the motion is not determined.
    """
    equations, scales = _judged_anew(linearised(state, measured, parameters, _FIRST), measured, parameters)
    damping = Damping()
    for trial in range(1, parameters.iterations + 1):
        step = _step(equations, damping)
        if step is None:
            damping = damping.after(0.0)
            continue
        cost, promised = equations.cost, equations.decrease(step)
        moved = state.step(step.frames, step.border, step.landmarks)
        del equations  # two sets of them would be the most that the stage holds
        equations = linearised(moved, measured, parameters, scales)
        gain = (cost - equations.cost) / promised
        if gain > 0:
            state = moved
            equations, scales = _judged_anew(equations, measured, parameters)
        else:
            equations = linearised(state, measured, parameters, scales)
        if damping.spent or promised < damping.believed(gain, enough * cost):
            return Adjusted(state, equations, trial, True)
        damping = damping.after(gain)
    return Adjusted(state, equations, parameters.iterations, False)


def _step(equations: Equations, damping: Damping) -> Step | None:
    """Return the damped step, or None where rounding spoils the equations and damping may yet help."""
    try:
        return equations.step(damping.value)
    except np.linalg.LinAlgError:
        if damping.spent:
            raise
        return None


def _judged_anew(
    equations: Equations, measured: Measurements, parameters: MotionParameters
) -> tuple[Equations, Scales]:
    scales = scales_of(equations, measured.tracks, parameters.alike)
    return rescaled(equations, measured.tracks, scales), scales


def third_difference_sigma(state: State, lit: Int) -> Float:
    """Return the robust size (6,) of the pose's third differences, scaled from lit frames to all frames."""
    floor = np.array([1e-4] * 3 + [1e-6] * 3)
    if len(lit) < 8:
        return 100 * floor
    window = np.arange(len(lit) - 3)[:, None] + np.arange(4)
    T = state.T_pc[lit[window]]
    turn = vector_from_rotation(np.swapaxes(T[:, 1:2, :3, :3], -1, -2) @ T[..., :3, :3])
    pose = np.concatenate([T[..., :3, 3], turn], -1)
    third = np.einsum("k,nki->ni", np.array([-1.0, 3, -3, 1]), pose)
    stride = float(np.median(np.diff(lit)))
    return np.asarray(np.maximum(robust_spreads(third, axis=0) / stride**2, floor))
