"""Slides the bundle adjustment over a long run window by window; a short run is one window."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np

from pipeline.adjustment.levenberg_marquardt import Watch
from pipeline.arrays import Float
from stages.motion.bundle_adjustment.equations import Measurements
from stages.motion.bundle_adjustment.laser_knock import KnockTest
from stages.motion.bundle_adjustment.match_errors import excess_of, lasting_excess
from stages.motion.bundle_adjustment.shared_difference import WallTwice
from stages.motion.bundle_adjustment.solver import (
    Estimate,
    estimate_state,
    estimate_with_shared,
)
from stages.motion.bundle_adjustment.unknowns import State
from stages.motion.bundle_adjustment.wall_twice import wall_twice
from stages.motion.parameters import MotionParameters
from stages.motion.tracking.normalisation import correlated_samples
from stages.motion.tracking.strips import StripGrid
from stages.motion.windows.first_window import EncoderCheck, FirstWindow, adjust_first
from stages.motion.windows.measured_run import MeasuredRun
from stages.motion.windows.steady_scale import SteadyRun
from stages.motion.windows.submap_joining import JoinedRun, join_submaps
from stages.motion.windows.submaps import (
    SharedInformation,
    SharedParameters,
    Submap,
    Window,
    cut_windows,
    fuse_shared,
    handover,
    shared_information,
    submap_of,
)


@dataclass(frozen=True)
class RunEstimate:
    """A whole run at its optimum, with statistics of its windows' adjustments.

    Attributes
    ----------
    joined : JoinedRun
    trials : int
        Number of steps tried in all windows together.
    unsettled : int
        Number of windows in which a further step could still reduce the cost.
    reprojection_px : float
        Median over the windows of the median reprojection error.
    excess : float
        Median over the windows of that error over the σ predicted by matching; samples that are blurred
        together count as one.
    lasting : float
        The part of ``excess`` that matches of one landmark in neighbouring pictures have in common.
    encoder : EncoderCheck
        Comparison with rings and texture of the first window.
    steady : SteadyRun
        Course of the image scale in the first window.
    knock : KnockTest or None
        Test for a knock of the laser, if rings jump.
    wall_twice : WallTwice
        Comparison of the wall in texture with that in the rings.
    """

    joined: JoinedRun
    trials: int
    unsettled: int
    reprojection_px: float
    excess: float
    lasting: float
    encoder: EncoderCheck
    steady: SteadyRun
    knock: KnockTest | None
    wall_twice: WallTwice


@dataclass(frozen=True)
class _Alone:
    """The stored results of a window that was adjusted on its own."""

    state: State
    smooth_sigma: Float
    evidence: SharedInformation


@dataclass(frozen=True)
class _End:
    """Statistics of a window's adjustment."""

    trials: int
    settled: bool
    reprojection_px: float
    excess: float
    lasting: float
    wall_twice: WallTwice

    @staticmethod
    def of(estimate: Estimate, measured: Measurements, grid: StripGrid, parameters: MotionParameters) -> _End:
        adjusted = estimate.adjusted
        away_px = np.linalg.norm(measured.tracks.uv - measured.probe.camera.centre_px, axis=1)
        alike = correlated_samples(away_px * grid.step_mm / estimate.state.nominal_radius_mm)
        sigma_px = measured.tracks.sigma_px * np.sqrt(alike)
        in_sigma = adjusted.equations.texture.residual / sigma_px[:, None]
        errors = excess_of(in_sigma), lasting_excess(in_sigma, measured.tracks.landmark)
        twice = wall_twice(estimate, measured, parameters.patch_size * grid.step_mm, grid.length_mm)
        return _End(adjusted.trials, adjusted.settled, adjusted.equations.reprojection_px, *errors, twice)

    def in_run(self, windows: Sequence[Window], number: int) -> _End:
        """Return it as that of a window of the run, so that what two windows share counts once."""
        limits = [0, *(handover(a, b) for a, b in pairwise(windows)), windows[-1].last]
        twice = self.wall_twice.later(windows[number].first).between(*limits[number : number + 2])
        return replace(self, wall_twice=twice)


