"""The joint adjustment: poses, camera, sheet, bores, fiducials and encoder from all measurements together.

`adjust` minimises all residuals once. `solve` leads from first poses to the final adjustment: it learns how
smooth the motion is, leaves out what is outvoted, and chooses the sheet's model.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.adjustment.bordered import BorderedSystem, Factor
from pipeline.adjustment.levenberg_marquardt import Watch, unwatched
from pipeline.adjustment.motion_priors import smooth_motion_rows, third_difference_sigma
from pipeline.adjustment.robust import cluster_covariance, robust_spread
from pipeline.arrays import Float, Int
from pipeline.artefacts.measured import RingSamples
from pipeline.instrument.probe import Probe
from pipeline.recording.base import Encoder
from stages.calibrate.gauge.edges import Edges
from stages.calibrate.gauge.geometry import BoreRings, Gauge, bore_rings
from stages.calibrate.gauge.state import GaugeParameters, SheetModel, Unknowns, prior_directions
from stages.calibrate.gauge.terms import (
    Equations,
    edge_equations,
    encoder_equations,
    frame_spread,
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
# A model whose first step brings less than this part of the needed drop of χ² is not followed further: from
# the plain optimum the first Gauss-Newton step brings nearly all of it (13.5 of 13.8 of a rendered gauge).
_FIRST_STEP = 0.5


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
    smooth_sigma : (6,)
        1 σ of the pose's third difference from frame to frame, mm and rad.
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
    """Return the covariance (Q, Q) of the instrument; it holds also where neighbours err alike.

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


# A ring is wrong whose spread about the bore is so many times that of all rings. Debt: data/debts.md.
_WRONG_RING = 4.0
# A fiducial is wrong that lies so far off its stated place. Debt: data/debts.md.
_WRONG_EDGE_MM = 0.25


@dataclass(frozen=True)
class RingSource:
    """All ring samples, the places (F,) of their frames in the recording, and the gauge they lie on."""

    rings: RingSamples
    index: Int
    gauge: Gauge

    def on_bore(self, T_pc: Float, probe: Probe, parameters: GaugeParameters) -> BoreRings:
        """Return the bins of rings on known bore as poses and probe place them."""
        return bore_rings(self.rings, self.index, T_pc, probe, self.gauge, parameters)


@dataclass(frozen=True)
class Finding:
    """A solution with what was chosen and left out on the way to it."""

    solution: Solution
    measured: Measurements
    sheet: SheetModel
    evidence: dict[SheetModel, float]
    wrong_fiducials: Int
    wrong_rings: Int
    left_out: dict[str, int]


def first_unknowns(
    T_pc: Float, posed: Int, gauge: Gauge, measured: Measurements, probe: Probe, parameters: GaugeParameters
) -> Unknowns:
    """Return the state to start from: the stated probe and a perfect gauge."""
    offset = 0.0
    if measured.encoder is not None:
        reading = np.interp(measured.time_s, measured.encoder.time_s, measured.encoder.distance_mm)
        offset = float(np.median(T_pc[posed, 2, 3] - reading[posed]))
    unsure = prior_directions(probe, SheetModel.PLAIN, parameters)
    return Unknowns(
        T_pc, np.zeros(len(T_pc)), np.array([1.0, offset, 0.0]), np.zeros(len(gauge.radius_mm)),
        np.zeros((len(gauge.ids), 4)), np.zeros(unsure.shape[1]), probe, unsure,
    )  # fmt: skip


