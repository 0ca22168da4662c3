"""Rings centred on the pipe's own axis: what is left of their pose errors across the pipe is taken out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.ndimage import median_filter, uniform_filter1d

from pipeline.adjustment.robust import robust_spreads
from pipeline.arrays import Float
from stages.accumulate.samples import WallSamples

_ITERATIONS = 12
_REDESCENT = 2.5
_FEWEST = 0.5
_RINGS = 31
_SMOOTH_RINGS = 7


def centred(samples: WallSamples, shift: Float) -> WallSamples:
    """Return the samples with each ring moved back across the pipe by its shift (F, 2), mm."""
    psi = np.where(samples.valid, samples.azimuth_rad, 0.0)
    outward = np.stack([np.cos(psi), np.sin(psi)], -1)
    along = np.einsum("fai,fi->fa", outward, shift)
    move = np.einsum("faij,fj->fai", samples.section[..., :2], shift)
    return replace(samples, radius_mm=samples.radius_mm - along, xyz_p=samples.xyz_p - move)


def slow(shift: Float) -> Float:
    """Return the running median of shifts (F, 2), smoothed, so that a ring across a weld keeps its shape."""
    middle = median_filter(shift, size=(min(_RINGS, len(shift)), 1), mode="nearest")
    return np.asarray(uniform_filter1d(middle, _SMOOTH_RINGS, axis=0, mode="nearest"))


def first_harmonic(samples: WallSamples) -> Float:
    """Return the first harmonic (F, 2), mm, of every ring's sound wall; 0 where it is not determined.

    The radius is counted from the pipe's own axis, so a first harmonic of a whole ring is no shape but a pose
    error. It is found with Geman-McClure weights beside mean and ovality, so that a dent or a deposit does
    not pull the ring (S. Geman, D. McClure, 1987). Rings seen over less than half of the circle count as 0.
    """
    psi = np.where(samples.valid, samples.azimuth_rad, 0.0)
    radius = np.where(samples.valid, samples.radius_mm, 0.0)
    design = np.stack([np.cos(psi), np.sin(psi), np.ones_like(psi), np.cos(2 * psi), np.sin(2 * psi)], -1)
    usable = samples.valid.mean(1) > _FEWEST
    weight = samples.valid.astype(float)
    ridge = 1e-6 * np.eye(design.shape[-1])  # a ring torn apart keeps a finite shape
    shape = np.zeros((len(psi), design.shape[-1]))
    for _ in range(_ITERATIONS):
        weighted = design * weight[..., None]
        normal = np.swapaxes(weighted, 1, 2) @ design
        right = np.einsum("fai,fa->fi", weighted, radius)
        shape[usable] = np.linalg.solve(normal[usable] + ridge, right[usable][..., None])[..., 0]
        error = radius - np.einsum("fai,fi->fa", design, shape)
        spread = robust_spreads(np.where(samples.valid, error, np.nan)[usable], axis=1)
        scale = np.full(len(psi), np.inf)
        scale[usable] = _REDESCENT * np.maximum(spread, 1e-6)
        weight = samples.valid / (1 + (error / scale[:, None]) ** 2) ** 2
    return np.where(usable[:, None], shape[:, :2], 0.0)
