"""The encoder's scale by rings and texture, compared with the stated one."""

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
"""Differences, in σ, from which the encoder's scale was not as stated: by chance once in 16 000 recordings.
A smaller one draws distances by 4 σ_pictures² / σ_encoder at most: .15 % at .09 and .2 %."""
_DOUBTFUL, _SERIOUS = 3.0, 5.0
"""Differences, in σ, from which texture that was much lost makes distances unsure, and from which that is
told (chosen): by chance once in 370 and once in 1.7 million recordings."""
_TELLS_NOTHING = 10.0
"""If texture's σ is so many times the encoder's, a contradiction of 3 to 5 σ moves distances by half of the
encoder's σ at most, namely by 3 to 5 / √(1 + 10²) of it."""
_ALIKE = 2.0
"""Factor within which diameter and way err alike. A zoomed picture changes radii by θ / sin θ cos θ times as
much, 3.0 at 65°, and ways by about as much as radii: 2.6 and 2.0 % for 1 % of zoom (open-1-field)."""


@dataclass(frozen=True)
class EncoderScale:
    """Distance per reading, 1 where the encoder is right, by rings and texture without the stated scale.

    Attributes
    ----------
    scale, sigma : float
        With its 1 σ.
    stated_sigma : float
        1 σ that the probe's file states about 1.
    lost_in_sigma : float
        Difference from 1 in σ by texture that was much lost, before it was distrusted; 0 by other texture.
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
        """Whether texture, if much of it was lost, still tells enough to make distances unsure."""
        tells = self.sigma < _TELLS_NOTHING * self.stated_sigma
        return self.in_sigma > (_DOUBTFUL if tells else _SERIOUS)

    def beside_lost_texture(self) -> EncoderScale:
        """Return the scale without trust in texture; ``lost_in_sigma`` records how far texture was off."""
        return replace(self.without_trust_in_texture(), lost_in_sigma=self.in_sigma)

    def without_trust_in_texture(self) -> EncoderScale:
        """Return the scale with a σ as large as the difference between texture and encoder."""
        return replace(self, sigma=float(np.hypot(self.sigma, abs(self.scale - 1))))

    def warn(self, context: Context, wider: float) -> None:
        """Warn of an encoder that the pictures contradict, in a pipe ``wider`` than nominal by that share."""
        if self.lost_in_sigma > _SERIOUS:
            self._warn_beside_lost_texture(context)
        if not self.contradicted:
            return
        more = "more" if self.scale < 1 else "less"
        context.warn(
            f"the encoder shows {100 * abs(1 / self.scale - 1):.2f} % {more} than laser and texture do "
            f"({self.in_sigma:.0f} σ): its wheel, unit or clock is not as stated, and distances rest on "
            "baseline and camera instead. If the probe is wrong and the encoder right, distances and "
            f"radii would be wrong by as much{self._witness(wider)}. What to do: measure the wheel and "
            "compare the clocks of encoder.csv and frames.csv; compare the diameter with one that is known"
        )

    def _warn_beside_lost_texture(self, context: Context) -> None:
        context.warn(
            f"encoder and pictures differ by {100 * abs(1 / self.scale - 1):.1f} % "
            f"({self.lost_in_sigma:.0f} σ), and the pictures show too little texture to tell which is right: "
            "distances follow the encoder, and their σ holds the difference. What to do: check the encoder's "
            "wheel and unit"
        )

    def doubt_of_probe(self, wider: float) -> float:
        """Return the relative 1 σ to add to radii and distances for a probe that may be wrong; 0 for none.

        A wrong probe scales the pipe's diameter and the distance by the same factor. Where the pipe comes out
        ``wider`` than nominal, as a share, by what the encoder is off, the encoder may be the one that is
        right.
        """
        alike = self.contradicted and 1 / _ALIKE < wider / (self.scale - 1) < _ALIKE
        return abs(self.scale - 1) if alike else 0.0

    def _witness(self, wider: float) -> str:
        """Return what the stated diameter adds to the question whether probe or encoder is wrong."""
        if not self.doubt_of_probe(wider):
            return "; this recording cannot tell"
        larger = "wider" if wider > 0 else "narrower"
        return (
            f". The pipe comes out {100 * abs(wider):.1f} % {larger} than its stated diameter as well, which "
            "suggests that the probe is wrong: another camera or laser, or scaled or cropped pictures. The σ "
            "of radii and distances includes this"
        )


def scale_of_encoder(estimate: Estimate, measured: Measurements, unsure: float) -> EncoderScale | None:
    """Return the encoder's scale by the other measurements of an estimate; None without encoder.

    ``unsure`` is the relative 1 σ of distances by texture that its residuals do not show.
    """
    if measured.encoder is None:
        return None
    stated = measured.probe.encoder_scale_sigma
    variance = float(estimate.factor.border_covariance()[ENCODER_SCALE, ENCODER_SCALE])
    told = max(1 / variance - stated**-2, 1e-6 * stated**-2)
    off = (float(estimate.state.globals[ENCODER_SCALE]) - 1) / variance / told
    return EncoderScale(1 + off, float(np.hypot(told**-0.5, unsure)), stated)


def noise_of_encoder(estimate: Estimate, measured: Measurements) -> float:
    """Return the 1 σ, mm, by which readings differ from an estimate; 0 without encoder.

    Where frames are stamped late by chance, or the wheel shakes, it is more than the rounding.
    """
    encoder, state = measured.encoder, estimate.state
    if encoder is None or not encoder.known.any():
        return 0.0
    distance = distance_along(state.axis, state.T_pc)
    off = distance - state.globals[ENCODER_SCALE] * encoder.distance_mm - state.slip
    return spread_about_median(off[encoder.known])
