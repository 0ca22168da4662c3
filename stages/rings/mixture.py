"""The mixture of a picture's channels in which the line's place is known best where the wall is lit, too."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Byte, Float, Float32
from pipeline.artefacts.measured import RingValidity
from pipeline.instrument.probe import Probe
from stages.rings.noise import QUANTISATION_VARIANCE, SURELY_UNCLIPPED
from stages.rings.sectors import Sectors
from stages.rings.trace import RingTrace, trace_ring

_BLUE_GREEN_NM, _GREEN_RED_NM = 490.0, 580.0
# Samples across the line, in its widths: bell and straight background are told apart by both flanks.
_ACROSS = np.arange(-3.0, 3.1, 0.5)
_BESIDE = np.array([-7.0, -5.5, -4.0, 4.0, 5.5, 7.0])  # the same on the wall beside the line
_MOST = 0.5
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


def mix(bgr: Byte, weights: Float) -> Float32:
    """Return the (H, W) mixture of an image (H, W, 3)."""
    return np.asarray(bgr @ weights.astype(np.float32), np.float32)


def first_weights(bgr: Byte, sectors: Sectors, probe: Probe) -> Float:
    """Return weights learned from an image in which the ring is found by the laser's colour alone."""
    weights = excess_weights(probe.laser.wavelength_nm)
    trace = trace_ring(mix(bgr, weights), sectors, np.inf)
    return weights if trace is None else line_weights(bgr, sectors, trace, weights)


def line_weights(bgr: Byte, sectors: Sectors, trace: RingTrace, otherwise: Float) -> Float:
    """Return (3,) weights of the mixture in which a line is displaced least; ``otherwise`` if none shows it.

    A line of mean height h (3,) appears displaced by w·d / w·h where the channels lean by d (3,) at its
    place, and w ∝ cov(d)⁻¹ h makes the variance of that smallest (Fisher's discriminant). Texture, noise and
    colours that a codec stores coarsely all lean at the line itself; beside it, the last do not show. The
    channels lean together, by d ∝ h, where the line leaves the smooth course about which they are sampled:
    that does not change w. They must not be sampled about the traced line: with its own weights, w·d is zero
    there. A clipped line does not lean; where most of it clips, the wall's colours beside it stand for d.
    Weights are scaled so that the line keeps its height in the strongest channel.
    """
    traced, width = trace.radius_everywhere(), trace.width_px
    course = _smooth(traced)
    near = (trace.validity == RingValidity.VALID) & (np.abs(traced - course) < width)
    colours = across_line(bgr, sectors, course, _ACROSS * width)[near]
    if not len(colours):
        return otherwise
    height, lean = np.einsum("km,amc->kac", _BELL_AND_LEAN, colours)
    unclipped = (colours <= SURELY_UNCLIPPED * np.iinfo(bgr.dtype).max).all((1, 2))
    noise = float(_BELL_AND_LEAN[1] @ _BELL_AND_LEAN[1]) * QUANTISATION_VARIANCE * np.eye(3)
    if unclipped.mean() > _MOST:
        noise += lean[unclipped].T @ lean[unclipped] / unclipped.sum()
    else:
        noise += np.cov(across_line(bgr, sectors, traced, _BESIDE * width)[near].reshape(-1, 3).T)
    rise = height.mean(0)
    weights = np.linalg.solve(noise, rise)
    gain = float(weights @ rise / rise.max())
    return weights / gain if gain > 0 else otherwise


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
