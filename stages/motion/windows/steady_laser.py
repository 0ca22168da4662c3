"""A run whose laser was knocked: what it did is estimated, and taken out of the rings behind it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pipeline.adjustment.levenberg_marquardt import Watch
from pipeline.arrays import Float
from pipeline.artefacts.measured import LaserKnock
from stages.motion.bundle_adjustment.equations import Measurements, Scales, linearised, scales_of
from stages.motion.bundle_adjustment.extra_columns import ExtraColumns
from stages.motion.bundle_adjustment.laser_knock import KnockTest, RingJump, by_joint, by_laser
from stages.motion.bundle_adjustment.solver import Estimate, estimate_state
from stages.motion.parameters import MotionParameters
from stages.motion.windows.measured_run import MeasuredRun
from stages.motion.windows.submaps import Window

_ROUNDS = 2
"""Times that a cause's size is estimated, each with what was found before taken out: of 0.8° of tilt a third
would change a fifth of its σ."""
_STEPS = 20
"""Most steps of an adjustment: a right cause takes 5 to 10 (open-1-field, its line moved), a wrong one may
never settle, and is refused all the same."""


@dataclass(frozen=True)
class _Cause:
    """What may make rings jump: its size (3,) at first, a run without it, and what it changes."""

    size: Float
    taken_out: Callable[[Float], MeasuredRun]
    columns: Callable[[Estimate, Measurements], ExtraColumns] | None = None


@dataclass(frozen=True)
class _Fitted:
    """A cause's size (3,), its covariance, and the estimate with it."""

    size: Float
    covariance: Float
    estimate: Estimate
    measured: Measurements


def with_steady_laser(
    run: MeasuredRun, parameters: MotionParameters, watch: Watch
) -> tuple[MeasuredRun, KnockTest | None]:
    """Return the run with what a knock did to the laser, if it was knocked; None where no rings jump.

    A knock, a joint of the pipe and nothing at all are each adjusted with the rings' jump and compared.

    Raises
    ------
    UnusableError
        When the motion is not determined.
    """
    if run.jump is None:
        return run, None
    behind = int(run.ring_place[np.searchsorted(run.rings.frame, run.jump.frame)])
    window = _around(behind, run.whole, parameters.window_frames)
    parameters = parameters.model_copy(update={"iterations": min(_STEPS, parameters.iterations)})
    fitted = [_fitted(c, window, parameters, watch) for c in _causes(run, run.jump, window, behind)]
    knocked, joint, neither = _costs(fitted, parameters)
    knock = LaserKnock(run.jump.frame, fitted[0].size, fitted[0].covariance)
    time_s = float(run.time_s[behind])
    test = KnockTest(knock, joint - knocked, neither - knocked, run.jump, time_s)
    return (run.knocked(knock) if test.told else run), test


def _causes(run: MeasuredRun, jump: RingJump, window: Window, behind: int) -> tuple[_Cause, _Cause, _Cause]:
    """Return a knock, a joint, and neither."""
    sure, at_mm = np.zeros((3, 3)), jump.at_mm - run.start_mm(window)
    aside_mm = run.T_pc[behind, :2, :2] @ jump.jump_mm[:2]

    def joint(size: Float) -> MeasuredRun:
        return replace(run, bore=jump.bore.with_joint(jump.at_mm, (size[0], size[1]), size[2]))

    return (
        _Cause(
            jump.guess.change,
            lambda size: run.knocked(LaserKnock(jump.frame, size, sure)),
            lambda estimate, measured: by_laser(estimate, measured, behind - window.first),
        ),
        _Cause(
            np.append(aside_mm, jump.jump_mm[2]),
            joint,
            lambda estimate, measured: by_joint(estimate, measured, at_mm),
        ),
        _Cause(np.zeros(3), lambda size: replace(run, bore=jump.bore)),
    )


def _fitted(cause: _Cause, window: Window, parameters: MotionParameters, watch: Watch) -> _Fitted:
    """Return a cause adjusted, in rounds if it has a size."""
    size, covariance, state = cause.size, np.zeros((3, 3)), None
    for _ in range(_ROUNDS if cause.columns else 1):
        run = cause.taken_out(size)
        measured = run.measured(window, parameters)
        first = run.start(window, measured, parameters)
        start = first if state is None else replace(state, bore=first.bore)
        estimate = estimate_state(start, measured, parameters, watch)
        if cause.columns:
            step, covariance = cause.columns(estimate, measured).solved(estimate)
            size = size + step
        state = estimate.state
    return _Fitted(size, covariance, estimate, measured)


def _costs(fitted: list[_Fitted], parameters: MotionParameters) -> list[float]:
    """Return the robust costs of causes, all by the smallest scales that one of them shows."""
    scales = [scales_of(f.estimate.adjusted.equations, f.measured.tracks, parameters.alike) for f in fitted]
    same = Scales(min(s.texture for s in scales), min(s.wall_mm for s in scales))
    smooth = np.min([f.estimate.smooth_sigma for f in fitted], axis=0)
    alike = [replace(f.measured, smooth_sigma=smooth) for f in fitted]
    return [
        linearised(f.estimate.state, measured, parameters, same).cost
        for f, measured in zip(fitted, alike, strict=True)
    ]


def _around(frame: int, whole: Window, frames: int) -> Window:
    """Return a window of so many frames, fewer in a short run, with a frame in its middle."""
    first = min(max(frame - frames // 2, 0), max(whole.last - frames, 0))
    return Window(first, min(first + frames, whole.last))
