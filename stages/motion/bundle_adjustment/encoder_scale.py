"""Compares the encoder's scale from rings and texture with the stated one."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.adjustment.robust import Cauchy, spread_about_median
from pipeline.arrays import Float
from pipeline.geometry.axis import distance_along
from pipeline.machine.stage import Context
from stages.motion.bundle_adjustment.equations import Measurements
from stages.motion.bundle_adjustment.solver import Estimate
from stages.motion.bundle_adjustment.unknowns import ENCODER_SCALE
from stages.motion.encoder import EncoderReadings

_TOO_FAR = 4.0
"""Difference, in σ, from which the encoder's scale counts as wrong: by chance once in 16 000 recordings. A
smaller one shifts distances by 4 σ_pictures² / σ_encoder at most: .15 % at .09 and .2 %."""
_DOUBTFUL, _SERIOUS = 3.0, 5.0
"""Differences, in σ, from which texture that was mostly lost widens the σ of distances, and from which there
is a warning (chosen): by chance once in 370 and once in 1.7 million recordings. Other texture is warned of
from the first on."""
_TELLS_NOTHING = 10.0
"""If texture's σ is this many times the encoder's, a contradiction of 3 to 5 σ moves distances by half of the
encoder's σ at most, namely by 3 to 5 / √(1 + 10²) of it."""
_STRETCHES, _FEWEST_STEPS = 4, 5
"""Stretches of a run whose scales are compared (chosen: creep over a quarter of the run shifts distances by a
quarter of its rate), and steps that each must have."""
_ROUNDS = 10
_ALIKE = 2.0
"""Factor within which errors of diameter and distance agree. A zoomed picture changes radii by θ / sin θ cos
θ times as much, 3.0 at 65°, and distances by about as much: 2.6 and 2.0 % for 1 % of zoom (open-1-field)."""


@dataclass(frozen=True)
class EncoderScale:
    """Distance per reading from rings and texture without the stated scale; 1 if the encoder is right.

    Attributes
    ----------
    scale, sigma : float
        Scale and its 1 σ.
    stated_sigma : float
        1 σ of the scale that the probe file states.
    lost_in_sigma : float
        Difference of the scale from 1, in σ, by texture that was mostly lost, before its σ was widened; 0
        for other texture.
    uneven : float
        Rms difference of the scale between stretches of the run.
    """

    scale: float
    sigma: float
    stated_sigma: float
    lost_in_sigma: float = 0.0
    uneven: float = 0.0

    @property
    def in_sigma(self) -> float:
        """Return the difference from 1 in σ."""
        return abs(self.scale - 1) / float(np.hypot(self.sigma, self.stated_sigma))

    @property
    def contradicted(self) -> bool:
        """Whether the pictures contradict the stated scale."""
        return self.in_sigma > _TOO_FAR

    @property
    def doubt(self) -> float:
        """Return the relative 1 σ of distances for an encoder, or pictures, off by more than their σ.

        If both differ by more than their σ, either may be wrong: the σ of their weighted mean is widened by
        the ratio (R. T. Birge, "The calculation of errors by the method of least squares", 1932). An encoder
        whose scale changes over the run shows no scale better than it changes. Once the pictures contradict
        the encoder, it has lost its weight.
        """
        if self.contradicted:
            return self.uneven
        of_mean = self.sigma * self.stated_sigma / float(np.hypot(self.sigma, self.stated_sigma))
        beyond = float(np.sqrt(max(self.in_sigma**2 - 1, 0.0)))
        return float(np.hypot(of_mean * beyond, self.uneven))

    @property
    def doubted(self) -> bool:
        """Whether texture, if much of it was lost, still contradicts enough to widen the σ of distances."""
        tells = self.sigma < _TELLS_NOTHING * self.stated_sigma
        return self.in_sigma > (_DOUBTFUL if tells else _SERIOUS)

    def beside_lost_texture(self) -> EncoderScale:
        """Return the scale without weight of texture; ``lost_in_sigma`` records the contradiction."""
        return replace(self.without_trust_in_texture(), lost_in_sigma=self.in_sigma)

    def without_trust_in_texture(self) -> EncoderScale:
        """Return the scale with a σ as large as the difference between texture and encoder."""
        return replace(self, sigma=float(np.hypot(self.sigma, abs(self.scale - 1))), uneven=0.0)

    def warn(self, context: Context, wider: float) -> None:
        """Report by how much encoder and pictures differ, and warn of an encoder that these contradict.

        ``wider`` is the diameter over the nominal one, minus 1. A difference of 2 σ, as one in 22 good
        recordings has, is reported alone.
        """
        one_sigma = float(np.hypot(self.sigma, self.stated_sigma))
        context.report("way by the encoder, more than by laser and texture", 100 * (1 / self.scale - 1), "%")
        context.report("1 σ of that difference", 100 * one_sigma, "%")
        if self.lost_in_sigma > _SERIOUS:
            self._warn_beside_lost_texture(context)
        if self.contradicted:
            self._warn_of_contradiction(context, wider)
        if self.uneven > self.stated_sigma:
            self._warn_of_creep(context)
        elif self.in_sigma > _DOUBTFUL and not self.contradicted:
            self._warn_of_doubt(context)

    def _warn_of_contradiction(self, context: Context, wider: float) -> None:
        context.warn(
            f"the encoder shows {self._difference} than laser and texture do "
            f"({self.in_sigma:.0f} σ): its wheel, unit or clock is not as stated, and distances are based on "
            "baseline and camera instead. If the probe is wrong and the encoder right, distances and "
            f"radii are wrong by as much{self._diameter_evidence(wider)}. What to do: measure the wheel and "
            "compare the clocks of encoder.csv and frames.csv; compare the diameter with a known one"
        )

    def _warn_of_creep(self, context: Context) -> None:
        context.warn(
            f"by the wall's texture the encoder's scale differs by {100 * self.uneven:.2f} % (1 σ) "
            f"between stretches of the run, more than the {100 * self.stated_sigma:.2f} % by which it may "
            "be wrong as a whole: the wheel creeps, follows the outer or inner wall of a bend, or its clock "
            "is not that of the pictures. σ of distances includes it. What to do: clean the wheel and press "
            "it to the wall, compare the clocks of encoder.csv and frames.csv, compare the distance with a "
            "known one"
        )

    def _warn_of_doubt(self, context: Context) -> None:
        context.warn(
            f"the encoder shows {self._difference} than laser and texture do ({self.in_sigma:.1f} σ): either "
            "this is chance, or the scale of the encoder or the probe is wrong by more than its σ. This run "
            "does not show which: distances lie between the two, and their σ includes the difference. What "
            "to do: measure the wheel, compare the distance with a known one, record a longer run"
        )

    @property
    def _difference(self) -> str:
        more = "more" if self.scale < 1 else "less"
        return f"{100 * abs(1 / self.scale - 1):.2f} % {more}"

    def _warn_beside_lost_texture(self, context: Context) -> None:
        context.warn(
            f"encoder and pictures differ by {100 * abs(1 / self.scale - 1):.1f} % "
            f"({self.lost_in_sigma:.0f} σ), and the pictures show too little texture to decide between them: "
            "distances follow the encoder, and their σ includes the difference. What to do: check the "
            "encoder's wheel and unit"
        )

    def doubt_of_probe(self, wider: float) -> float:
        """Return the relative 1 σ to add to radii and distances for a probe that may be wrong, or 0.

        A wrong probe scales the pipe's diameter and the distance by the same factor. If the diameter exceeds
        the nominal one by the same share (``wider``) as the encoder's scale is off, the encoder may be right.
        """
        alike = self.contradicted and 1 / _ALIKE < wider / (self.scale - 1) < _ALIKE
        return abs(self.scale - 1) if alike else 0.0

    def _diameter_evidence(self, wider: float) -> str:
        """Return the evidence of the stated diameter on whether probe or encoder is wrong."""
        if not self.doubt_of_probe(wider):
            return "; this recording cannot show which is right"
        larger = "wider" if wider > 0 else "narrower"
        return (
            f". The measured diameter is also {100 * abs(wider):.1f} % {larger} than the stated one, which "
            "suggests that the probe is wrong: another camera or laser, or scaled or cropped pictures. The σ "
            "of radii and distances includes this"
        )


