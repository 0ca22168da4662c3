"""Distinguishes an image scale that drifts over a run from a pipe that widens, by a linear step.

A lens that warms up, or a laser that moves relative to the camera, makes the rings grow or shrink over the
run: in a picture enlarged by a share ε, rings have a radius larger by 3 ε, but the wall as located by texture
and encoder is wider by 0.3 ε only (open-1-field). A pipe that widens is wider in both. Columns for both
causes, low polynomials of time and of distance, are added to the equations at their optimum.
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
"""Degrees of the polynomials: three follow an exponential warm-up of a third of the run to a thirtieth of its
size; the pipe's width gets one more, so that its own waves are not attributed to the lens."""
_LARGEST = 0.1
"""Relative prior 1 σ of either: just enough to keep the equations regular."""
_SURE_P = 1e-4
"""Probability below which a steady scale is rejected: that of 4 σ."""
_MAY_BE_P = 1e-3
"""Probability above which the rings' course may be due to the scale alone: that of 3 σ."""
_CONFIRMED_P = 0.05
"""Probability of a steady scale below which pictures without encoder confirm a drift that it shows: 2 σ.
Drifts of .5 and .8 % had 1e-6 and .002, encoders .2 s late or early .9."""
_ONE_WAY = 0.5
"""Share of its range by which a scale that drifts must have changed from first to last: warming up and coming
loose go one way. Grooves of a gauge left a fifth in a healthy probe (a01), drifts have 0.9."""
_LARGE = 0.01
"""Relative course from which it is not corrected. One of 0.8 % was, within its σ; at 1 % over 80 mm the
rings' change was taken for a step of the bore. A pipe full of water came to 7 %."""
_OTHER_CAUSE = 0.1
"""Uncertain share of the course: a laser that moves changes the rings alone, a lens also changes the wall
seen in texture, by a tenth as much, which is below the σ of texture."""


