"""From a measured gauge run to measurements with fixed weights, and where to start."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.adjustment.motion_priors import third_difference_sigma
from pipeline.arrays import Float, Int
from stages.calibrate.gauge.adjust import adjust
from stages.calibrate.gauge.calibrate import MeasuredRun
from stages.calibrate.gauge.parameters import GaugeParameters
from stages.calibrate.gauge.rings import BoreRings
from stages.calibrate.gauge.state import SheetModel, Unknowns, prior_directions
from stages.calibrate.gauge.terms import frame_spread
from stages.diagnose.gauge.fit import own_parameters
from stages.diagnose.gauge.points import bin_widths
from stages.diagnose.gauge.run import GaugeRun, Term, linearise

_CAUCHY = 2.5
# Factor on the typical jerk: it varies along a run, and the prior must not hold poses where it is larger.
# Debt: data/debts.md.
_LOOSER = 5.0
# The camera's parameters are free while outliers are separated from effects.
_FREE = GaugeParameters.model_validate(
    {
        "camera_prior_scale": 50.0,
        "tilt_prior_deg": 3.0,
        "baseline_prior_mm": 3.0,
        "cone_prior_deg": 3.0,
        "ring_bins": 120,
    }
)


def prepare(measured_run: MeasuredRun) -> tuple[GaugeRun, Unknowns]:
    """Return the run's measurements, and poses by an instrument free to follow whatever is there.

    Rings before the first frame with fiducials and after the last do not count: a ring alone does not tell
    how the probe is turned, and poses drift there.
    """
    measured, source, posed = measured_run.measured, measured_run.source, measured_run.posed
    measured = replace(measured, rings=_between(measured.rings, posed))
    loose = adjust(_freed(measured_run.start), measured, _FREE).state
    rings = _between(source.on_bore(loose.T_pc, loose.probe, _FREE), posed)
    sigma = third_difference_sigma(loose.T_pc, posed)
    smooth = adjust(loose, replace(measured, rings=rings, smooth_sigma=sigma), _FREE).state
    rings = _between(source.on_bore(smooth.T_pc, smooth.probe, _FREE), posed)
    run = GaugeRun(
        measured.edges, rings, bin_widths(source.rings, source.index, rings),
        measured.time_s, measured.encoder,
        max(measured.bore_sigma_mm, 1e-3), _LOOSER * sigma,
        measured.edges.sigma_px**-2, np.ones(len(rings.frame)),
    )  # fmt: skip
    return weighed(run, smooth, ()), stated_start(smooth)


def stated_start(state: Unknowns) -> Unknowns:
    """Return the poses of a state with the stated instrument."""
    return own_parameters(
        replace(state, instrument=0 * state.instrument, bore_mm=0 * state.bore_mm, edge_mm=0 * state.edge_mm)
    )


def weighed(run: GaugeRun, state: Unknowns, terms: Sequence[Term]) -> GaugeRun:
    """Return the run with weights by the residuals' spread frame by frame, outliers counting little."""
    plain = replace(run, edge_weight=np.ones(len(run.edges.uv)), ring_weight=np.ones(len(run.rings.uv)))
    found = linearise(plain, state, terms, ()).equations
    count = len(run.edges.uv)
    edges, rings = slice(0, count), slice(count, count + len(run.rings.uv))
    return replace(
        run,
        edge_weight=_weight(found.frame[edges], found.residual[edges], run.edges.sigma_px),
        ring_weight=_weight(found.frame[rings], found.residual[rings], _ring_sigma_mm(run.rings, state)),
    )


def _between(rings: BoreRings, posed: Int) -> BoreRings:
    return rings.select((rings.frame >= posed.min()) & (rings.frame <= posed.max()))


def _freed(state: Unknowns) -> Unknowns:
    unsure = prior_directions(state.stated, SheetModel.DECENTRED_WAVY, _FREE)
    return replace(state, unsure=unsure, instrument=np.zeros(unsure.shape[1]))


def _ring_sigma_mm(rings: BoreRings, state: Unknowns) -> Float:
    by_pixel = state.probe.triangulate_jacobian(rings.uv)[0]
    way = np.einsum("mij,mj->mi", by_pixel, rings.outward)
    return np.asarray(rings.sigma_px * np.linalg.norm(way, axis=1))


def _weight(frame: Int, residual: Float, sigma: Float) -> Float:
    in_sigma = residual / sigma
    spread = frame_spread(frame, in_sigma)
    return np.asarray(1 / (1 + (in_sigma / spread / _CAUCHY) ** 2) / (sigma * spread) ** 2)