def scale_of_encoder(
    estimate: Estimate, measured: Measurements, unsure: float, creep_mm: float
) -> EncoderScale | None:
    """Return the encoder's scale from the other measurements of an estimate; None without encoder or texture.

    Rings of an even pipe do not show distance: without a landmark, priors of the motion gave a scale of .003
    ± .18, so that distances beside a right encoder had a σ as large as themselves.
    ``unsure`` is the relative 1 σ of distances by texture that its residuals do not show; ``creep_mm`` is the
    1 σ of the encoder's creep from frame to frame.
    """
    if measured.encoder is None or not len(measured.tracks.landmark):
        return None
    stated = measured.probe.encoder_scale_sigma
    variance = float(estimate.factor.border_covariance()[ENCODER_SCALE, ENCODER_SCALE])
    information = max(1 / variance - stated**-2, 1e-6 * stated**-2)
    off = (float(estimate.state.globals[ENCODER_SCALE]) - 1) / variance / information
    sigma = float(np.hypot(information**-0.5, unsure))
    uneven = uneven_scale(estimate.state.slip, measured.encoder, creep_mm)
    return EncoderScale(1 + off, sigma, stated, uneven=uneven)


def uneven_scale(slip: Float, encoder: EncoderReadings, creep_mm: float) -> float:
    """Return the rms difference of the scale between stretches of a run by its slip (N,), beyond usual creep.

    The scale of a stretch is that of most of its steps: sudden slips do not count. Usual creep is a random
    walk of ``creep_mm`` from frame to frame.
    """
    step, read = np.diff(slip), np.diff(encoder.distance_mm)
    used = np.flatnonzero(encoder.known[1:] & encoder.known[:-1] & (read != 0))
    if len(used) < _STRETCHES * _FEWEST_STEPS:
        return 0.0
    parts = np.array_split(used, _STRETCHES)
    scale = np.array([_scale_of(step[k], read[k], creep_mm) for k in parts])
    usual = creep_mm**2 * np.mean([1 / (read[k] @ read[k]) for k in parts])
    return float(np.sqrt(max(np.var(scale, ddof=1) - usual, 0.0)))


def _scale_of(step: Float, read: Float, creep_mm: float) -> float:
    """Return the scale by which most steps (K,) of the slip follow those of the readings."""
    scale, one = 0.0, np.ones_like(step)
    for _ in range(_ROUNDS):
        weight = Cauchy().weight((step - scale * read) / creep_mm, one)
        scale = float((weight * read) @ step / ((weight * read) @ read))
    return scale


def noise_of_encoder(estimate: Estimate, measured: Measurements) -> float:
    """Return the 1 σ, mm, of the difference of readings and an estimate; 0 without encoder.

    It exceeds the rounding if frames are stamped with random delays, or the wheel shakes.
    """
    encoder, state = measured.encoder, estimate.state
    if encoder is None or not encoder.known.any():
        return 0.0
    distance = distance_along(state.axis, state.T_pc)
    off = distance - state.globals[ENCODER_SCALE] * encoder.distance_mm - state.slip
    return spread_about_median(off[encoder.known])
