"""The first window of a run, which shows what the others rest on: errors of matches, the encoder's faults."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.adjustment.levenberg_marquardt import Watch
from pipeline.instrument.camera import Camera
from pipeline.machine.stage import Context
from stages.motion.bundle_adjustment.encoder_delay import EncoderDelay, delay_of_encoder
from stages.motion.bundle_adjustment.encoder_scale import EncoderScale, noise_of_encoder, scale_of_encoder
from stages.motion.bundle_adjustment.equations import Measurements
from stages.motion.bundle_adjustment.laser_knock import KnockTest
from stages.motion.bundle_adjustment.solver import (
    Estimate,
    estimate_state,
    lasting_excess,
    scale_between_halves,
)
from stages.motion.parameters import MotionParameters
from stages.motion.tracking.strips import StripGrid
from stages.motion.windows.measured_run import MeasuredRun
from stages.motion.windows.steady_laser import with_steady_laser
from stages.motion.windows.steady_scale import SteadyRun, with_steady_scale
from stages.motion.windows.submaps import Window

_SHARED_ERROR = 1 / 3
"""Radial error that matches share over their median reprojection error: against a calibrated probe 0.05 px of
0.14 px in open-1-field, 0.2 px of 0.60 px in its copy at crf 30."""
_LAG = 1.2
"""Error along the radius of templates, which are cut far ahead, over the error that a landmark's neighbouring
matches share: against true poses 0.2 to 0.45 px of 0.28 px in open-1-field's copy at crf 30."""
_MOST_SHARED_PX = 2.0
"""Where matches disagree by more, the parameter's own limit holds."""
_IN_REDUCER = 0.005
"""Relative 1 σ of distances where texture was followed through a reducer and nothing else tells them: in five
drawn ones, 12 to 15 % wider or narrower over 14 and 20 mm, they were off by .1 to 1.0 %, .5 % rms."""
_ROUNDS, _NOISIER = 4, 1.5
"""Times that the noise of readings is looked at again while it is half as large again as taken: the poses
follow readings that are believed too much. Good recordings show 0.5 to 1.2 times what is taken (open-1 to
open-3, a05)."""


@dataclass(frozen=True)
class EncoderCheck:
    """The encoder's delay and scale against rings and texture; None where nothing tells them."""

    delay: EncoderDelay | None
    scale: EncoderScale | None

    def doubt_of_probe(self, wider: float) -> float:
        """Return the relative 1 σ of lengths by a probe that encoder and diameter contradict: see there."""
        return 0.0 if self.scale is None else self.scale.doubt_of_probe(wider)

    def warn(self, context: Context, wider: float) -> None:
        """Tell of what was wrong with the encoder, in a pipe ``wider`` than nominal by that share."""
        if self.delay is not None:
            self.delay.warn(context)
        if self.scale is not None:
            self.scale.warn(context, wider)


@dataclass(frozen=True)
class FirstWindow:
    """The first window adjusted, and the run as it is to be adjusted from there.

    Attributes
    ----------
    run : MeasuredRun
        Its encoder in time with the pictures, its scale no surer than they allow.
    parameters : MotionParameters
        With the error that matches share in this recording.
    estimate : Estimate
    measured : Measurements
    unsure : float
        Relative 1 σ of distances by texture that its residuals do not show.
    encoder : EncoderCheck
    steady : SteadyRun
        Its image scale.
    knock : KnockTest or None
        Of its laser, where rings jump.
    """

    run: MeasuredRun
    parameters: MotionParameters
    estimate: Estimate
    measured: Measurements
    unsure: float
    encoder: EncoderCheck
    steady: SteadyRun
    knock: KnockTest | None

    @property
    def distance_sigma(self) -> float:
        """Return the relative 1 σ of distances beside the estimate's own."""
        return float(np.hypot(self.unsure, self.steady.distance_sigma))


