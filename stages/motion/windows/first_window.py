"""Adjusts the first window of a run, which shows the errors of matches and of the encoder for all others."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.adjustment.levenberg_marquardt import Watch
from pipeline.machine.stage import Context
from stages.motion.bundle_adjustment.beyond_rings import (
    estimate_with_wall_beyond,
    is_known_everywhere,
    known_everywhere,
)
from stages.motion.bundle_adjustment.encoder_delay import EncoderDelay, delay_of_encoder
from stages.motion.bundle_adjustment.encoder_scale import EncoderScale, noise_of_encoder, scale_of_encoder
from stages.motion.bundle_adjustment.equations import Measurements
from stages.motion.bundle_adjustment.laser_knock import KnockTest
from stages.motion.bundle_adjustment.match_errors import lasting_excess
from stages.motion.bundle_adjustment.solver import (
    Estimate,
    estimate_again,
    estimate_state,
    scale_between_halves,
)
from stages.motion.bundle_adjustment.unknowns import State
from stages.motion.encoder import EncoderReadings
from stages.motion.parameters import MotionParameters
from stages.motion.stated_probe import TOO_FAR
from stages.motion.windows.measured_run import MeasuredRun
from stages.motion.windows.shared_error import scale_by_lag, with_shared_error
from stages.motion.windows.steady_laser import with_steady_laser
from stages.motion.windows.steady_scale import SteadyRun, with_steady_scale
from stages.motion.windows.submaps import Window

_LAG = 1.2
"""Radial error of templates, which are cut far ahead, over the error that a landmark's neighbouring matches
share: compared with true poses 0.2 to 0.45 px of 0.28 px in open-1-field's copy at crf 30."""
_FARTHEST_RAD = np.radians(45)
"""Smallest polar angle of matches that are used if more of their error than ``match_bias_px`` lasts from
picture to picture: wall one radius ahead. Codecs move the dim wall beyond it too slowly: in open-1-field's
copy at crf 30 the stream's own motion vectors lag behind the wall by .3 px a picture at 40°, by .02 px at
60°. Distances of open-1 to open-3 at crf 30 without encoder are .43, .14 and -.20 % off without such matches,
.71, .28 and .43 % with them. If the error is noise alone (0 px last in open-3, .2 px at crf 30), all are
used."""
_IN_REDUCER = 0.005
"""Relative 1 σ of distances if texture alone gives them and was followed through a reducer: in five drawn
ones, 12 to 15 % wider or narrower over 14 and 20 mm, they were off by .1 to 1.0 %, .5 % rms."""
_IN_LOST = 0.05
"""Relative 1 σ of distances if texture alone gives them and much of it was lost: by VP9 at .5 Mbit/s, which
left half of the pictures without texture, a distance came out 4.8 % short (one recording)."""
_ROUNDS, _NOISIER = 4, 1.5
"""The noise of the encoder's readings is estimated up to so many times, as long as it exceeds 1.5 times the
assumed noise: poses follow readings that have too much weight, which hides their noise. In good recordings
it is 0.5 to 1.2 times the assumed noise (open-1 to open-3, a05)."""


@dataclass(frozen=True)
class EncoderCheck:
    """The encoder's delay and scale compared with rings and texture; None where there is no evidence."""

    delay: EncoderDelay | None
    scale: EncoderScale | None

    def doubt_of_probe(self, wider: float) -> float:
        """Return `EncoderScale.doubt_of_probe`, 0 without a scale."""
        return 0.0 if self.scale is None else self.scale.doubt_of_probe(wider)

    def warn(self, context: Context, wider: float) -> None:
        """Warn of errors of the encoder; ``wider`` is the pipe's diameter over the nominal one, minus 1."""
        if self.delay is not None:
            self.delay.warn(context)
        if self.scale is not None:
            self.scale.warn(context, wider)


