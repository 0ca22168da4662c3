"""Estimates the size of a knock of the laser in mid-run, and corrects the rings after the knock."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.adjustment.levenberg_marquardt import Watch
from pipeline.arrays import Bool, Float
from pipeline.artefacts.motion import LaserKnock
from stages.motion.bundle_adjustment.equations import Measurements, Scales, linearised, scales_of
from stages.motion.bundle_adjustment.extra_columns import ExtraColumns
from stages.motion.bundle_adjustment.laser_knock import (
    LASER_AND_JOINT,
    KnockTest,
    RingJump,
    by_laser_and_joint,
)
from stages.motion.bundle_adjustment.solver import Estimate, estimate_state
from stages.motion.parameters import MotionParameters
from stages.motion.windows.measured_run import MeasuredRun
from stages.motion.windows.submaps import Window

_ROUNDS = 2
"""Number of times that the size of a cause is estimated, each time after correction by the size found before.
With 0.8° of tilt, a third time would change it by a fifth of its σ."""
_STEPS = 20
"""Most steps of an adjustment: a right cause takes 5 to 10 (open-1-field, its line moved), a wrong one may
never converge, and is rejected in any case."""


@dataclass(frozen=True)
class _Place:
    """The place of a jump of the rings in a window of a run.

    ``behind`` is the first frame after the jump, counted from the run's first.
    """

    run: MeasuredRun
    jump: RingJump
    window: Window
    behind: int

    def corrected(self, size: Float) -> MeasuredRun:
        """Return the run corrected for sizes (6,) of knock and joint (`LASER_AND_JOINT`)."""
        run = self.run.knocked(LaserKnock(self.jump.frame, size[LASER_AND_JOINT], np.zeros((3, 3))))
        x, y, wider = size[~LASER_AND_JOINT]
        return replace(run, bore=run.bore.with_joint(self.jump.at_mm, (x, y), wider))

    def columns(self, estimate: Estimate, measured: Measurements) -> ExtraColumns:
        """Return the derivatives of the residuals by these sizes."""
        first, at_mm = self.behind - self.window.first, self.jump.at_mm - self.run.start_mm(self.window)
        return by_laser_and_joint(estimate, measured, first, at_mm)

    @property
    def guesses(self) -> tuple[Float, Float]:
        """Return the sizes (6,) with which a knock alone, or a joint alone, explains the jump."""
        aside_mm = self.run.T_pc[self.behind, :2, :2] @ self.jump.jump_mm[:2]
        knock = np.concatenate([self.jump.guess.change, np.zeros(3)])
        return knock, np.array([0.0, 0, 0, *aside_mm, self.jump.jump_mm[2]])


@dataclass(frozen=True)
class _Fitted:
    """Sizes (6,), of which the ``free`` ones were estimated, their covariance, and the estimate."""

    free: Bool
    size: Float
    covariance: Float
    estimate: Estimate
    measured: Measurements


def with_steady_laser(
    run: MeasuredRun, parameters: MotionParameters, watch: Watch
) -> tuple[MeasuredRun, KnockTest | None]:
    """Return the run with the change of its laser, and the test for a knock; None if no rings jump.

    Three causes of the rings' jump are adjusted and compared by their marginal likelihoods: a knock, a joint
    of the pipe, and neither. Both at once are not tried: at a weld (open-2) their freedom would fit best.

    Raises
    ------
    UnusableError
        When the motion is not determined.
    """
    if run.jump is None:
        return run, None
    behind = int(run.ring_place[np.searchsorted(run.rings.frame, run.jump.frame)])
    place = _Place(run, run.jump, _around(behind, run.whole, parameters.window_frames), behind)
    parameters = parameters.model_copy(update={"iterations": min(_STEPS, parameters.iterations)})
    by_knock, by_joint = place.guesses
    causes = (LASER_AND_JOINT, by_knock), (~LASER_AND_JOINT, by_joint), (np.zeros(6, bool), 0 * by_knock)
    fitted = [_fitted(place, free, guess, parameters, watch) for free, guess in causes]
    knocked, *others = _likelihoods(fitted, run.jump, parameters)
    knock = LaserKnock(run.jump.frame, fitted[0].size[LASER_AND_JOINT], fitted[0].covariance)
    test = KnockTest(knock, knocked - max(others), run.jump, float(run.time_s[behind]))
    return (run.knocked(knock) if test.certain else run), test


def _fitted(place: _Place, free: Bool, size: Float, parameters: MotionParameters, watch: Watch) -> _Fitted:
    """Return the free sizes (6,), adjusted in rounds."""
    covariance, state = np.zeros((0, 0)), None
    for _ in range(_ROUNDS if free.any() else 1):
        run = place.corrected(size)
        measured = run.measured(place.window, parameters)
        first = run.start(place.window, measured, parameters)
        start = first if state is None else replace(state, bore=first.bore)
        estimate = estimate_state(start, measured, parameters, watch)
        if free.any():
            step, covariance = place.columns(estimate, measured).some(free).solved(estimate)
            size = size.copy()
            size[free] += step
        state = estimate.state
    return _Fitted(free, size, covariance, estimate, measured)


def _likelihoods(fitted: list[_Fitted], jump: RingJump, parameters: MotionParameters) -> list[float]:
    """Return the causes' log marginal likelihoods, with the smallest scales of residuals among them."""
    scales = [scales_of(f.estimate.adjusted.equations, f.measured.tracks, parameters.alike) for f in fitted]
    same = Scales(min(s.texture for s in scales), min(s.wall_mm for s in scales))
    smooth = np.min([f.estimate.smooth_sigma for f in fitted], axis=0)
    alike = [replace(f.measured, smooth_sigma=smooth) for f in fitted]
    return [
        jump.likelihood_of_size(f.size, f.covariance, f.free)
        - linearised(f.estimate.state, measured, parameters, same).cost
        for f, measured in zip(fitted, alike, strict=True)
    ]


def _around(frame: int, whole: Window, frames: int) -> Window:
    """Return a window of at most ``frames`` frames with a frame in its middle."""
    first = min(max(frame - frames // 2, 0), max(whole.last - frames, 0))
    return Window(first, min(first + frames, whole.last))
