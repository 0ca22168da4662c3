"""The bundle adjustment slid over a long run window by window; a short run is one window."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from pipeline.adjustment.levenberg_marquardt import Watch
from pipeline.arrays import Float, Int
from pipeline.artefacts.measured import RingSamples
from pipeline.instrument.probe import Probe
from stages.motion.bundle_adjustment.encoder_scale import EncoderScale, scale_of_encoder
from stages.motion.bundle_adjustment.equations import MATCH_BIASES, Measurements
from stages.motion.bundle_adjustment.solver import (
    Estimate,
    estimate_state,
    estimate_with_shared,
    scale_between_halves,
)
from stages.motion.bundle_adjustment.unknowns import State, straight_start
from stages.motion.encoder import EncoderReadings
from stages.motion.parameters import MotionParameters
from stages.motion.rings import BoreSteps, ring_bins
from stages.motion.tracking.landmarks import Tracks
from stages.motion.tracking.normalisation import alike_samples
from stages.motion.tracking.tracker import TrackedTexture
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

_MARGIN_MM = 20.0
"""Length of axis before the first and beyond the last wall in view, for poses that move while adjusted."""
_SHARED_ERROR = 1 / 3
"""Radial error that matches share over their median reprojection error: against a calibrated probe 0.05 px of
0.14 px in open-1-field, 0.2 px of 0.60 px in its copy at crf 30."""
_MOST_SHARED_PX = 2.0
"""Where matches disagree by more, the parameter's own limit holds."""
_RAYLEIGH_MEDIAN = float(np.sqrt(2 * np.log(2)))
"""Median length of an error of two coordinates, of 1 σ each."""


@dataclass(frozen=True)
class MeasuredRun:
    """What was measured over a whole run; a window's part is worked out when it is needed.

    Attributes
    ----------
    texture : TrackedTexture
    rings : RingSamples
    ring_place : (F,) int
        Places of the rings' frames in the list of all frames.
    time_s : (N,)
    T_pc : (N, 4, 4)
        First guess in the straightened pipe.
    encoder : EncoderReadings or None
    probe : Probe
        As stated.
    bore : BoreSteps
        Of the straightened pipe.
    """

    texture: TrackedTexture
    rings: RingSamples
    ring_place: Int
    time_s: Float
    T_pc: Float
    encoder: EncoderReadings | None
    probe: Probe
    bore: BoreSteps

    @property
    def whole(self) -> Window:
        """Return the window of all frames."""
        return Window(0, len(self.time_s))

    def measured(self, window: Window, parameters: MotionParameters) -> Measurements:
        """Return what was measured in a window, frames and distance counted from its first."""
        part = slice(window.first, window.last)
        rows = slice(*np.searchsorted(self.ring_place, [window.first, window.last]))
        rings, place = _some_rings(self.rings, rows), self.ring_place[rows] - window.first
        bins = ring_bins(rings, place, self.probe, parameters.ring_bins, parameters.surface_sigma_mm)
        tracks = _behind(self.texture.between(window.first, window.last), self._start_mm(window))
        encoder = _since_first(self.encoder, part)
        return Measurements.of(tracks, bins, self.time_s[part], encoder, self.probe)

    def start(self, window: Window, measured: Measurements, parameters: MotionParameters) -> State:
        """Return the first guess in a window: a straight pipe, as long as its wall was seen."""
        T_pc = self.T_pc[window.first : window.last].copy()
        T_pc[:, 2, 3] -= self._start_mm(window)
        z, grid = T_pc[:, 2, 3], self.texture.grid
        span = (float(z.min()) - _MARGIN_MM, float(z.max()) + grid.far_mm + _MARGIN_MM)
        corrections = measured.unsure.shape[1] + MATCH_BIASES
        straight = straight_start(
            T_pc, measured.tracks.xyz, *span, grid.radius_mm, parameters.axis_knot_mm, corrections
        )
        return replace(straight, bore=self.bore.behind(self._start_mm(window)))

    def _start_mm(self, window: Window) -> float:
        return float(self.T_pc[window.first, 2, 3]) if window.first else 0.0


@dataclass(frozen=True)
class RunEstimate:
    """A whole run at its optimum, and how the adjustments of its windows ended.

    Attributes
    ----------
    joined : JoinedRun
    trials : int
        Steps tried in all windows together.
    unsettled : int
        Windows in which a step could still gain something.
    reprojection_px : float
        Median over the windows of the median reprojection error.
    excess : float
        Median over the windows of how many times the σ predicted by matching that error is; samples that are
        blurred together count as one.
    encoder_scale : EncoderScale or None
        As rings and texture of the first window alone have it; None without encoder.
    """

    joined: JoinedRun
    trials: int
    unsettled: int
    reprojection_px: float
    excess: float
    encoder_scale: EncoderScale | None


@dataclass(frozen=True)
class _Alone:
    """What is kept of a window adjusted on its own."""

    state: State
    smooth_sigma: Float
    told: SharedInformation