@dataclass(frozen=True)
class FirstWindow:
    """The adjusted first window, and the run as the following windows are to use it.

    Attributes
    ----------
    run : MeasuredRun
        The run with its encoder synchronised with the pictures, and a scale no surer than they allow.
    parameters : MotionParameters
        Parameters with the error that matches share in this recording.
    estimate : Estimate
    measured : Measurements
    unsure : float
        Relative 1 σ of distances by texture that its residuals do not show.
    encoder : EncoderCheck
    steady : SteadyRun
        Course of the image scale.
    knock : KnockTest or None
        Test for a knock of the laser, if rings jump.
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
        """Return the relative 1 σ of distances in addition to the estimate's own."""
        return float(np.hypot(self.unsure, self.steady.distance_sigma))


@dataclass(frozen=True)
class _Adjusted:
    """The first window, adjusted with a certain run and parameters."""

    run: MeasuredRun
    window: Window
    parameters: MotionParameters
    measured: Measurements
    estimate: Estimate
    watch: Watch

    @property
    def lasting_px(self) -> float:
        """Return the error, px, that a landmark's neighbouring matches share."""
        residual = self.estimate.adjusted.equations.texture.residual
        return lasting_excess(residual, self.measured.tracks.landmark)

    def with_encoder(self, encoder: EncoderReadings) -> _Adjusted:
        """Return it with other readings, before an adjustment to them."""
        run = replace(self.run, encoder=encoder)
        return replace(self, run=run, measured=run.measured(self.window, self.parameters))

    def with_texture_off(self, times: float) -> _Adjusted:
        """Return it adjusted again, with common and own errors of the matches multiplied by ``times``."""
        given = self.parameters
        wider = {"match_bias_px": times * given.match_bias_px, "alike": times**2 * given.alike}
        return replace(self, parameters=given.model_copy(update=wider)).resumed()

    def resumed(self) -> _Adjusted:
        """Return it adjusted again from its estimate, as the same motion."""
        return replace(
            self, estimate=estimate_again(self.estimate, self.measured, self.parameters, self.watch)
        )

    def again(self, start: State) -> _Adjusted:
        """Return it adjusted again, starting at a state."""
        estimate = estimate_state(start, self.measured, self.parameters, self.watch)
        return replace(self, estimate=estimate)


def adjust_first(run: MeasuredRun, window: Window, parameters: MotionParameters, watch: Watch) -> FirstWindow:
    """Adjust the first window of a run, and again for every stated property that it contradicts.

    Raises
    ------
    UnusableError
        When the motion is not determined.
    """
    run, knock = with_steady_laser(run, parameters, watch)
    measured = run.measured(window, parameters)
    estimate = estimate_with_wall_beyond(run.start(window, measured, parameters), measured, parameters, watch)
    if is_known_everywhere(estimate.state.bore):
        run = replace(run, bore=known_everywhere(run.bore))
    first = _Adjusted(run, window, parameters, measured, estimate, watch)
    first, unsure = _with_shared_error(first)
    first, delay = _without_delay(first)
    first, scale, unsure = with_scale(_with_noise(first), unsure)
    steady = with_steady_scale(first.run, window, first.estimate, first.measured, first.parameters, watch)
    check = EncoderCheck(delay, scale)
    return FirstWindow(
        steady.run, first.parameters, steady.estimate, steady.measured, unsure, check, steady, knock
    )


def _with_shared_error(first: _Adjusted) -> tuple[_Adjusted, float]:
    """Allow for the error that matches share; return also the relative 1 σ of distances that it causes."""
    noisy = with_shared_error(first.parameters, first.estimate.adjusted.equations.reprojection_px)
    if noisy is first.parameters:
        return first, 0.0
    lasts = first.lasting_px > first.parameters.match_bias_px
    first = replace(first, parameters=noisy)
    first = _without_far_texture(first) if lasts else first.resumed()
    lag_px = _LAG * first.lasting_px
    halves = scale_between_halves(first.estimate, first.measured, noisy, first.watch)
    return first, float(
        np.hypot(halves, scale_by_lag(lag_px, first.run.texture.grid, first.run.probe.camera))
    )


def _without_far_texture(first: _Adjusted) -> _Adjusted:
    """Adjust again without the matches far ahead, unless they are the majority."""
    tracks, state = first.measured.tracks, first.estimate.state
    beside = tracks.polar_angle(first.run.probe.camera) >= _FARTHEST_RAD
    if beside.mean() < 0.5:
        return first.resumed()
    run = replace(first.run, farthest_rad=_FARTHEST_RAD)
    first = replace(first, run=run, measured=run.measured(first.window, first.parameters))
    return first.again(replace(state, xyz_p=state.xyz_p[tracks.some(beside)[1]]))