@dataclass(frozen=True)
class ScaleDrift:
    """Course of the image scale over a window; its mean is assumed to be the probe's scale.

    Attributes
    ----------
    at_frames : (N,)
        Relative excess of the pictures' size over its mean, including the correction so far.
    sigma : (N,)
        1 σ of ``at_frames``.
    p_steady : float
        Probability of a scale that changes so much if it was steady.
    p_even : float
        Probability of a width that changes so much if the pipe has one width.
    p_neither : float
        Probability of rings that change so much if neither scale nor width did.
    alone : (N,)
        The course of the scale if the pipe has one width.
    ring_mm : float
        Change of the rings' radius per relative change of the scale.
    stated_mm : float
        1 σ of the pipe's radius without a drift.
    contradicted : bool
        Whether the run with the drift corrected did not confirm it: see `with_steady_scale`.
    by_encoder : bool
        Whether it is ``contradicted`` since only the encoder shows it, and no picture without it.
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
    by_encoder: bool = False

    @property
    def certain(self) -> bool:
        """Whether the scale certainly drifted: it cannot have been steady, and went one way."""
        one_way = abs(self.change) > _ONE_WAY * float(np.ptp(self.at_frames))
        return self.p_steady < _SURE_P and one_way and not self.contradicted

    def without_evidence(self) -> ScaleDrift:
        """Return the drift as one that is neither `certain` nor `ambiguous`."""
        return replace(self, p_steady=1.0, p_neither=1.0)

    def indistinct_from_width(self) -> ScaleDrift:
        """Return the drift as one that a widening pipe explains equally well."""
        return replace(self, p_steady=1.0, p_even=1.0)

    @property
    def may_be_steady(self) -> bool:
        """Whether the scale may have been steady all the same."""
        return self.p_steady > _CONFIRMED_P

    @property
    def change(self) -> float:
        """Return the relative change of the scale from first to last."""
        return float(self.at_frames[-1] - self.at_frames[0])

    @property
    def large(self) -> bool:
        """Whether it exceeds the change of a lens that warms up."""
        return float(np.ptp(self.at_frames)) > _LARGE

    @property
    def ambiguous(self) -> bool:
        """Whether the rings change, and a drifting lens and a widening pipe explain it equally well."""
        return (
            not (self.certain or self.contradicted) and self.p_neither < _SURE_P and self.p_even > _MAY_BE_P
        )

    @property
    def offset_sigma(self) -> float:
        """Return the relative 1 σ of the mean scale: the calibration may belong to any part of the course."""
        return float(np.abs(self.at_frames).max())

    @property
    def stated_sigma(self) -> Float:
        """Return the relative 1 σ (N,) of the scale for the σ of radii."""
        if self.certain or self.contradicted:
            own = np.hypot(self.sigma, _OTHER_CAUSE * self.at_frames)
            return np.asarray(np.hypot(own, self.offset_sigma))
        return np.abs(self.alone) if self.ambiguous else np.zeros_like(self.alone)

    def warn(self, context: Context, corrected: bool) -> None:
        """Warn of a scale that drifts, or of rings that may change because of it."""
        if self.certain:
            context.warn(self._words(corrected))
        elif self.by_encoder:
            context.warn(
                "encoder and rings contradict each other along the run: either the picture's scale drifts by "
                f"{100 * float(np.ptp(self.at_frames)):.2f} %, or the encoder's does, because its wheel "
                "creeps or its clock is not that of the pictures. The pictures alone do not show which. "
                "Nothing is corrected: σ of the radii includes it. What to do: compare the clocks of "
                "encoder.csv and frames.csv, clean the wheel, measure the diameters at both ends"
            )
        elif self.contradicted:
            context.warn(
                f"it seems that {self._what}. But texture and rings do not agree, as with a noise filter "
                "that makes texture lag behind the wall, or with water on the window. Nothing is corrected: "
                "σ of the radii includes it. What to do: switch off noise reduction, dry the window, let the "
                "probe warm up, or measure the diameters at both ends"
            )
        elif self.ambiguous and (widest := float(np.ptp(self.alone) * abs(self.ring_mm))) > self.stated_mm:
            context.warn(
                f"the radius of the rings changes by {widest:.2f} mm over the run. Either the pipe's does, "
                f"or the picture's scale drifts by {100 * np.ptp(self.alone):.2f} % (a lens that warms up): "
                "there is too little texture to decide. σ of the radii includes it. What to do: let the "
                "probe warm up, record back and forth, use an encoder, or measure the diameters at both ends"
            )

    @property
    def _what(self) -> str:
        course = float(np.ptp(self.at_frames))
        return (
            f"the picture {'grows' if self.change > 0 else 'shrinks'} by {100 * course:.2f} % over the run: "
            f"the rings' radius changes by {abs(course * self.ring_mm):.2f} mm, and the texture does not "
            "follow"
        )

    def _words(self, corrected: bool) -> str:
        if self.large:
            return (
                f"it seems that {self._what}. No lens changes so much by warming up: zoom or stabilisation "
                "is on, the laser is loose, or the pipe's filling (water) or the probe is not as stated. "
                "This is not corrected: radii and distances may be wrong by more than their σ. What to do: "
                "check the pictures and the probe file, run boresight diagnose"
            )
        outcome = (
            "This is corrected in motion and radii, and their σ includes the rest"
            if corrected
            else "Runs of this length are not corrected: radii and distances may err by more than their σ"
        )
        return (
            f"{self._what}. The lens warms up or is loose, the laser moves in its mount, or zoom or "
            f"stabilisation is on. {outcome}. What to do: let the probe warm up before the run, fix lens and "
            "laser, switch off zoom and stabilisation"
        )


def drift_of_scale(estimate: Estimate, measured: Measurements, before: Float | None = None) -> ScaleDrift:
    """Return the course of the image scale at an estimate; ``before`` (N,) is already corrected in it."""
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
    projected = measured.tracks.uv + texture.residual  # the match's own noise would bias the scale
    away_px = projected - measured.camera_at(state).centre_px
    away_px = away_px * np.asarray(texture.by_pose.any((1, 2)))[:, None]
    by_scale = away_px[:, :, None] * course[measured.tracks.frame][:, None, :]
    widths, landmarks = width.shape[1], width[count:]
    pixels = np.concatenate([np.zeros((*away_px.shape, widths)), by_scale], 2)
    surface = np.concatenate([-landmarks, np.zeros((len(landmarks), _COURSE))], 1)
    sigma = _LARGEST * np.r_[np.full(widths, state.nominal_radius_mm), np.ones(_COURSE)]
    return ExtraColumns(in_rings, pixels, surface, sigma)


def _ring_gain(rings: RingsInPipe, state: State, measured: Measurements) -> tuple[Float, float]:
    """Return derivatives of the rings' residuals (M,) by the image scale, and that of the mean radius, mm."""
    camera = measured.camera_at(state)
    radius_px = np.linalg.norm(camera.project(rings.xyz_c).uv - camera.centre_px, axis=1)
    gain = np.einsum("mi,mi->m", rings.normal_c, measured.rings.by_pixel) * radius_px
    gain = np.where(np.isfinite(gain), gain, 0.0)
    return -gain, float(np.median(gain)) if gain.size else 0.0


def _widths(at_mm: Float, bore: Bore) -> Float:
    """Return basis functions (M, 4 + steps) of the width at distances (M,): smooth, and one per step."""
    steps = (at_mm[:, None] > bore.at_mm).astype(float)
    return np.concatenate([_polynomials(at_mm, _WIDTH), steps], 1)


def _polynomials(at: Float, degree: int) -> Float:
    """Return Legendre's polynomials (M, degree) from degree 1 on, over the range of ``at`` (M,)."""
    x = 2 * (at - at.min()) / max(float(np.ptp(at)), 1e-9) - 1
    return np.asarray(legendre.legvander(x, degree)[:, 1:])
