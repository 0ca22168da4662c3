"""A sinusoid among the slow wander of a towed probe."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Float

# Below this frequency the wander of a towed probe itself contains spectral lines. Debt: data/debts.md.
SLOWEST_HZ = 1.5
_WANDER_HZ = 1.2
LEAST_SAMPLES = 48


def shows_apart(time_s: Float, frequency: float) -> bool:
    """Return whether pictures at these times show the frequency apart from the probe's wander."""
    rate = 1 / float(np.median(np.diff(time_s)))
    alias = abs(frequency - rate * round(frequency / rate))
    return bool(alias > SLOWEST_HZ or frequency < rate / 2)


def amplitudes(
    time_s: Float, xy_mm: Float, frequency: float, start_s: float | None = None
) -> tuple[Float, float]:
    """Return amplitudes (2, 2) along x and y of sine and cosine, wander taken out, and their 1 σ.

    Phases count from ``start_s``, else from the first picture.
    """
    t = time_s - (time_s[0] if start_s is None else start_s)
    line = [np.sin(2 * np.pi * frequency * t), np.cos(2 * np.pi * frequency * t)]
    design = np.concatenate([np.stack(line, 1), wander(time_s)], 1)
    if len(t) < 1.3 * design.shape[1]:
        return np.full((2, 2), np.nan), float("nan")
    solution = np.linalg.lstsq(design, xy_mm, rcond=1e-6)[0]
    left = xy_mm - design @ solution
    noise = float(np.sqrt(np.mean(left**2) * len(t) / (len(t) - design.shape[1])))
    return np.asarray(solution[:2].T), noise * float(np.sqrt(2 / len(t)))


def wander(time_s: Float) -> Float:
    """Return (N, K) columns of whatever changes more slowly than lines are looked for."""
    span = float(time_s[-1] - time_s[0])
    t = time_s - time_s[0]
    phase = np.pi / span * np.arange(1, int(2 * span * _WANDER_HZ) + 1) * t[:, None]
    return np.concatenate([np.stack([np.ones_like(t), t / span], 1), np.cos(phase), np.sin(phase)], 1)
