"""An image scale that drifts over a run, told from a pipe that widens, by a linear step at an estimate.

A lens that warms up, or a laser that moves against the camera, makes the rings grow or shrink over the run: a
picture larger by a share ε has rings with 3 ε more radius, but the wall that texture follows, between
landmarks and encoder, is wider by 0.3 ε only (open-1-field). A pipe that widens is wider in both. Columns for
both, low polynomials of time and of distance, are added to the equations at their optimum.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import legendre

from pipeline.arrays import Float
from pipeline.geometry.axis import to_pipe
from pipeline.machine.stage import Context
from stages.motion.bore import Bore
from stages.motion.bundle_adjustment.equations import Measurements
from stages.motion.bundle_adjustment.extra_columns import ExtraColumns, RingsInPipe, chance
from stages.motion.bundle_adjustment.solver import Estimate
from stages.motion.bundle_adjustment.unknowns import State

_COURSE, _WIDTH = 3, 4
"""Degrees of the polynomials: warming up by an exponential of a third of the run is followed by three to a
thirtieth of its size; the pipe's width gets one more, so that its own waves are not taken for the lens."""
_LARGEST = 0.1
"""1 σ of either beforehand, relative: no more than keeps the equations regular."""
_SURE_P = 1e-4
"""Chance of the equations by which a steady scale is refused: that of 4 σ."""
_MAY_BE_P = 1e-3
"""Chance above which the rings' course may all be due to the scale: that of 3 σ."""
_ONE_WAY = 0.5
"""Share of its range by which a scale that drifts must have changed from first to last: what warms up or
comes loose goes one way. Grooves of a gauge left a fifth in a healthy probe (a01), drifts have 0.9."""
_LARGE = 0.01
"""Course, relative, from which it is not taken out. One of 0.8 % was, within its σ; at 1 % over 80 mm the
rings' change was taken for a step of the bore. A pipe full of water came to 7 %."""
_OTHER_CAUSE = 0.1
"""Share of the course that is unsure: a laser that moves changes the rings alone, a lens the wall seen in
texture too, by a tenth as much, which is below the σ of texture."""


@dataclass(frozen=True)
class ScaleDrift:
    """How the image scale changes over a window; its mean is taken to be the probe's.

    Attributes
    ----------
    at_frames : (N,)
        By how much pictures are larger than on average, relative, including what was corrected so far.
    sigma : (N,)
        Its 1 σ.
    p_steady : float
        Probability of a scale that changes so much if it was steady.
    p_even : float
        Probability of a width that changes so much if the pipe has one width.
    p_neither : float
        Probability of rings that change so much if neither scale nor width did.
    alone : (N,)
        The course if the pipe is of one width.
    ring_mm : float
        Gain of the rings' radius per relative gain of scale.
    stated_mm : float
        1 σ of the pipe's radius without any of it.
    contradicted : bool
        Whether the run with the drift corrected did not confirm it: see `with_steady_scale`.
    """

    at_frames: Float
    sigma: Float
    p_steady: float
    p_even: float
    p_neither: float
    alone: Float
    ring_mm: float
    stated_mm: float
    contradicted: bool = False

    @property
    def told(self) -> bool:
        """Whether the scale cannot have been steady, and went one way."""
        one_way = abs(self.change) > _ONE_WAY * float(np.ptp(self.at_frames))
        return self.p_steady < _SURE_P and one_way and not self.contradicted

    def not_told(self) -> ScaleDrift:
        """Return the drift as one that is neither certain (`told`) nor `ambiguous`."""
        return replace(self, p_steady=1.0, p_neither=1.0)

    def not_told_from_width(self) -> ScaleDrift:
        """Return the drift as one that a widening pipe explains as well."""
        return replace(self, p_steady=1.0, p_even=1.0)

    @property
    def change(self) -> float:
        """Return the relative gain of the scale from first to last."""
        return float(self.at_frames[-1] - self.at_frames[0])

    @property
    def large(self) -> bool:
        """Whether it is more than a lens changes by warming up."""
        return float(np.ptp(self.at_frames)) > _LARGE

    @property
    def ambiguous(self) -> bool:
        """Whether the rings change, and a lens that drifts explains it as well as a pipe that widens."""
        return not (self.told or self.contradicted) and self.p_neither < _SURE_P and self.p_even > _MAY_BE_P

    @property
    def offset_sigma(self) -> float:
        """Return the relative 1 σ of the mean scale: the probe was calibrated anywhere on the course."""
        return float(np.abs(self.at_frames).max())

    @property
    def stated_sigma(self) -> Float:
        """Return the 1 σ (N,) of the scale, relative, that radii are to be stated with."""
        if self.told or self.contradicted:
            own = np.hypot(self.sigma, _OTHER_CAUSE * self.at_frames)
            return np.asarray(np.hypot(own, self.offset_sigma))
        return np.abs(self.alone) if self.ambiguous else np.zeros_like(self.alone)

    def warn(self, context: Context, taken_out: bool) -> None:
        """Warn of a scale that drifts, or of rings that may change because of it."""
        if self.told:
            context.warn(self._words(taken_out))
        elif self.contradicted:
            context.warn(
                f"as if {self._what}. But with this taken out texture and rings do not agree, as where a "
                "noise filter makes texture lag behind the wall. Nothing is corrected: σ of the radii "
                "includes it. What to do: switch off noise reduction, let the probe warm up, or measure both "
                "ends' diameters"
            )
        elif self.ambiguous and (widest := float(np.ptp(self.alone) * abs(self.ring_mm))) > self.stated_mm:
            context.warn(
                f"the rings change by {widest:.2f} mm of radius over the run. Either the pipe does, or the "
                f"picture's scale drifts by {100 * np.ptp(self.alone):.2f} % (a lens that warms up): there "
                "is too little texture to tell which. σ of the radii includes it. What to do: let the probe "
                "warm up, record back and forth, give an encoder, or measure both ends' diameters"
            )

    @property
    def _what(self) -> str:
        course = float(np.ptp(self.at_frames))
        return (
            f"the picture {'grows' if self.change > 0 else 'shrinks'} by {100 * course:.2f} % over the run: "
            f"the rings change by {abs(course * self.ring_mm):.2f} mm of radius, and the texture does not "
            "follow"
        )

    def _words(self, taken_out: bool) -> str:
        if self.large:
            return (
                f"as if {self._what}. No lens changes so much by warming up: zoom or stabilisation is on, "
                "the laser is loose, or the pipe's filling (water) or the probe is not as stated. This is "
                "not corrected: radii and distances may be off by more than their σ. What to do: look at the "
                "pictures and the probe file, run boresight diagnose"
            )
        outcome = (
            "This is corrected in motion and radii, and their σ includes what remains"
            if taken_out
            else "Runs of this length are not corrected: radii and distances may be off by more than their σ"
        )
        return (
            f"{self._what}. The lens warms up or is loose, the laser moves against the camera, or zoom or "
            f"stabilisation is on. {outcome}. What to do: let the probe warm up before the run, fix lens and "
            "laser, switch off zoom and stabilisation"
        )