def adjust_first(run: MeasuredRun, window: Window, parameters: MotionParameters, watch: Watch) -> FirstWindow:
    """Adjust the first window of a run, and again where it shows that something was not as stated.

    Raises
    ------
    UnusableError
        When the motion is not determined.
    """
    run, knock = with_steady_laser(run, parameters, watch)
    measured = run.measured(window, parameters)
    estimate = estimate_state(run.start(window, measured, parameters), measured, parameters, watch)
    noisy, unsure = with_shared_error(parameters, estimate.adjusted.equations.reprojection_px), 0.0
    if noisy is not parameters:
        parameters, estimate = noisy, estimate_state(estimate.state, measured, noisy, watch)
        residual = estimate.adjusted.equations.texture.residual
        lag_px = _LAG * lasting_excess(residual, measured.tracks.landmark)
        halves = scale_between_halves(estimate, measured, parameters, watch)
        unsure = float(np.hypot(halves, scale_by_lag(lag_px, run.texture.grid, run.probe.camera)))
    delay = delay_of_encoder(estimate, measured)
    if delay is not None and run.encoder is not None and delay.matters:
        free = _without_encoder(estimate, measured, parameters, watch)
        delay = delay_of_encoder(free, measured)
        if delay is not None and delay.matters:
            run = replace(run, encoder=delay.taken_out(run.encoder, run.time_s))
            measured = run.measured(window, parameters)
        estimate = estimate_state(free.state, measured, parameters, watch)
    for _ in range(_ROUNDS):
        noise_mm = noise_of_encoder(estimate, measured)
        if run.encoder is None or noise_mm < _NOISIER * run.encoder.sigma_mm:
            break
        run = replace(run, encoder=replace(run.encoder, sigma_mm=noise_mm))
        measured = run.measured(window, parameters)
        estimate = estimate_state(estimate.state, measured, parameters, watch)
    scale = scale_of_encoder(estimate, measured, unsure)
    if run.bore.reduces:
        scale = None if scale is None else scale.without_trust_in_texture()
        unsure = float(np.hypot(unsure, _IN_REDUCER)) if scale is None else scale.sigma
    if scale is not None and scale.contradicted:
        run = replace(run, probe=replace(run.probe, encoder_scale_sigma=abs(scale.scale - 1)))
        measured = replace(measured, probe=run.probe)
        estimate = estimate_state(estimate.state, measured, parameters, watch)
    steady = with_steady_scale(run, window, estimate, measured, parameters, watch)
    check = EncoderCheck(delay, scale)
    return FirstWindow(steady.run, parameters, steady.estimate, steady.measured, unsure, check, steady, knock)


def _without_encoder(
    estimate: Estimate, measured: Measurements, parameters: MotionParameters, watch: Watch
) -> Estimate:
    """Return the motion that rings and texture alone show: a late encoder draws it along."""
    start = replace(estimate.state, slip=0 * estimate.state.slip)
    return estimate_state(start, replace(measured, encoder=None), parameters, watch)


def with_shared_error(parameters: MotionParameters, reprojection_px: float) -> MotionParameters:
    """Return the parameters with the radial error that matches may share, as large as this recording's is.

    What blurs or compresses pictures moves all matches near one polar angle alike, and a scale along the
    pipe can take that up unseen; how much of it there is, is judged by what the matches do not agree on.
    """
    shared = _SHARED_ERROR * reprojection_px
    if shared <= parameters.match_bias_px:
        return parameters
    return parameters.model_copy(update={"match_bias_px": min(shared, _MOST_SHARED_PX)})


def scale_by_lag(lag_px: float, grid: StripGrid, camera: Camera) -> float:
    """Return the relative 1 σ of distances by templates that are cut ``lag_px`` off, where they come in view.

    A codec drops the texture of the dim wall far ahead and carries it on from the picture before. Matches all
    the way past the camera are off by less and less, which is one with a longer way; no residual shows it.
    """
    ends = np.array([[grid.radius_mm, 0, grid.far_mm + ahead] for ahead in (-0.5, 0.5)])
    px_per_mm = float(np.linalg.norm(np.diff(camera.project(ends).uv, axis=0)))
    return lag_px / px_per_mm / (grid.far_mm - grid.near_mm)