@dataclass(frozen=True)
class _End:
    """How a window's adjustment ended."""

    trials: int
    settled: bool
    reprojection_px: float
    excess: float

    @staticmethod
    def of(estimate: Estimate, measured: Measurements, step_mm: float) -> _End:
        adjusted = estimate.adjusted
        size = np.linalg.norm(adjusted.equations.texture.residual, axis=1)
        away_px = np.linalg.norm(measured.tracks.uv - measured.probe.camera.centre_px, axis=1)
        alike = alike_samples(away_px * step_mm / estimate.state.nominal_radius_mm)
        in_sigma = size / (_RAYLEIGH_MEDIAN * measured.tracks.sigma_px * np.sqrt(alike))
        excess = float(np.median(in_sigma)) if size.size else 0.0
        return _End(adjusted.trials, adjusted.settled, adjusted.equations.reprojection_px, excess)


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
    steps = 2 * len(windows)
    watch = partial(progress, 0, steps)
    estimate, measured = _adjusted(run, windows[0], parameters, watch)
    noisy, unsure = with_shared_error(parameters, estimate.adjusted.equations.reprojection_px), 0.0
    if noisy is not parameters:
        parameters, estimate = noisy, estimate_state(estimate.state, measured, noisy, watch)
        unsure = scale_between_halves(estimate, measured, parameters, watch)
    seen = scale_of_encoder(estimate, measured, unsure)
    if seen is not None and seen.contradicted:
        run = replace(run, probe=replace(run.probe, encoder_scale_sigma=abs(seen.scale - 1)))
        measured = replace(measured, probe=run.probe)
        estimate = estimate_state(estimate.state, measured, parameters, watch)
    check(estimate)
    if len(windows) == 1:
        joined = joined_at_once(estimate).with_scale_sigma(unsure)
        return _run_estimate(joined, [_End.of(estimate, measured, run.texture.grid.step_mm)], seen)
    alone = [_alone(estimate, measured)]
    for window in windows[1:]:
        watch = partial(progress, len(alone), steps)
        estimate, measured = _adjusted(run, window, parameters, watch)
        check(estimate)
        alone.append(_alone(estimate, measured))
    measured = run.measured(windows[-1], parameters)
    shared = fuse_shared([a.told for a in alone], _new_shares(windows), measured, alone[-1].state)
    found: list[tuple[Submap, _End]] = []
    for k, own in enumerate(alone):
        measured = run.measured(windows[k], parameters)
        watch = partial(progress, len(windows) + k, steps)
        estimate = estimate_with_shared(
            own.state, measured, shared.value, own.smooth_sigma, parameters, watch
        )
        check(estimate)
        found.append((_submap(estimate, windows, k), _End.of(estimate, measured, run.texture.grid.step_mm)))
    joined = join_submaps([f[0] for f in found], shared).with_scale_sigma(unsure)
    return _run_estimate(joined, [f[1] for f in found], seen)


def joined_at_once(estimate: Estimate) -> JoinedRun:
    """Return an estimate of all frames at once as a run of one window."""
    state = estimate.state
    which = state.shared_columns
    shared = SharedParameters(state.shared, estimate.factor.border_covariance()[np.ix_(which, which)])
    return join_submaps([_submap(estimate, [Window(0, len(state.T_pc))], 0)], shared)


def _run_estimate(joined: JoinedRun, ends: Sequence[_End], seen: EncoderScale | None) -> RunEstimate:
    error, excess = (float(np.median([getattr(e, n) for e in ends])) for n in ("reprojection_px", "excess"))
    trials, unsettled = sum(e.trials for e in ends), sum(not e.settled for e in ends)
    return RunEstimate(joined, trials, unsettled, error, excess, seen)


def _adjusted(
    run: MeasuredRun, window: Window, parameters: MotionParameters, watch: Watch
) -> tuple[Estimate, Measurements]:
    measured = run.measured(window, parameters)
    return estimate_state(run.start(window, measured, parameters), measured, parameters, watch), measured


def with_shared_error(parameters: MotionParameters, reprojection_px: float) -> MotionParameters:
    """Return the parameters with the radial error that matches may share, as large as this recording's is.

    What blurs or compresses pictures moves all matches near one polar angle alike, and a scale along the
    pipe can take that up unseen; how much of it there is, is judged by what the matches do not agree on.
    """
    shared = _SHARED_ERROR * reprojection_px
    if shared <= parameters.match_bias_px:
        return parameters
    return parameters.model_copy(update={"match_bias_px": min(shared, _MOST_SHARED_PX)})


def _alone(estimate: Estimate, measured: Measurements) -> _Alone:
    return _Alone(estimate.state, estimate.smooth_sigma, shared_information(estimate, measured))


def _submap(estimate: Estimate, windows: Sequence[Window], number: int) -> Submap:
    """Return a window's submap, its errors stated from the handover before it to the one behind it."""
    window = windows[number]
    first = handover(windows[number - 1], window) - window.first if number else 0
    is_last = number + 1 == len(windows)
    last = window.frames - 1 if is_last else handover(window, windows[number + 1]) - window.first
    return submap_of(estimate, window, first, last, len(windows))


def _new_shares(windows: Sequence[Window]) -> list[float]:
    """Return the part of each window that the one before it has not seen."""
    ends = [windows[0].first, *(w.last for w in windows)]
    return [(w.last - max(w.first, before)) / w.frames for w, before in zip(windows, ends, strict=False)]


def _some_rings(rings: RingSamples, rows: slice) -> RingSamples:
    per_frame = ("frame", "radius_px", "sigma_px", "width_px", "amplitude", "validity")
    return replace(rings, **{name: getattr(rings, name)[rows] for name in per_frame})


def _behind(tracks: Tracks, start_mm: float) -> Tracks:
    """Return tracks with distance counted from ``start_mm``."""
    T_pc, xyz = tracks.poses.T_pc.copy(), tracks.xyz - np.array([0, 0, start_mm])
    T_pc[:, 2, 3] -= start_mm
    return replace(tracks, poses=replace(tracks.poses, T_pc=T_pc), xyz=xyz)


def _since_first(encoder: EncoderReadings | None, part: slice) -> EncoderReadings | None:
    if encoder is None:
        return None
    distance = encoder.distance_mm[part]
    return replace(encoder, distance_mm=distance - distance[0], known=encoder.known[part])
