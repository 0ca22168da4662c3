"""An oscillation of the camera estimated from disjoint pictures: early and late ones, lit and laser ones."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Bool, Float
from stages.diagnose.agreement import Agreement, Part, agreement
from stages.diagnose.travel.wave import LEAST_SAMPLES, amplitudes, shows_apart


def swing_agreements(time_s: Float, xy_mm: Float, lit: Bool, frequency_hz: float) -> tuple[Agreement, ...]:
    """Return whether disjoint pictures show one oscillation: size, direction and phase at its frequency."""
    early = time_s <= (time_s[0] + time_s[-1]) / 2
    pairs = (
        (("first half of the pictures", early), ("second half of the pictures", ~early)),
        (("pictures of the lit wall", lit), ("pictures of the laser's ring alone", ~lit)),
    )
    found = [[_part(time_s, xy_mm, frequency_hz, *p) for p in pair] for pair in pairs]
    each = [_compared(*a, *b) for a, b in found if a is not None and b is not None]
    return tuple(a for a in each if a is not None)


def _part(
    time_s: Float, xy_mm: Float, frequency_hz: float, where: str, use: Bool
) -> tuple[Part, Float] | None:
    """Return what these pictures say, with its covariance (4, 4); None where they do not show the line."""
    t = time_s[use]
    if use.sum() < LEAST_SAMPLES / 2 or not shows_apart(t, frequency_hz):
        return None
    both, sigma = amplitudes(t, xy_mm[use], frequency_hz, float(time_s[0]))
    if not np.isfinite(sigma):
        return None
    size = float(np.linalg.norm(both, 2))
    phase = float(np.degrees(np.arctan2(*np.linalg.svd(both)[2][0][::-1]))) % 180
    words = f"±{size:.4g} mm (± {sigma:.2g} mm) at phase {phase:.0f}° of {frequency_hz:.2f} Hz"
    return Part(where, words, both.ravel()), sigma**2 * np.eye(4)


def _compared(first: Part, own: Float, second: Part, other: Float) -> Agreement | None:
    return agreement(first, second, (own, other), own + other)