def _without_delay(first: _Adjusted) -> tuple[_Adjusted, EncoderDelay | None]:
    """Correct a delay of the encoder relative to the motion from pictures alone."""
    delay, encoder = delay_of_encoder(first.estimate, first.measured), first.run.encoder
    if delay is None or encoder is None or not delay.matters:
        return first, delay
    free = _without_encoder(first)
    delay = delay_of_encoder(free, first.measured)
    if delay is None or not delay.matters:
        return first, delay
    return first.with_encoder(delay.corrected(encoder, first.run.time_s)).again(free.state), delay


def _with_noise(first: _Adjusted) -> _Adjusted:
    """Give the encoder's readings the noise that they show, if it exceeds the assumed noise."""
    for _ in range(_ROUNDS):
        encoder, noise_mm = first.run.encoder, noise_of_encoder(first.estimate, first.measured)
        if encoder is None or noise_mm < _NOISIER * encoder.sigma_mm:
            break
        first = first.with_encoder(replace(encoder, sigma_mm=noise_mm)).again(first.estimate.state)
    return first


def with_scale(first: _Adjusted, unsure: float) -> tuple[_Adjusted, EncoderScale | None, float]:
    """Widen the encoder scale's σ by its contradiction to the pictures; return it and texture's 1 σ."""
    creep_mm = first.parameters.encoder_slip_sigma_mm
    unsure = float(np.hypot(unsure, first.run.held_sigma))
    scale = scale_of_encoder(first.estimate, first.measured, unsure, creep_mm)
    if scale is None:
        return first, None, float(np.hypot(unsure, _unseen_error(first.run)))
    if _lost_much(first):
        return _beside_lost_texture(first, scale, unsure)
    if first.run.bore.reduces or (scale.contradicted and _probe_does_not_fit(first)):
        scale = scale.without_trust_in_texture()
        unsure = scale.sigma
    if scale.contradicted:
        probe = replace(first.run.probe, encoder_scale_sigma=abs(scale.scale - 1))
        run, measured = replace(first.run, probe=probe), replace(first.measured, probe=probe)
        first = replace(first, run=run, measured=measured).resumed()
    return first, scale, float(np.hypot(unsure, scale.doubt))


def _probe_does_not_fit(first: _Adjusted) -> bool:
    """Return whether the pictures alone move the probe, which gives distances their scale, beyond its σ."""
    directions = first.run.probe.principal_uncertainties().shape[1]
    moved = _without_encoder(first).state.instrument[:directions]
    return float(np.abs(moved).max(initial=0.0)) > TOO_FAR


def _unseen_error(run: MeasuredRun) -> float:
    """Return the relative 1 σ of distances from texture alone, for errors that its residuals do not show.

    It is 0 beside an encoder: then there is no texture, and the encoder alone gives distances.
    """
    if run.encoder is not None:
        return 0.0
    lost = _IN_LOST * run.texture.poses.much_lost
    return float(np.hypot(lost, _IN_REDUCER * run.bore.reduces))


def _lost_much(first: _Adjusted) -> bool:
    """Return whether much texture was lost in the first window, which alone gives the encoder's scale."""
    return first.run.texture.poses.between(first.window.first, first.window.last).much_lost


def _beside_lost_texture(
    first: _Adjusted, scale: EncoderScale, unsure: float
) -> tuple[_Adjusted, EncoderScale, float]:
    """Follow the encoder, and widen the σ of distances by its contradiction to the remaining texture."""
    doubted = scale.beside_lost_texture()
    if scale.doubted:
        first, unsure = first.with_texture_off(scale.in_sigma), doubted.sigma
    elif first.run.bore.reduces:
        unsure = doubted.sigma
    return first, doubted, unsure


def _without_encoder(first: _Adjusted) -> Estimate:
    """Return the motion from rings and texture alone: a late encoder would shift it."""
    start = replace(first.estimate.state, slip=0 * first.estimate.state.slip)
    return estimate_state(start, replace(first.measured, encoder=None), first.parameters, first.watch)
