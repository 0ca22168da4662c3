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

from pipeline.adjustment.robust import robust_spread
from pipeline.arrays import Float, Int
from pipeline.instrument.probe import Probe
from stages.texture.light import LightField
from stages.texture.sampling import LightSamples

_THETA_KNOTS = 9
_AZIMUTH_KNOTS = 12
# 1 σ of log brightness: prior of f, of g, of g's steps and of gains; of one sample.
_SIGMA_THETA, _SIGMA_AROUND, _SIGMA_STEP, _SIGMA_GAIN, _SIGMA_SAMPLE = 1.0, 0.05, 0.05, 0.05, 0.05
_ITERATIONS = 4
_FEWEST = 20
_STANDSTILL_CELLS = 1e-3


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
    along = _along(samples, views)
    solution, residual = _solve_robust(design, cell, samples.log_ratio - level, _prior(views), along)
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
    first = _THETA_KNOTS + i * _AZIMUTH_KNOTS
    index = [i, i + 1, first + j, first + j1, first + _AZIMUTH_KNOTS + j, first + _AZIMUTH_KNOTS + j1]
    value = [1 - u, u, (1 - u) * (1 - v), (1 - u) * v, u * (1 - v), u * v]
    index.append(_THETA_KNOTS * (1 + _AZIMUTH_KNOTS) + samples.view)
    value.append(np.ones_like(u))
    shape = (len(u), _THETA_KNOTS * (1 + _AZIMUTH_KNOTS) + views)
    rows = np.tile(np.arange(len(u)), len(index))
    return sparse.csr_array((np.concatenate(value), (rows, np.concatenate(index))), shape=shape)


def _along(samples: LightSamples, views: int) -> Float:
    """Return (V,) how far along the wall each view looked, zero mean; all alike when nothing moved.

    A wall that grows brighter along the pipe, a light that falls off less and an exposure that sinks from
    frame to frame explain the same pictures: exposure is taken to have no trend along this.
    """
    count = np.bincount(samples.view, minlength=views)
    mean = np.bincount(samples.view, samples.cell, minlength=views) / np.maximum(count, 1)
    centred = np.where(count > 0, mean - mean[count > 0].mean(), 0.0)
    if float(np.linalg.norm(centred)) < _STANDSTILL_CELLS:
        centred = np.ones(views)
    return np.asarray(centred / np.linalg.norm(centred))


def _prior(views: int) -> sparse.csc_array:
    """Return the prior's information matrix."""
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
    gain = sparse.eye_array(views) / _SIGMA_GAIN**2
    return sparse.csc_array(sparse.block_diag([theta, smooth, gain]))


def _solve_robust(
    design: sparse.csr_array, cell: Int, value: Float, prior: sparse.csc_array, along: Float
) -> tuple[Float, float]:
    """Return the solution of the reduced normal equations with Huber weights, and the robust residual.

    The gains, the last unknowns, are held square to ``along`` by a Lagrange multiplier.
    """
    border = sparse.csc_array(np.concatenate([np.zeros(design.shape[1] - len(along)), along])[:, None])
    weight = np.ones(len(value))
    cells = sparse.csr_array((np.ones(len(cell)), (np.arange(len(cell)), cell)))
    for _ in range(_ITERATIONS):
        weighted = cells.T * weight
        total = np.bincount(cell, weight)
        crossed = weighted @ design
        shrunk = crossed.T * (1 / total)
        mean = weighted @ value
        matrix = (design.T * weight) @ design - shrunk @ crossed + prior * _SIGMA_SAMPLE**2
        bordered = sparse.block_array([[matrix, border], [border.T, None]], format="csc")
        solution = spsolve(bordered, np.append(design.T @ (weight * value) - shrunk @ mean, 0.0))[:-1]
        rest = value - design @ solution
        rest -= ((weighted @ rest) / total)[cell]
        residual = robust_spread(rest)
        weight = np.minimum(1, (1.345 * residual + 1e-6) / np.maximum(np.abs(rest), 1e-12))
    return np.asarray(solution), residual
