"""The joint adjustment: poses, camera, sheet, bores, fiducials and encoder from all measurements together.

`adjust` minimises all residuals once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.adjustment.bordered import BorderedSystem, Factor
from pipeline.adjustment.levenberg_marquardt import Watch, unwatched
from pipeline.adjustment.motion_priors import smooth_motion_rows
from pipeline.adjustment.robust import cluster_covariance, robust_spread
from pipeline.arrays import Float
from pipeline.recording.base import Encoder
from stages.calibrate.gauge.edges import Edges
from stages.calibrate.gauge.geometry import BoreRings
from stages.calibrate.gauge.state import GaugeParameters, Unknowns
from stages.calibrate.gauge.terms import (
    Equations,
    edge_equations,
    encoder_equations,
    prior_rows,
    ring_equations,
    slip_origin,
)

# An adjustment ends after a step that moves no parameter of the instrument by this much of its σ. Half and
# twice of it move no parameter of two drawn gauge runs by more than 0.006 of its σ.
_CONVERGED_SIGMA = 0.02
# The same for the first adjustment, whose motion prior is loose and of which only the poses are used. With a
# loose prior, frames that see little swing to and fro, and with them the instrument by .1 to .8 of its σ, so
# that a stricter bound uses up all iterations. Derived: the next adjustment starts within 1 σ; its result
# differs by .05 σ (open-2's gauge).
NEAR_SIGMA = 0.5
# A third difference of the motion ties a frame to the three after it.
_REACH = 3
# The scale of `pipeline.adjustment.robust.Cauchy`, in σ.
_CAUCHY = 2.5


@dataclass(frozen=True)
class Measurements:
    """The measurements of a gauge run that the adjustment uses.

    Attributes
    ----------
    edges : Edges
    rings : BoreRings
    time_s : (N,)
    encoder : Encoder or None
    bore_sigma_mm : float
        1 σ of each bore's radius.
    smooth_sigma : (6,) or (N − 3, 6)
        1 σ of the pose's third differences from frame to frame, mm and rad; of all, or of each.
    """

    edges: Edges
    rings: BoreRings
    time_s: Float
    encoder: Encoder | None
    bore_sigma_mm: float
    smooth_sigma: Float


@dataclass(frozen=True)
class Solution:
    """State at the optimum, the factorised equations there, and the measurements' residuals."""

    state: Unknowns
    factor: Factor
    edges: Equations
    rings: Equations

    def cost(self, edge_spread: float, ring_spread: float) -> float:
        """Return the robust sum of squares of the measurements in units of given spreads."""
        total = 0.0
        for equations, spread in ((self.edges, edge_spread), (self.rings, ring_spread)):
            total += float(np.sum(_CAUCHY**2 * np.log1p((equations.in_sigma / spread / _CAUCHY) ** 2)))
        return total


def adjust(
    state: Unknowns,
    measured: Measurements,
    parameters: GaugeParameters,
    watch: Watch = unwatched,
    most_steps: int | None = None,
    enough: float = _CONVERGED_SIGMA,
) -> Solution:
    """Minimise all residuals together by Gauss-Newton with Cauchy weights.

    ``watch`` is called before every step. The search ends after a step that moves no parameter of the
    instrument by ``enough`` of its σ, at the latest after ``most_steps`` steps (by default
    ``parameters.iterations``).

    Raises
    ------
    numpy.linalg.LinAlgError
        When something is not determined.
    """
    for _ in range(most_steps or parameters.iterations):
        watch()
        solution = _linearised(state, measured, parameters)
        frames, border = solution.factor.step()
        state = state.step(frames, border)
        at = state.layout.instrument
        sigma = np.sqrt(np.diag(solution.factor.border_covariance())[at])
        if np.abs(border[at] / sigma).max() < enough:
            break
    return _linearised(state, measured, parameters)


def _linearised(state: Unknowns, measured: Measurements, parameters: GaugeParameters) -> Solution:
    edges, rings = edge_equations(state, measured.edges), ring_equations(state, measured.rings)
    system = BorderedSystem(len(state.T_pc), state.border_size, _REACH)
    system.add(edges.rows)
    system.add(rings.rows)
    system.add(smooth_motion_rows(state.T_pc, measured.time_s, measured.smooth_sigma, state.border_size))
    system.add(slip_origin(state, measured.encoder is not None))
    if measured.encoder is not None:
        for rows in encoder_equations(state, measured.time_s, measured.encoder, parameters):
            system.add(rows)
    system.add(prior_rows(state, measured.bore_sigma_mm, parameters))
    return Solution(state, system.factor(), edges, rings)


def spread(equations: Equations) -> float:
    """Return the robust spread of residuals in σ."""
    used = equations.in_sigma[equations.rows.weight > 0]
    return robust_spread(used) if len(used) else 1.0


def instrument_covariance(solution: Solution) -> Float:
    """Return the covariance (Q, Q) of the instrument, valid also if neighbours have common errors.

    The variance of each correction is widened, never narrowed, to the cluster-robust one (H. White,
    "Asymptotic theory for econometricians", 1984, ch. 6), whose clusters are cells of wall and edges of
    fiducials. Correlations stay those of the equations.
    """
    at = solution.state.layout.instrument
    covariance = solution.factor.border_covariance()
    scores = np.zeros_like(covariance)
    for equations in (solution.edges, solution.rings):
        scores += _cluster_scores(equations, solution.factor)
    robust = covariance @ scores @ covariance
    ratio = np.sqrt(np.diag(robust)[at] / np.diag(covariance)[at])
    widened = np.maximum(ratio, 1.0)
    return np.asarray(covariance[at, at] * np.outer(widened, widened))


def _cluster_scores(equations: Equations, factor: Factor) -> Float:
    """Return the covariance (B, B) of the border's scores, the frames having been eliminated."""
    rows = equations.rows
    scores = factor.border_rows(rows) * (rows.weight * rows.residual)[:, None]
    return cluster_covariance(scores, equations.cluster)