def solve(
    start: Unknowns,
    measured: Measurements,
    source: RingSource,
    posed: Int,
    parameters: GaugeParameters,
    watch: Watch = unwatched,
) -> Finding:
    """Adjust with loose motion, learn from it, leave out what is outvoted, choose the sheet's model.

    ``watch`` is called before every step of an adjustment.
    """
    state = adjust(start, measured, parameters, watch, enough=NEAR_SIGMA).state
    on_bore = source.on_bore(state.T_pc, state.probe, parameters)
    sigma = third_difference_sigma(state.T_pc, measured.time_s, posed)
    measured = replace(measured, rings=on_bore, smooth_sigma=sigma)
    smooth = adjust(state, measured, parameters, watch)
    rings, fiducials = wrong_rings(smooth, measured), wrong_fiducials(smooth)
    if len(rings) or len(fiducials):
        measured = replace(
            measured,
            rings=on_bore.select(~np.isin(on_bore.frame, rings)),
            edges=measured.edges.select(~np.isin(measured.edges.marker, fiducials)),
        )
        smooth = adjust(smooth.state, measured, parameters, watch)
    solution, sheet, evidence = chosen(smooth, measured, parameters, watch)
    return Finding(solution, measured, sheet, evidence, fiducials, rings, on_bore.left_out)


def wrong_rings(solution: Solution, measured: Measurements) -> Int:
    """Return the frames whose ring spreads about the bore by `_WRONG_RING` times what all rings do."""
    frame = measured.rings.frame
    each = frame_spread(frame, solution.rings.in_sigma)
    return np.unique(frame[each > _WRONG_RING * spread(solution.rings)])


def wrong_fiducials(solution: Solution) -> Int:
    """Return the fiducials, as places in the gauge's list, that lie farther off than a print may be."""
    edge = solution.state.edge_mm
    shift = np.hypot(edge[:, 2] - edge[:, 0], edge[:, 1] - edge[:, 3]) / 2
    return np.flatnonzero(shift > _WRONG_EDGE_MM)


def chosen(
    plain: Solution, measured: Measurements, parameters: GaugeParameters, watch: Watch
) -> tuple[Solution, SheetModel, dict[SheetModel, float]]:
    """Return the solution, its sheet model, and the drop of χ² of each model tried.

    Decentring and waviness are taken where the data ask for them: the drop of χ², divided by how much
    neighbours err alike, must exceed ``parameters.evidence`` and ln n for each further parameter (G. Schwarz,
    "Estimating the dimension of a model", 1978).
    """
    edge_spread, ring_spread, alike = spread(plain.edges), spread(plain.rings), _alike(plain)
    cost = plain.cost(edge_spread, ring_spread)
    asked, evidence, solutions = [], {}, {SheetModel.PLAIN: plain}
    count = len(np.unique(plain.rings.cluster))
    for model in (SheetModel.DECENTRED, SheetModel.WAVY):
        state = _extended(plain.state, model, parameters)
        needed = parameters.evidence + (len(state.instrument) - len(plain.state.instrument)) * np.log(count)
        for most_steps in (1, parameters.iterations):
            solutions[model] = adjust(state, measured, parameters, watch, most_steps)
            evidence[model] = (cost - solutions[model].cost(edge_spread, ring_spread)) / alike
            if evidence[model] < _FIRST_STEP * needed:
                break
            state = solutions[model].state
        if evidence[model] > needed:
            asked.append(model)
    if len(asked) == 2:
        start = _extended(plain.state, SheetModel.DECENTRED_WAVY, parameters)
        both = adjust(start, measured, parameters, watch)
        return both, SheetModel.DECENTRED_WAVY, evidence
    model = asked[0] if asked else SheetModel.PLAIN
    return solutions[model], model, evidence


def _extended(state: Unknowns, model: SheetModel, parameters: GaugeParameters) -> Unknowns:
    """Return the state with further corrections of the instrument, at zero."""
    unsure = prior_directions(state.stated, model, parameters)
    more = np.zeros(unsure.shape[1] - len(state.instrument))
    return replace(state, unsure=unsure, instrument=np.append(state.instrument, more))


def _alike(solution: Solution) -> float:
    """Return by how much the instrument's variance is widened because neighbours err alike."""
    at = solution.state.layout.instrument
    plain = solution.factor.border_covariance()[at, at]
    return float(max(np.median(np.diag(instrument_covariance(solution)) / np.diag(plain)), 1.0))
