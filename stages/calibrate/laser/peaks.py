"""Gaussian peaks of many profiles at once."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Float

_STEPS = 12
_LARGEST_STEP = np.array([2.0, 0.3])
_LEAST_WIDTH, _WIDEST_SHARE = 0.8, 0.4
_START_WIDTH = 3.0


def fit_peaks(profiles: Float, least_contrast: float) -> Float:
    """Return the places (S,) of the peaks of profiles (S, 2 H + 1), in samples from the middle.

    Least squares of A exp(−(x − c)² / 2w²) + b by Gauss-Newton with A and b solved for at every step
    (variable projection in Kaufman's form). NaN where a profile is not seen whole, its peak is not inside
    the window, or it rises less than ``least_contrast`` times the residuals' 1 σ.
    """
    whole = np.isfinite(profiles).all(1)
    peak = np.full(len(profiles), np.nan)
    if whole.any():
        peak[whole] = _fit(profiles[whole], least_contrast)
    return peak


def _fit(y: Float, least_contrast: float) -> Float:
    half = y.shape[1] // 2
    x = np.arange(-half, half + 1, dtype=float)
    centre, log_width = x[np.argmax(y, 1)], np.full(len(y), np.log(_START_WIDTH))
    for _ in range(_STEPS):
        bell, height, residual = _linear_part(x, y, centre, log_width)
        z = (x - centre[:, None]) * np.exp(-log_width)[:, None]
        by_centre = height[:, None] * bell * z * np.exp(-log_width)[:, None]
        jacobian = _without(np.stack([by_centre, height[:, None] * bell * z * z], -1), bell)
        normal = np.swapaxes(jacobian, 1, 2) @ jacobian + 1e-9 * np.eye(2)
        step = np.linalg.solve(normal, np.swapaxes(jacobian, 1, 2) @ residual[..., None])[..., 0]
        step = np.clip(step, -_LARGEST_STEP, _LARGEST_STEP)
        centre = np.clip(centre + step[:, 0], -half, half)
        log_width = np.clip(log_width + step[:, 1], np.log(_LEAST_WIDTH), np.log(_WIDEST_SHARE * half))
    _, height, residual = _linear_part(x, y, centre, log_width)
    noise = np.sqrt(np.sum(residual**2, 1) / (len(x) - 4))
    good = (height > least_contrast * noise) & (np.abs(centre) < half - np.exp(log_width))
    return np.where(good, centre, np.nan)


def _linear_part(x: Float, y: Float, centre: Float, log_width: Float) -> tuple[Float, Float, Float]:
    """Return the bells (S, X), the best heights (S,) and the residuals (S, X) with the best background."""
    bell = np.exp(-0.5 * ((x - centre[:, None]) * np.exp(-log_width)[:, None]) ** 2)
    varying = bell - bell.mean(1, keepdims=True)
    risen = y - y.mean(1, keepdims=True)
    height = np.sum(varying * risen, 1) / np.maximum(np.sum(varying**2, 1), 1e-12)
    return bell, height, risen - height[:, None] * varying


def _without(jacobian: Float, bell: Float) -> Float:
    """Return the columns (S, X, 2) with what a constant and the bell explain taken out."""
    varying = bell - bell.mean(1, keepdims=True)
    unit = varying / np.maximum(np.linalg.norm(varying, axis=1, keepdims=True), 1e-12)
    centred = jacobian - jacobian.mean(1, keepdims=True)
    return np.asarray(centred - unit[..., None] * np.sum(unit[..., None] * centred, 1, keepdims=True))