def drift_of_scale(estimate: Estimate, measured: Measurements, before: Float | None = None) -> ScaleDrift:
    """Return the course of the image scale at an estimate; ``before`` (N,) was taken out of it already."""
    course = _polynomials(measured.time_s, _COURSE)
    step, covariance = _widths_and_scales(estimate, measured, course).solved(estimate)
    widths = len(step) - _COURSE
    width, scale = np.arange(widths), np.arange(widths, len(step))
    found, own = step[scale], covariance[np.ix_(scale, scale)]
    follow = covariance[np.ix_(scale, width)] @ np.linalg.inv(covariance[np.ix_(width, width)])
    before = np.zeros(len(course)) if before is None else before
    at_frames = before + course @ found
    sigma = np.sqrt(np.einsum("ni,ij,nj->n", course, own, course))
    known = np.linalg.lstsq(course, before, rcond=None)[0]
    return ScaleDrift(
        at_frames, sigma, chance(found + known, own), chance(step[width], covariance[np.ix_(width, width)]),
        chance(step, covariance), course @ (found - follow @ step[width]),
        _ring_gain(RingsInPipe.of(estimate.state, measured), estimate.state, measured)[1],
        float(np.sqrt(estimate.factor.border_covariance()[0, 0])),
    )  # fmt: skip


def _widths_and_scales(estimate: Estimate, measured: Measurements, course: Float) -> ExtraColumns:
    """Return the columns of the pipe's widths, then of the scale's course."""
    state, texture = estimate.state, estimate.adjusted.equations.texture
    rings = RingsInPipe.of(state, measured)
    by_ring, _ = _ring_gain(rings, state, measured)
    span = np.concatenate([rings.span_mm, to_pipe(state.axis, state.xyz_p)[0]])
    width, count = _widths(span, state.bore), len(rings.span_mm)
    in_rings = np.concatenate([-width[:count], by_ring[:, None] * course[measured.rings.frame]], 1)
    away_px = measured.tracks.uv - measured.camera_at(state).centre_px
    away_px = away_px * np.asarray(texture.by_pose.any((1, 2)))[:, None]
    by_scale = away_px[:, :, None] * course[measured.tracks.frame][:, None, :]
    widths, landmarks = width.shape[1], width[count:]
    pixels = np.concatenate([np.zeros((*away_px.shape, widths)), by_scale], 2)
    surface = np.concatenate([-landmarks, np.zeros((len(landmarks), _COURSE))], 1)
    sigma = _LARGEST * np.r_[np.full(widths, state.nominal_radius_mm), np.ones(_COURSE)]
    return ExtraColumns(in_rings, pixels, surface, sigma)


def _ring_gain(rings: RingsInPipe, state: State, measured: Measurements) -> tuple[Float, float]:
    """Return what rings' residuals (M,) change by per scale that was too large, and the mean radius' gain."""
    camera = measured.camera_at(state)
    radius_px = np.linalg.norm(camera.project(rings.xyz_c).uv - camera.centre_px, axis=1)
    gain = np.einsum("mi,mi->m", rings.normal_c, measured.rings.by_pixel) * radius_px
    gain = np.where(np.isfinite(gain), gain, 0.0)
    return -gain, float(np.median(gain)) if gain.size else 0.0


def _widths(at_mm: Float, bore: Bore) -> Float:
    """Return what the pipe's width may add at distances (M,): (M, 4 + steps), smooth, and a step at each."""
    steps = (at_mm[:, None] > bore.at_mm).astype(float)
    return np.concatenate([_polynomials(at_mm, _WIDTH), steps], 1)


def _polynomials(at: Float, degree: int) -> Float:
    """Return Legendre's polynomials (M, degree) from the first on, over the span of places (M,)."""
    x = 2 * (at - at.min()) / max(float(np.ptp(at)), 1e-9) - 1
    return np.asarray(legendre.legvander(x, degree)[:, 1:])
