"""Mixtures of a picture's channels in which the line is found, and placed, where the wall is lit, too."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Byte, Float
from pipeline.artefacts.measured import RingValidity
from stages.rings.noise import QUANTISATION_VARIANCE, SURELY_UNCLIPPED
from stages.rings.search import BAND_WIDTHS
from stages.rings.sectors import Sectors
from stages.rings.trace import RingTrace

_BLUE_GREEN_NM, _GREEN_RED_NM = 490.0, 580.0
_LINE_WIDTHS, _WALL_WIDTHS = 0.7, 4.0
# Samples across the line, in its widths: bell and straight background are told apart by both flanks. They
# are used where most of the ring does not clip.
_ACROSS, _MOST = np.arange(-3.0, 3.1, 0.5), 0.5
# Waves of the ring's smooth course: with 4 or 20 the samples of open-3 scatter by .186 and .193 px for .184
# as it is, and by .155 and .173 for .157 at half size and crf 30.
_WAVES = 8


def excess_weights(wavelength_nm: float) -> Float:
    """Return (3,) B, G, R weights: the channel nearest to the laser's wavelength minus half of the others."""
    weights = np.full(3, -0.5)
    weights[channel_of(wavelength_nm)] = 1.0
    return weights


def channel_of(wavelength_nm: float) -> int:
    """Return the channel, of blue, green and red, nearest to a wavelength."""
    return 0 if wavelength_nm < _BLUE_GREEN_NM else 1 if wavelength_nm < _GREEN_RED_NM else 2


def wall_weights(bgr: Byte, sectors: Sectors, trace: RingTrace, otherwise: Float) -> Float:
    """Return (3,) weights of the mixture in which the line stands out best from the wall beside it.

    Fisher's discriminant of line and wall; ``otherwise`` if they do not differ in colour. The ring is found
    in this mixture, because bright bands of wall do not show in it.
    """
    radius, width = trace.radius_everywhere(), trace.width_px
    line, _ = sectors.colours_near(bgr, radius, 0, _LINE_WIDTHS * width)
    wall, spread = sectors.colours_near(bgr, radius, _WALL_WIDTHS * width, BAND_WIDTHS * width)
    weights = _discriminant(spread, line - wall)
    return otherwise if weights is None else weights


def line_weights(bgr: Byte, sectors: Sectors, trace: RingTrace) -> Float | None:
    """Return (3,) weights of the mixture in which the line is displaced least; None if it clips.

    A line of mean height h (3,) appears displaced by w·d / w·h where the channels lean by d (3,) at its
    place, and w ∝ cov(d)⁻¹ h makes the variance of that smallest. Colours that a codec stores coarsely lean
    at the line, but beside it they are quiet. The channels lean together, by d ∝ h, where the line leaves
    the smooth course about which they are sampled: that does not change w. They must not be sampled about the
    traced line: in the mixture in which it was traced, it leans nowhere.
    """
    traced, width = trace.radius_everywhere(), trace.width_px
    course = _smooth(traced)
    near = (trace.validity == RingValidity.VALID) & (np.abs(traced - course) < width)
    colours = across_line(bgr, sectors, course, _ACROSS * width)
    near &= (colours <= SURELY_UNCLIPPED * np.iinfo(bgr.dtype).max).all((1, 2))
    if near.mean() < _MOST:
        return None
    height, lean = np.einsum("km,amc->kac", _BELL_AND_LEAN, colours[near])
    return _discriminant(lean.T @ lean / len(lean), height.mean(0))


def _discriminant(noise: Float, rise: Float) -> Float | None:
    """Return weights for a ``rise`` (3,) in noise of covariance (3, 3); None if none of them shows it.

    They are scaled so that the line keeps its height in the strongest channel.
    """
    weights = np.linalg.solve(noise + QUANTISATION_VARIANCE * np.eye(3), rise)
    gain = float(weights @ rise / rise.max())
    return np.asarray(weights / gain, float) if gain > 0 else None


def _smooth(radius_px: Float) -> Float:
    """Return the slow waves of a ring (A,)."""
    waves = np.fft.rfft(radius_px)
    waves[_WAVES + 1 :] = 0
    return np.asarray(np.fft.irfft(waves, len(radius_px)))


def across_line(bgr: Byte, sectors: Sectors, radius_px: Float, across_px: Float) -> Byte:
    """Return the pixels (A, M, 3) nearest to places ``across_px`` (M,) beside a ring (A,)."""
    radius, psi = radius_px[:, None] + across_px, sectors.azimuth_rad[:, None]
    most = np.array(sectors.image_size) - 1
    u, v = (
        np.clip(np.rint(c + radius * f(psi)), 0, m).astype(int)
        for c, f, m in zip(sectors.centre_px, (np.cos, np.sin), most, strict=True)
    )
    return np.asarray(bgr[v, u])


def _bell_and_lean() -> Float:
    """Return (2, M) what turns M samples into the height of a bell and into how far it leans.

    Least squares with a straight background; a line displaced by a small share of its width leans by that
    share of its height.
    """
    bell = np.exp(-(_ACROSS**2) / 2)
    design = np.stack([bell, bell * _ACROSS, np.ones_like(bell), _ACROSS], 1)
    return np.linalg.pinv(design)[:2]


_BELL_AND_LEAN = _bell_and_lean()
