"""Simulated distances of a probe that drives forth and back, and of an encoder with or without faults."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Float
from pipeline.recording.base import Encoder
from stages.diagnose.travel.sight import Sight

QUANTUM_MM = 0.05
SECONDS = 8.0
EASING_S = np.linspace(-0.1, 0.1, 21)


def way(time_s: Float, reverses: bool = True) -> Float:
    """Return distances.

    Forward at 25 to 35 mm/s, in one case back at 18 mm/s and forward again, without jerks.
    """
    knots = [0.0, 1.5, 3.0, 3.6, 5.0, 6.5, 9.0]
    speed = [28.0, 35.0, 25.0, -18.0, 22.0, 30.0] if reverses else [17.0, 19.0, 16.5, 18.0, 19.0, 17.0]
    at = np.concatenate([[0.0], np.cumsum(np.diff(knots) * speed)])
    return np.mean([np.interp(time_s + shift, knots, at) for shift in EASING_S], axis=0)


def seen(
    random: np.random.Generator, reverses: bool = True, drift_mm: float = 0.004, every: int = 2
) -> Sight:
    """Return the distances as estimated from pictures.

    With white noise and a drift that grows with the distance.
    """
    time_s = np.arange(0, SECONDS, every / 30)
    true = way(time_s, reverses)
    path = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(true)))])
    steps = np.sqrt(np.diff(path, prepend=0.0)) * random.standard_normal(len(path))
    found = true + drift_mm * np.cumsum(steps) + 0.002 * random.standard_normal(len(path))
    frame = np.arange(len(time_s)) * every
    return Sight(frame, time_s, found, path, 3e-4, 1 / 30)


def read(
    reverses: bool = True, scale: float = 0.0, delay_s: float = 0.0, play_mm: float = 0.0,
    slips: tuple[tuple[float, float], ...] = (),
) -> Encoder:  # fmt: skip
    """Return the encoder's readings; a slip is a time and the distance by which the reading changes then."""
    time_s = np.arange(-0.02, SECONDS + 0.2, 0.01)
    true = way(time_s - delay_s, reverses)
    lag, behind = np.zeros(len(true)), -play_mm / 2
    for k, step in enumerate(np.diff(true, prepend=true[0])):
        behind = min(max(behind - step, -play_mm / 2), play_mm / 2)
        lag[k] = behind
    gained = sum(size * (time_s > at) for at, size in slips)
    reading = (1 + scale) * true + lag + gained
    return Encoder(time_s, QUANTUM_MM * np.round(reading / QUANTUM_MM))
