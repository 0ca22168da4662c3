"""Robust least squares by Levenberg-Marquardt.

D. Marquardt, "An algorithm for least-squares estimation of nonlinear parameters", 1963; the control of the
damping after H. Nielsen, "Damping parameter in Marquardt's method", IMM-REP-1999-05.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

_LEAST_DAMPING, _FIRST_DAMPING, _MOST_DAMPING = 1e-12, 1e-7, 1e6
"""Relative damping: the smallest, which only guards against rounding; that of the first damped step; the
largest, with which steps are too short to help."""
_GROWTH = 8.0
"""Factor of the damping after the first failure; Nielsen has 2, but starts at far larger damping. Not
measured."""
_STRONGEST_FALL = 0.01
"""Factor of the damping after a step with the full predicted gain; Nielsen has 1/3. Not measured."""

Watch = Callable[[], object]
"""Called before every step of a solver: reports progress, and raises when the user wishes to stop."""

State = TypeVar("State")
Step = TypeVar("Step")
Scales = TypeVar("Scales")


def unwatched() -> None:
    """Let a solver run to its end."""


class Linear(Protocol[Step]):
    """Equations linearised at one state."""

    @property
    def cost(self) -> float:
        """The robust cost at the state."""

    def step(self, damping: float) -> Step:
        """Return the step to the minimum, the diagonal raised by a relative ``damping``."""

    def decrease(self, step: Step) -> float:
        """Return the decrease of the cost that the linear equations predict for a step."""


Equations = TypeVar("Equations", bound=Linear[Any])


@dataclass(frozen=True)
class Minimum(Generic[State, Equations]):
    """Result of the search.

    Attributes
    ----------
    state
    equations
        Equations linearised at that state.
    trials : int
        Number of steps tried.
    settled : bool
        Whether no further step was predicted to decrease the cost; False when ``Stop.trials`` ended the
        search.
    """

    state: State
    equations: Equations
    trials: int
    settled: bool


@dataclass(frozen=True)
class Damping:
    """Relative damping of the steps, and how much it grows when the next one fails."""

    value: float = _LEAST_DAMPING
    growth: float = _GROWTH

    @property
    def is_slight(self) -> bool:
        """Whether steps are those of Gauss-Newton, in weakly held directions too."""
        return self.value <= _FIRST_DAMPING

    @property
    def is_exhausted(self) -> bool:
        """Whether even the shortest steps failed."""
        return self.value > _MOST_DAMPING

    def after(self, gain: float) -> Damping:
        """Return the damping after a step with this ratio of actual to predicted gain."""
        if gain <= 0:
            return Damping(max(self.value, _FIRST_DAMPING) * self.growth, 2 * self.growth)
        factor = max(_STRONGEST_FALL, 1 - (2 * min(gain, 1) - 1) ** 3)
        return Damping(max(self.value * factor, _LEAST_DAMPING))


@dataclass(frozen=True)
class Stop:
    """Criteria for the end of the search.

    Attributes
    ----------
    trials : int
        Largest number of steps tried.
    enough : float
        The search ends when a step of slight damping is predicted to gain less than this share of the cost,
        even if it fails: shorter steps would gain less still.
    doubtful : float
        The search ends when a failed step had a predicted decrease below this, which may be an artefact of
        approximate derivatives.
    """

    trials: int
    enough: float
    doubtful: float = 0.0

    def reached(self, damping: Damping, gain: float, promised: float, cost: float) -> bool:
        """Return whether a step with this ratio of actual to ``promised`` gain is the last."""
        if damping.is_exhausted:
            return True
        doubtful = self.doubtful if gain <= 0 else 0.0
        return promised < max(doubtful, self.enough * cost * damping.is_slight)


def minimise(
    start: State,
    linearised: Callable[[State, Scales | None], Equations],
    moved: Callable[[State, Any], State],
    judged_anew: Callable[[Equations], tuple[Equations, Scales | None]],
    stop: Stop,
    watch: Watch = unwatched,
) -> Minimum[State, Equations]:
    """Minimise a robust cost.

    A step is evaluated with the scales with which it was computed, and is accepted only if it lowers the
    cost; then the residuals' scales are estimated again.

    Parameters
    ----------
    start
    linearised
        Returns the equations at a state, weighted by given scales; by None at the start.
    moved
        Returns the state after a step.
    judged_anew
        Returns equations weighted by the scales of their own residuals, and these scales.
    stop
    watch
        Called before every step.

    Raises
    ------
    numpy.linalg.LinAlgError
        When the unknowns are not determined.
    """
    state, damping = start, Damping()
    equations, scales = judged_anew(linearised(state, None))
    for trial in range(1, stop.trials + 1):
        watch()
        step = _step(equations, damping)
        if step is None:
            damping = damping.after(0.0)
            continue
        cost, promised = equations.cost, equations.decrease(step)
        candidate = moved(state, step)
        del equations  # two sets of them would be the peak of a stage's memory
        equations = linearised(candidate, scales)
        gain = (cost - equations.cost) / promised if promised > 0 else 0.0
        if gain > 0:
            state = candidate
            equations, scales = judged_anew(equations)
        else:
            equations = linearised(state, scales)
        if stop.reached(damping, gain, promised, cost):
            return Minimum(state, equations, trial, True)
        damping = damping.after(gain)
    return Minimum(state, equations, stop.trials, False)


def _step(equations: Linear[Any], damping: Damping) -> Any:
    """Return the damped step, or None if rounding spoils the equations and damping may still help."""
    try:
        return equations.step(damping.value)
    except np.linalg.LinAlgError:
        if damping.is_exhausted:
            raise
        return None
