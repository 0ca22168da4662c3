"""Corrects an image scale that drifts over a run, and adjusts the run again."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.adjustment.levenberg_marquardt import Watch
from pipeline.arrays import Float
from pipeline.machine.stage import Context
from stages.motion.bundle_adjustment.equations import Measurements
from stages.motion.bundle_adjustment.image_scale import ScaleDrift, drift_of_scale
from stages.motion.bundle_adjustment.solver import Estimate, estimate_state
from stages.motion.bundle_adjustment.wall_twice import wall_twice
from stages.motion.parameters import MotionParameters
from stages.motion.windows.measured_run import MeasuredRun
from stages.motion.windows.submaps import Window

_ROUNDS = 2
"""Number of corrections of the scale: the second finds the rest that the linear step before it left."""
_FOUND_AGAIN = 0.5
"""A correction is kept only if the drift estimated afterwards, correction included, differs from it by at
most this share of it (chosen). With a noise filter, whose matches lag behind the wall, .55 % were
removed from a steady scale and .07 % were found afterwards: the wall came out .8 mm wider at one end."""


@dataclass(frozen=True)
class SteadyRun:
    """A run, its estimate, its image scale, and whether a drift of the scale was corrected."""

    run: MeasuredRun
    estimate: Estimate
    measured: Measurements
    drift: ScaleDrift
    corrected: bool

    def warn(self, context: Context) -> None:
        """Warn of a scale that drifted."""
        self.drift.warn(context, self.corrected)

    @property
    def distance_sigma(self) -> float:
        """Return the relative 1 σ that a drift adds to distances, which follow the rings or the encoder."""
        if not (self.drift.certain or self.drift.contradicted):
            return 0.0
        by_rings = abs(self.drift.ring_mm) * self.drift.offset_sigma / self.estimate.state.nominal_radius_mm
        return by_rings if self.measured.encoder is None else min(by_rings, self._encoder_sigma)

    @property
    def _encoder_sigma(self) -> float:
        return self.measured.probe.encoder_scale_sigma

    @property
    def scale(self) -> Float | None:
        """Return the factor (N,) by which pictures were too large; None if nothing was corrected."""
        return self.run.image_scale

    @property
    def scale_sigma(self) -> Float | None:
        """Return its 1 σ (N,); None if the recording confirms a steady scale, or is too long."""
        whole = len(self.drift.at_frames) == len(self.run.time_s)
        stated = self.drift.certain or self.drift.ambiguous or self.drift.contradicted
        return self.drift.stated_sigma if whole and stated else None


def with_steady_scale(
    run: MeasuredRun,
    window: Window,
    estimate: Estimate,
    measured: Measurements,
    parameters: MotionParameters,
    watch: Watch,
) -> SteadyRun:
    """Test the image scale for drift in a window, and correct it if the window is the whole run.

    A large drift is reported and not corrected. In a reducer nothing is reported, because rings and texture
    differ there in the same way as with a drift. If most pictures show no texture, a drift cannot be
    distinguished from a pipe that widens. A drift that only an encoder shows, and the pictures without it do
    not, may be the encoder's. A correction that the corrected run does not confirm is undone, and none is
    made where water or glass displaces the picture differently from place to place.

    Raises
    ------
    UnusableError
        When the motion is not determined.
    """
    drift = drift_of_scale(estimate, measured)
    if run.bore.reduces:
        drift = drift.without_evidence()
    elif run.texture.poses.mostly_lost:
        drift = drift.indistinct_from_width()
    if drift.certain and drift_of_scale(estimate.without_encoder(), measured).may_be_steady:
        drift = replace(drift, contradicted=True, by_encoder=True)
    if not drift.certain or window != run.whole or drift.large:
        return SteadyRun(run, estimate, measured, drift, corrected=False)
    contradicted = replace(drift, contradicted=True)
    unchanged = SteadyRun(run, estimate, measured, contradicted, corrected=False)
    grid = run.texture.grid
    if wall_twice(estimate, measured, parameters.patch_size * grid.step_mm, grid.length_mm).is_certain:
        return unchanged
    first = drift
    for _ in range(_ROUNDS):
        correction = drift.at_frames
        run = replace(run, image_scale=1 + correction)
        measured = run.measured(window, parameters)
        # Not from the last estimate: its poses and landmarks follow the drift, and stay there.
        estimate = estimate_state(run.start(window, measured, parameters), measured, parameters, watch)
        drift = drift_of_scale(estimate, measured, correction)
    if np.ptp(drift.at_frames - correction) > _FOUND_AGAIN * np.ptp(correction):
        return unchanged
    drift = replace(drift, p_steady=first.p_steady)
    return SteadyRun(run, estimate, measured, drift, corrected=True)
