"""The joint adjustment slid over a long run window by window; a short run is one window."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Float
from stages.motion.bundle_adjustment.unknowns import GLOBALS, State
from stages.motion.parameters import MotionParameters
from stages.motion.windows.measured_run import MeasuredRun, Window, cut_windows
from stages.motion.windows.submap_joining import Joined, join, seam
from stages.motion.windows.submaps import (
    Estimate,
    Say,
    Settled,
    Submap,
    again,
    estimated,
    say_of,
    settle,
    shared_numbers,
    submap_of,
)


@dataclass(frozen=True)
class RunEstimate:
    """A whole run at its optimum, and how the adjustments of its windows ended.

    Attributes
    ----------
    joined : Joined
    trials : int
        Steps tried in all windows together.
    unsettled : int
        Windows in which a step could still gain something.
    reprojection_px : float
        Median over the windows of the median reprojection error.
    """

    joined: Joined
    trials: int
    unsettled: int
    reprojection_px: float


@dataclass(frozen=True)
class _Alone:
    """A window adjusted on its own."""

    state: State
    smooth_sigma: Float
    say: Say


def adjust_run(
    run: MeasuredRun,
    parameters: MotionParameters,
    check: Callable[[Estimate], None],
    progress: Callable[[int, int], None],
) -> RunEstimate:
    """Return the estimate of a whole run; ``check`` is shown every window's and may refuse it.

    Raises
    ------
    UnusableError
        When the motion is not determined in some window.
    """
    windows = cut_windows(len(run.time_s), parameters.window_frames, parameters.overlap_frames)
    if len(windows) == 1:
        measured = run.measured(windows[0], parameters)
        estimate = estimated(run.start(windows[0], measured, parameters), measured, parameters)
        check(estimate)
        return _run_estimate(of_one_window(estimate), [_End.of(estimate)])
    alone: list[_Alone] = []
    for window in windows:
        alone.append(_adjusted_alone(run, window, parameters, check))
        progress(len(alone), 2 * len(windows))
    measured = run.measured(windows[-1], parameters)
    settled = settle([a.say for a in alone], _shares(windows), measured, alone[-1].state)
    submaps: list[Submap] = []
    ends: list[_End] = []
    for k, own in enumerate(alone):
        measured = run.measured(windows[k], parameters)
        estimate = again(own.state, measured, settled, own.smooth_sigma, parameters)
        check(estimate)
        ends.append(_End.of(estimate))
        submaps.append(_submap(estimate, windows, k))
        progress(len(windows) + len(submaps), 2 * len(windows))
    return _run_estimate(join(submaps, settled), ends)


def of_one_window(estimate: Estimate) -> Joined:
    """Return an estimate of all frames at once as a run of one window."""
    state = estimate.state
    which = shared_numbers(state)
    value = np.append(state.globals[GLOBALS - 1], state.instrument)
    settled = Settled(value, estimate.factor.border_covariance()[np.ix_(which, which)])
    return join([_submap(estimate, [Window(0, len(state.T_pc))], 0)], settled)


@dataclass(frozen=True)
class _End:
    """How a window's adjustment ended."""

    trials: int
    settled: bool
    reprojection_px: float

    @staticmethod
    def of(estimate: Estimate) -> _End:
        adjusted = estimate.adjusted
        return _End(adjusted.trials, adjusted.settled, adjusted.equations.reprojection_px)


def _run_estimate(joined: Joined, ends: Sequence[_End]) -> RunEstimate:
    error = float(np.median([e.reprojection_px for e in ends]))
    return RunEstimate(joined, sum(e.trials for e in ends), sum(not e.settled for e in ends), error)


def _adjusted_alone(
    run: MeasuredRun, window: Window, parameters: MotionParameters, check: Callable[[Estimate], None]
) -> _Alone:
    measured = run.measured(window, parameters)
    estimate = estimated(run.start(window, measured, parameters), measured, parameters)
    check(estimate)
    return _Alone(estimate.state, estimate.smooth_sigma, say_of(estimate, measured))


def _submap(estimate: Estimate, windows: Sequence[Window], number: int) -> Submap:
    """Return a window as others need it; its errors count from the seam with the one before to the next."""
    window = windows[number]
    first = seam(windows[number - 1], window) - window.first if number else 0
    is_last = number + 1 == len(windows)
    last = window.frames - 1 if is_last else seam(window, windows[number + 1]) - window.first
    return submap_of(estimate, window, first, last, len(windows))


def _shares(windows: Sequence[Window]) -> list[float]:
    """Return the part of each window that the one before it had not seen."""
    ends = [windows[0].first, *(w.last for w in windows)]
    return [(w.last - max(w.first, before)) / w.frames for w, before in zip(windows, ends, strict=False)]
