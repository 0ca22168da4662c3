"""Compares the encoder's scale from rings and texture with the stated one."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.adjustment.robust import spread_about_median
from pipeline.geometry.axis import distance_along
from pipeline.machine.stage import Context
from stages.motion.bundle_adjustment.equations import Measurements
from stages.motion.bundle_adjustment.solver import Estimate
from stages.motion.bundle_adjustment.unknowns import ENCODER_SCALE

_TOO_FAR = 4.0
"""Difference, in σ, from which the encoder's scale counts as wrong: by chance once in 16 000 recordings. A
smaller one shifts distances by 4 σ_pictures² / σ_encoder at most: .15 % at .09 and .2 %."""
_DOUBTFUL, _SERIOUS = 3.0, 5.0
"""Differences, in σ, from which texture that was mostly lost widens the σ of distances, and from which there
is a warning (chosen): by chance once in 370 and once in 1.7 million recordings."""
_TELLS_NOTHING = 10.0
"""If texture's σ is this many times the encoder's, a contradiction of 3 to 5 σ moves distances by half of the
encoder's σ at most, namely by 3 to 5 / √(1 + 10²) of it."""
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
    """

    scale: float
    sigma: float
    stated_sigma: float
    lost_in_sigma: float = 0.0

    @property
    def in_sigma(self) -> float:
        """Return the difference from 1 in σ."""
        return abs(self.scale - 1) / float(np.hypot(self.sigma, self.stated_sigma))

    @property
    def contradicted(self) -> bool:
        """Whether the pictures contradict the stated scale."""
        return self.in_sigma > _TOO_FAR

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
        return replace(self, sigma=float(np.hypot(self.sigma, abs(self.scale - 1))))

    def warn(self, context: Context, wider: float) -> None:
        """Warn of an encoder that the pictures contradict; ``wider``: diameter over the nominal, minus 1."""
        if self.lost_in_sigma > _SERIOUS:
            self._warn_beside_lost_texture(context)
        if not self.contradicted:
            return
        more = "more" if self.scale < 1 else "less"
        context.warn(
            f"the encoder shows {100 * abs(1 / self.scale - 1):.2f} % {more} than laser and texture do "
            f"({self.in_sigma:.0f} σ): its wheel, unit or clock is not as stated, and distances are based on "
            "baseline and camera instead. If the probe is wrong and the encoder right, distances and "
            f"radii are wrong by as much{self._diameter_evidence(wider)}. What to do: measure the wheel and "
            "compare the clocks of encoder.csv and frames.csv; compare the diameter with a known one"
        )

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


def scale_of_encoder(estimate: Estimate, measured: Measurements, unsure: float) -> EncoderScale | None:
    """Return the encoder's scale from the other measurements of an estimate; None without encoder.

    ``unsure`` is the relative 1 σ of distances by texture that its residuals do not show.
    """
    if measured.encoder is None:
        return None
    stated = measured.probe.encoder_scale_sigma
    variance = float(estimate.factor.border_covariance()[ENCODER_SCALE, ENCODER_SCALE])
    information = max(1 / variance - stated**-2, 1e-6 * stated**-2)
    off = (float(estimate.state.globals[ENCODER_SCALE]) - 1) / variance / information
    return EncoderScale(1 + off, float(np.hypot(information**-0.5, unsure)), stated)


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
