"""Photometry from the overlap of frames: what changes with the place in the image is light, not wall.

Model: log I = log ρ(cell) + log E(point, normal) + f(θ) + g(θ, φ) + log gain(frame), with ρ free in every
cell, f and g hat functions over polar angle and image azimuth, all but ρ drawn weakly to zero. Least squares
with Huber weights; the cells are eliminated (Schur complement), so that only light and gains are solved for.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import spsolve

from pipeline.artefacts import Float, Int
from pipeline.instrument.probe import Probe
from stages.texture.light import LightField
from stages.texture.sampling import LightSamples

_THETA_KNOTS = 9
_AZIMUTH_KNOTS = 12
# Prior 1 σ of log brightness: by angle alone, around the image, of g's steps, of a frame's gain, of one sample.
_SIGMA_THETA, _SIGMA_AROUND, _SIGMA_STEP, _SIGMA_GAIN, _SIGMA_SAMPLE = 1.0, 0.05, 0.05, 0.05, 0.05
_SIGMA_TREND = 1e-4
_ITERATIONS = 4
_FEWEST = 20


@dataclass(frozen=True)
class Light:
    """Light over the image, exposure of the views, and how well both explain the samples.

    Attributes
    ----------
    field : LightField
    gain : (V,)
        Exposure of each view; NaN where a view gave too few samples.
    residual : float
        Robust 1 σ of the samples' relative brightness after the fit.
    """

    field: LightField
    gain: Float
    residual: float


def solve_light(samples: LightSamples, views: int, probe: Probe, reference: float) -> Light:
    """Separate light from wall.

    Parameters
    ----------
    samples
        Samples of wall cells in frames.
    views
        Number of views.
    probe
        Its lighting is the model that is corrected.
    reference
        Irradiance that counts as 1.
    """
    count = np.bincount(samples.view, minlength=views)
    if not len(samples.log_ratio):
        flat = LightField(probe.lighting, 0.0, 1.0, np.zeros((2, 1)), reference)
        return Light(flat, np.full(views, np.nan), float("nan"))
    theta_from = float(samples.theta_rad.min())
    theta_step = max(float(np.ptp(samples.theta_rad)) / (_THETA_KNOTS - 1), 1e-6)
    design = _design(samples, views, theta_from, theta_step)
    _, cell = np.unique(samples.cell, return_inverse=True)
    level = float(np.median(samples.log_ratio))
    solution, residual = _solve_robust(design, cell, samples.log_ratio - level, _prior(_along(samples, views)))
    f = solution[:_THETA_KNOTS]
    g = solution[_THETA_KNOTS:-views].reshape(_THETA_KNOTS, _AZIMUTH_KNOTS)
    field = LightField(probe.lighting, theta_from, theta_step, f[:, None] + g, reference)
    return Light(field, np.where(count >= _FEWEST, np.exp(solution[-views:]), np.nan), residual)


def _design(samples: LightSamples, views: int, theta_from: float, theta_step: float) -> sparse.csr_array:
    """Return (N, T + T P + views): hats f(θ), hats g(θ, φ), one column per view."""
    row = np.clip((samples.theta_rad - theta_from) / theta_step, 0, _THETA_KNOTS - 1 - 1e-9)
    column = np.mod((samples.azimuth_rad + np.pi) / (2 * np.pi), 1.0) * _AZIMUTH_KNOTS
    i, j = row.astype(int), column.astype(int) % _AZIMUTH_KNOTS
    u, v = row - i, column - np.floor(column)
    j1 = (j + 1) % _AZIMUTH_KNOTS
    at = lambda a, b: _THETA_KNOTS + a * _AZIMUTH_KNOTS + b  # noqa: E731
    index = [i, i + 1, at(i, j), at(i, j1), at(i + 1, j), at(i + 1, j1)]
    value = [1 - u, u, (1 - u) * (1 - v), (1 - u) * v, u * (1 - v), u * v]
    index.append(_THETA_KNOTS * (1 + _AZIMUTH_KNOTS) + samples.view)
    value.append(np.ones_like(u))
    shape = (len(u), _THETA_KNOTS * (1 + _AZIMUTH_KNOTS) + views)
    rows = np.tile(np.arange(len(u)), len(index))
    return sparse.csr_array((np.concatenate(value), (rows, np.concatenate(index))), shape=shape)


def _along(samples: LightSamples, views: int) -> Float:
    """Return (V,) how far along the wall each view looked, zero mean, 0 where it took no sample."""
    count = np.bincount(samples.view, minlength=views)
    mean = np.bincount(samples.view, samples.cell, minlength=views) / np.maximum(count, 1)
    centred = np.where(count > 0, mean - mean[count > 0].mean(), 0.0)
    return np.asarray(centred / max(float(np.linalg.norm(centred)), 1e-12))


def _prior(along: Float) -> sparse.csc_array:
    """Return the prior's information matrix.

    A wall that grows brighter along the pipe, a light that falls off less and an exposure that sinks from
    frame to frame explain the same pictures. Exposure is taken to have no trend ``along`` (V,).
    """
    around = np.arange(_THETA_KNOTS * _AZIMUTH_KNOTS).reshape(_THETA_KNOTS, _AZIMUTH_KNOTS)
    pairs = np.concatenate(
        [
            np.stack([around, np.roll(around, -1, 1)], -1).reshape(-1, 2),
            np.stack([around[:-1], around[1:]], -1).reshape(-1, 2),
        ]
    )
    steps = np.zeros((len(pairs), around.size))
    steps[np.arange(len(pairs)), pairs[:, 0]], steps[np.arange(len(pairs)), pairs[:, 1]] = -1, 1
    smooth = steps.T @ steps / _SIGMA_STEP**2 + np.eye(around.size) / _SIGMA_AROUND**2
    theta = np.eye(_THETA_KNOTS) / _SIGMA_THETA**2
    gain = np.eye(len(along)) / _SIGMA_GAIN**2 + np.outer(along, along) / _SIGMA_TREND**2
    return sparse.block_diag([theta, smooth, gain], format="csc")


def _solve_robust(design: sparse.csr_array, cell: Int, value: Float, prior: sparse.csc_array) -> tuple[Float, float]:
    """Return the solution of the reduced normal equations with Huber weights, and the robust residual."""
    weight = np.ones(len(value))
    cells = sparse.csr_array((np.ones(len(cell)), (np.arange(len(cell)), cell)))
    for _ in range(_ITERATIONS):
        weighted = cells.T * weight
        total = weighted.sum(1)
        crossed = weighted @ design
        shrunk = crossed.T * (1 / total)
        mean = weighted @ value
        matrix = (design.T * weight) @ design - shrunk @ crossed + prior * _SIGMA_SAMPLE**2
        solution = spsolve(
            sparse.csc_array(matrix), design.T @ (weight * value) - shrunk @ mean
        )
        rest = value - design @ solution
        rest -= ((weighted @ rest) / total)[cell]
        residual = 1.4826 * float(np.median(np.abs(rest)))
        weight = np.minimum(1, (1.345 * residual + 1e-6) / np.maximum(np.abs(rest), 1e-12))
    return np.asarray(solution), residual
