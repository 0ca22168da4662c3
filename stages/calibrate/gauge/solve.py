"""From first poses to the final adjustment: smoothness, outliers, and the sheet's model."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.adjustment.levenberg_marquardt import Watch, unwatched
from pipeline.adjustment.motion_priors import third_difference_sigma
from pipeline.arrays import Float, Int
from pipeline.artefacts.measured import RingSamples
from pipeline.instrument.probe import Probe
from stages.calibrate.gauge.adjust import (
    Measurements,
    Solution,
    adjust,
    instrument_covariance,
    spread,
)
from stages.calibrate.gauge.geometry import BoreRings, Gauge, bore_rings
from stages.calibrate.gauge.result import Finding
from stages.calibrate.gauge.state import GaugeParameters, SheetModel, Unknowns, prior_directions
from stages.calibrate.gauge.terms import frame_spread

_WRONG_RING = 4.0
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
    loose = adjust(start, measured, parameters, watch)
    state = loose.state
    on_bore = source.on_bore(state.T_pc, state.probe, parameters)
    measured = replace(measured, rings=on_bore, smooth_sigma=third_difference_sigma(state.T_pc, posed))
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
    """Return the frames whose ring lies off the bore by several times the usual spread."""
    frame = measured.rings.frame
    each = frame_spread(frame, solution.rings.in_sigma)
    return np.unique(frame[each > _WRONG_RING * spread(solution.rings)])


def wrong_fiducials(solution: Solution) -> Int:
    """Return the places of fiducials found farther off their place than a print may be."""
    edge = solution.state.edge_mm
    shift = np.hypot(edge[:, 2] - edge[:, 0], edge[:, 1] - edge[:, 3]) / 2
    return np.flatnonzero(shift > _WRONG_EDGE_MM)


def chosen(
    plain: Solution, measured: Measurements, parameters: GaugeParameters, watch: Watch = unwatched
) -> tuple[Solution, SheetModel, dict[SheetModel, float]]:
    """Return the solution with decentring and waviness if the data ask for them.

    The drop of χ² is divided by how much neighbours err alike, and must exceed what chance and ln n for
    each parameter give (G. Schwarz, "Estimating the dimension of a model", 1978).
    """
    edge_spread, ring_spread, alike = spread(plain.edges), spread(plain.rings), _alike(plain)
    cost = plain.cost(edge_spread, ring_spread)
    asked, evidence, solutions = [], {}, {SheetModel.PLAIN: plain}
    count = len(np.unique(plain.rings.cluster))
    for model in (SheetModel.DECENTRED, SheetModel.WAVY):
        solutions[model] = adjust(_extended(plain.state, model, parameters), measured, parameters, watch)
        drop = (cost - solutions[model].cost(edge_spread, ring_spread)) / alike
        evidence[model] = drop
        more = len(solutions[model].state.instrument) - len(plain.state.instrument)
        if drop > parameters.evidence + more * np.log(count):
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
