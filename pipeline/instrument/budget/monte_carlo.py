"""The budget by Monte Carlo through the exact chain: disturbed instrument, pixels, assumed triangulation."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.stats import qmc

from pipeline.arrays import Float
from pipeline.instrument.budget import Budget, Row, parameter_names
from pipeline.instrument.budget.scan import Pose, RingScan, radius_error
from pipeline.instrument.budget.sources import Disturbance, Kind


@dataclass(frozen=True)
class MonteCarlo:
    """1 σ of the radius (A,) for each row by name, and of everything together."""

    rows: Mapping[str, Mapping[Pose, Float]]
    total: Mapping[Pose, Float]


def monte_carlo(budget: Budget, draws: int = 256) -> MonteCarlo:
    """Return the budget's rows and total from random draws of every source.

    Parameters
    ----------
    budget
        Gives the distributions.
    draws
        A power of 2, above the number of parameters and samples together.

    Notes
    -----
    Draws are scrambled Sobol points turned normal, then given mean 0 and covariance 1 exactly (moment
    matching), so that differences from the analytic budget are not due to the choice of the draws.
    """
    random = np.random.default_rng(0)
    rows = {
        row.source.name: _spread(budget.scan, *_row_draws(budget, row, draws, random)) for row in budget.rows
    }
    joint = _normal(budget.covariance, draws, random)
    shift = np.sqrt(np.sum([r.shift_px**2 for r in budget.rows if r.source.kind is Kind.RANDOM], 0))
    scatter = _scatter(shift, draws, random, beside=joint)
    return MonteCarlo(rows, _spread(budget.scan, joint, scatter))


def _row_draws(budget: Budget, row: Row, draws: int, random: np.random.Generator) -> tuple[Float, Float]:
    names = parameter_names(budget.scan.probe)
    if row.source.kind is Kind.RANDOM:
        return np.zeros((draws, len(names))), _scatter(row.shift_px, draws, random)
    systematic = np.zeros((draws, len(names)))
    systematic[:, [names.index(p) for p in row.source.parameters]] = _normal(row.covariance, draws, random)
    return systematic, np.zeros((draws, budget.scan.azimuths))


def _spread(scan: RingScan, parameters: Float, shift_px: Float) -> dict[Pose, Float]:
    """Return 1 σ (A,) of the radius over draws (N, P + E) and (N, A); 0 if nothing is disturbed."""
    if not (parameters.any() or shift_px.any()):
        return {pose: np.zeros(scan.azimuths) for pose in Pose}
    split = len(scan.probe.parameter_names)
    errors = np.stack(
        [
            radius_error(scan, p[:split], Disturbance(*p[split:].tolist()), s)
            for p, s in zip(parameters, shift_px, strict=True)
        ]
    )
    known, fitted = errors.std(0)
    return {Pose.KNOWN: known, Pose.FITTED: fitted}


def _normal(covariance: Float, draws: int, random: np.random.Generator) -> Float:
    """Return (N, K) normal draws whose mean is 0 and whose covariance is exactly the one given."""
    value, vector = np.linalg.eigh(covariance)
    used = value > 1e-12 * max(value.max(), 1e-300)
    engine = qmc.MultivariateNormalQMC(np.zeros(used.sum()), rng=random) if used.any() else None
    if engine is None:
        return np.zeros((draws, len(covariance)))
    z = engine.random(draws)
    z = z - z.mean(0)
    z = z @ np.linalg.inv(np.linalg.cholesky(z.T @ z / draws)).T
    return np.asarray(z @ (vector[:, used] * np.sqrt(value[used])).T)


def _scatter(sigma_px: Float, draws: int, random: np.random.Generator, beside: Float | None = None) -> Float:
    """Return (N, A) displacements with exactly the σ given at each azimuth, uncorrelated with ``beside``."""
    z = random.standard_normal((draws, len(sigma_px)))
    moved = np.zeros((draws, 0)) if beside is None else beside[:, beside.any(0)]
    # orthonormal columns, orthogonal to the constant one: mean 0, variance 1 and no correlation, exactly
    basis = np.linalg.qr(np.concatenate([np.ones((draws, 1)), moved / moved.std(0), z], -1))[0]
    return np.asarray(basis[:, -len(sigma_px) :] * math.sqrt(draws) * sigma_px)
