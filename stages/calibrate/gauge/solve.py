"""The adjustment from first poses to the final solution.

`solve` estimates the smoothness of the motion, leaves out wrong rings and fiducials, and chooses the sheet's
model.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.adjustment.levenberg_marquardt import Watch, unwatched
from pipeline.adjustment.motion_priors import local_third_difference_sigma
from pipeline.arrays import Float, Int
from pipeline.artefacts.measured import RingSamples
from pipeline.instrument.probe import Probe
from stages.calibrate.gauge.adjust import (
    NEAR_SIGMA,
    Measurements,
    Solution,
    adjust,
    instrument_covariance,
    spread,
)
from stages.calibrate.gauge.geometry import BoreRings, Gauge, bore_rings
from stages.calibrate.gauge.state import GaugeParameters, SheetModel, Unknowns, prior_directions
from stages.calibrate.gauge.terms import frame_spread

# A model whose first step reduces χ² by less than this part of the needed drop is not followed further: from
# the plain optimum the first Gauss-Newton step brings nearly all of it (13.5 of 13.8 of a rendered gauge).
_FIRST_STEP = 0.5
# A ring is wrong if its spread around the bore is this many times that of all rings. Debt: data/debts.md.
_WRONG_RING = 4.0
# A fiducial is wrong if it is this far off its stated place. Debt: data/debts.md.
_WRONG_EDGE_MM = 0.25


@dataclass(frozen=True)
class RingSource:
    """All ring samples, the indices (F,) of their frames in the recording, and their gauge."""

    rings: RingSamples
    index: Int
    gauge: Gauge

    def on_bore(self, T_pc: Float, probe: Probe, parameters: GaugeParameters) -> BoreRings:
        """Return the bins of rings on known bores, with the given poses and probe."""
        return bore_rings(self.rings, self.index, T_pc, probe, self.gauge, parameters)


@dataclass(frozen=True)
class Finding:
    """A solution, the chosen sheet model, and the measurements that were left out."""

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
    """Return the initial state: the stated probe and a perfect gauge."""
    offset = 0.0
    if measured.encoder is not None:
        reading = np.interp(measured.time_s, measured.encoder.time_s, measured.encoder.distance_mm)
        offset = float(np.median(T_pc[posed, 2, 3] - reading[posed]))
    unsure = prior_directions(probe, SheetModel.PLAIN, parameters)
    return Unknowns(
        T_pc, np.zeros(len(T_pc)), np.array([1.0, offset, 0.0]), np.zeros(len(gauge.radius_mm)),
        np.zeros((len(gauge.ids), 4)), np.zeros(unsure.shape[1]), probe, unsure, offset,
    )  # fmt: skip


def solve(
    start: Unknowns,
    measured: Measurements,
    source: RingSource,
    posed: Int,
    parameters: GaugeParameters,
    watch: Watch = unwatched,
) -> Finding:
    """Adjust with a loose motion prior, estimate the smoothness, reject outliers, choose the sheet's model.

    Parameters
    ----------
    start : Unknowns
        Initial state.
    measured : Measurements
    source : RingSource
        Rings, which are binned again at the adjusted poses.
    posed : (K,) int
        Frames whose poses fiducials gave.
    parameters : GaugeParameters
    watch
        Called before every step of an adjustment.
    """
    state = adjust(start, measured, parameters, watch, enough=NEAR_SIGMA).state
    on_bore = source.on_bore(state.T_pc, state.probe, parameters)
    sigma = local_third_difference_sigma(state.T_pc, measured.time_s, posed)
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
    solution, sheet, evidence = choose_sheet(smooth, measured, parameters, watch)
    return Finding(solution, measured, sheet, evidence, fiducials, rings, on_bore.left_out)


def wrong_rings(solution: Solution, measured: Measurements) -> Int:
    """Return the frames whose ring spreads around the bore `_WRONG_RING` times as much as all rings."""
    frame = measured.rings.frame
    each = frame_spread(frame, solution.rings.in_sigma)
    return np.unique(frame[each > _WRONG_RING * spread(solution.rings)])


def wrong_fiducials(solution: Solution) -> Int:
    """Return the fiducials, as indices in the gauge's list, with a larger offset than a print may have."""
    edge = solution.state.edge_mm
    shift = np.hypot(edge[:, 2] - edge[:, 0], edge[:, 1] - edge[:, 3]) / 2
    return np.flatnonzero(shift > _WRONG_EDGE_MM)


def choose_sheet(
    plain: Solution, measured: Measurements, parameters: GaugeParameters, watch: Watch
) -> tuple[Solution, SheetModel, dict[SheetModel, float]]:
    """Return the solution, its sheet model, and the drop of χ² of each model tried.

    Decentring and waviness are used if the data require them: the drop of χ², divided by the widening of the
    variance by correlated neighbours, must exceed ``parameters.evidence`` and ln n for each further parameter
    (G. Schwarz, "Estimating the dimension of a model", 1978).
    """
    edge_spread, ring_spread = spread(plain.edges), spread(plain.rings)
    correlation = _correlation_factor(plain)
    cost = plain.cost(edge_spread, ring_spread)
    required, evidence, solutions = [], {}, {SheetModel.PLAIN: plain}
    count = len(np.unique(plain.rings.cluster))
    for model in (SheetModel.DECENTRED, SheetModel.WAVY):
        state = _extended(plain.state, model, parameters)
        needed = parameters.evidence + (len(state.instrument) - len(plain.state.instrument)) * np.log(count)
        for most_steps in (1, parameters.iterations):
            solutions[model] = adjust(state, measured, parameters, watch, most_steps)
            evidence[model] = (cost - solutions[model].cost(edge_spread, ring_spread)) / correlation
            if evidence[model] < _FIRST_STEP * needed:
                break
            state = solutions[model].state
        if evidence[model] > needed:
            required.append(model)
    if len(required) == 2:
        start = _extended(plain.state, SheetModel.DECENTRED_WAVY, parameters)
        both = adjust(start, measured, parameters, watch)
        return both, SheetModel.DECENTRED_WAVY, evidence
    model = required[0] if required else SheetModel.PLAIN
    return solutions[model], model, evidence


def _extended(state: Unknowns, model: SheetModel, parameters: GaugeParameters) -> Unknowns:
    """Return the state with further corrections of the instrument, at zero."""
    unsure = prior_directions(state.stated, model, parameters)
    more = np.zeros(unsure.shape[1] - len(state.instrument))
    return replace(state, unsure=unsure, instrument=np.append(state.instrument, more))


def _correlation_factor(solution: Solution) -> float:
    """Return the factor by which correlated errors of neighbours widen the instrument's variance."""
    at = solution.state.layout.instrument
    plain = solution.factor.border_covariance()[at, at]
    return float(max(np.median(np.diag(instrument_covariance(solution)) / np.diag(plain)), 1.0))