def adjust_run(
    run: MeasuredRun,
    parameters: MotionParameters,
    check: Callable[[Estimate], None],
    progress: Callable[[int, int], None],
) -> RunEstimate:
    """Return the estimate of a whole run; ``check`` is called with every window's estimate and may refuse it.

    Raises
    ------
    UnusableError
        When the motion is not determined in some window.
    """
    windows = cut_windows(len(run.time_s), parameters.window_frames, parameters.overlap_frames)
    steps = 2 * len(windows)
    watch = partial(progress, 0, steps)
    first = adjust_first(run, windows[0], parameters, watch)
    run, parameters, estimate, measured = first.run, first.parameters, first.estimate, first.measured
    check(estimate)
    if len(windows) == 1:
        joined = joined_at_once(estimate).with_scale_sigma(first.distance_sigma)
        return _run_estimate(joined, [_End.of(estimate, measured, run.texture.grid, parameters)], first)
    alone = [_alone(estimate, measured)]
    for window in windows[1:]:
        watch = partial(progress, len(alone), steps)
        estimate, measured = _adjusted(run, window, parameters, watch)
        check(estimate)
        alone.append(_alone(estimate, measured))
    measured = run.measured(windows[-1], parameters)
    shared = fuse_shared([a.evidence for a in alone], _new_shares(windows), measured, alone[-1].state)
    found: list[tuple[Submap, _End]] = []
    for k, own in enumerate(alone):
        measured = run.measured(windows[k], parameters)
        watch = partial(progress, len(windows) + k, steps)
        estimate = estimate_with_shared(
            own.state, measured, shared.value, own.smooth_sigma, parameters, watch
        )
        check(estimate)
        end = _End.of(estimate, measured, run.texture.grid, parameters)
        found.append((_submap(estimate, windows, k), end.in_run(windows, k)))
    joined = join_submaps([f[0] for f in found], shared).with_scale_sigma(first.distance_sigma)
    return _run_estimate(joined, [f[1] for f in found], first)


def joined_at_once(estimate: Estimate) -> JoinedRun:
    """Return an estimate of all frames at once as a run of one window."""
    state = estimate.state
    which = state.shared_columns
    shared = SharedParameters(state.shared, estimate.factor.border_covariance()[np.ix_(which, which)])
    return join_submaps([_submap(estimate, [Window(0, len(state.T_pc))], 0)], shared)


def _run_estimate(joined: JoinedRun, ends: Sequence[_End], first: FirstWindow) -> RunEstimate:
    names = ("reprojection_px", "excess", "lasting")
    error, excess, lasting = (float(np.median([getattr(end, name) for end in ends])) for name in names)
    trials, unsettled = sum(e.trials for e in ends), sum(not e.settled for e in ends)
    parts = first.encoder, first.steady, first.knock
    twice = WallTwice.joined([e.wall_twice for e in ends])
    return RunEstimate(joined, trials, unsettled, error, excess, lasting, *parts, twice)


def _adjusted(
    run: MeasuredRun, window: Window, parameters: MotionParameters, watch: Watch
) -> tuple[Estimate, Measurements]:
    measured = run.measured(window, parameters)
    return estimate_state(run.start(window, measured, parameters), measured, parameters, watch), measured


def _alone(estimate: Estimate, measured: Measurements) -> _Alone:
    return _Alone(estimate.state, estimate.smooth_sigma, shared_information(estimate, measured))


def _submap(estimate: Estimate, windows: Sequence[Window], number: int) -> Submap:
    """Return a window's submap, with its errors from the handover before it to the one after it."""
    window = windows[number]
    first = handover(windows[number - 1], window) - window.first if number else 0
    is_last = number + 1 == len(windows)
    last = window.frames - 1 if is_last else handover(window, windows[number + 1]) - window.first
    return submap_of(estimate, window, first, last, len(windows))


def _new_shares(windows: Sequence[Window]) -> list[float]:
    """Return the share of each window that the one before it has not seen."""
    ends = [windows[0].first, *(w.last for w in windows)]
    return [(w.last - max(w.first, before)) / w.frames for w, before in zip(windows, ends, strict=False)]
