"""Select effects on a gauge run: weight it, score all, refit with the best few, keep what is needed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.adjustment.levenberg_marquardt import Watch, unwatched
from pipeline.adjustment.motion_priors import (
    jerking_sigma,
    local_third_difference_sigma,
    third_difference_sigma,
)
from pipeline.arrays import Float, Int
from stages.calibrate.gauge import MeasuredRun
from stages.calibrate.gauge.adjust import NEAR_SIGMA, adjust
from stages.calibrate.gauge.geometry import BoreRings
from stages.calibrate.gauge.state import GaugeParameters, SheetModel, Unknowns, prior_directions
from stages.calibrate.gauge.terms import frame_spread
from stages.diagnose.effects.base import EffectModel
from stages.diagnose.effects.library import ring_shift_px, texture_shift_px
from stages.diagnose.gauge.equations import Equations
from stages.diagnose.gauge.fit import Fit, fit, fit_beside
from stages.diagnose.gauge.linearise import linearise
from stages.diagnose.gauge.points import widths_at
from stages.diagnose.gauge.run import GaugeRun, Linearised, Term
from stages.diagnose.gauge.scan import Scored, refined, scan
from stages.diagnose.gauge.sets import key
from stages.diagnose.inference import DETECTED, Stated

_REFITTED = 4
_OTHER_COURSES = 2
MOST_EFFECTS = 6
_WORTH_REFITTING = 0.1
LEAST_GAIN = 20.0
_RIVAL_ITERATIONS = 5
# Rivals whose χ² is worse by more than this are not considered; number and rounds of recomputed weights.
# Debt: data/debts.md.
_FAR, _REWEIGHED, _WEIGHINGS = 50.0, 3, 3
# A further effect or pattern smaller than this share of the first may be an error of the first one's law.
# Debt: data/debts.md.
LEAST_SHARE = 0.01
_CAUCHY = 2.5
# The uncertainty of a bore is taken to be at least this. Debt: data/debts.md.
_LEAST_BORE_SIGMA_MM = 1e-3
# Factor on the typical jerk: it varies along a run, and the prior must not constrain poses where it is
# larger. Debt: data/debts.md.
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


def prepare(measured_run: MeasuredRun, watch: Watch = unwatched) -> tuple[GaugeRun, Unknowns]:
    """Return the run's measurements, and poses from an instrument that is free to follow any effect.

    Rings before the first frame with fiducials and after the last are not used: a ring alone does not
    determine the probe's orientation, and poses drift there.
    """
    measured, source, posed = measured_run.measured, measured_run.source, measured_run.posed
    measured = replace(measured, rings=_between(measured.rings, posed))
    loose = adjust(_freed(measured_run.start), measured, _FREE, watch, enough=NEAR_SIGMA).state
    rings = _between(source.on_bore(loose.T_pc, loose.probe, _FREE), posed)
    sigma = third_difference_sigma(loose.T_pc, measured.time_s, posed)
    local = local_third_difference_sigma(loose.T_pc, measured.time_s, posed)
    held = replace(measured, rings=rings, smooth_sigma=local)
    smooth = adjust(loose, held, _FREE, watch, enough=NEAR_SIGMA).state
    rings = _between(source.on_bore(smooth.T_pc, smooth.probe, _FREE), posed)
    run = GaugeRun(
        measured.edges, rings, widths_at(source.rings, source.index, rings.frame, rings.outward),
        measured.time_s, measured.encoder,
        max(measured.bore_sigma_mm, _LEAST_BORE_SIGMA_MM),
        jerking_sigma(smooth.T_pc, measured.time_s, _LOOSER * sigma),
        measured.edges.sigma_px**-2, np.ones(len(rings.frame)), watch,
    )  # fmt: skip
    return weighed(run, linearise(run, smooth, ())), stated_start(smooth)


def stated_start(state: Unknowns) -> Unknowns:
    """Return the poses of a state with the stated instrument."""
    return _in_own_units(
        replace(state, instrument=0 * state.instrument, bore_mm=0 * state.bore_mm, edge_mm=0 * state.edge_mm)
    )


def weighed(run: GaugeRun, found: Linearised) -> GaugeRun:
    """Return the run with weights from the residuals' scatter frame by frame, with low weights for outliers.

    Points that the instrument does not see have no weight from then on, whatever instrument a hypothesis has.
    """
    of, count = found.equations, len(run.edges.uv)
    edges, rings = slice(0, count), slice(count, count + len(run.rings.uv))
    return replace(
        run,
        edge_weight=_weight(of, edges, run.edges.sigma_px),
        ring_weight=_weight(of, rings, run.rings.sigma_px),
    )


def _between(rings: BoreRings, posed: Int) -> BoreRings:
    return rings.select((rings.frame >= posed.min()) & (rings.frame <= posed.max()))


def _freed(state: Unknowns) -> Unknowns:
    unsure = prior_directions(state.stated, SheetModel.DECENTRED_WAVY, _FREE)
    return replace(state, unsure=unsure, instrument=np.zeros(unsure.shape[1]))


def _weight(of: Equations, rows: slice, sigma: Float) -> Float:
    seen = of.weight[rows] > 0
    in_sigma = of.residual[rows][seen] / sigma[seen]
    spread = frame_spread(of.frame[rows][seen], in_sigma)
    weight = np.zeros(len(sigma))
    weight[seen] = 1 / (1 + (in_sigma / spread / _CAUCHY) ** 2) / (sigma[seen] * spread) ** 2
    return weight


@dataclass(frozen=True)
class Search:
    """The outcome of the selection.

    Attributes
    ----------
    run : GaugeRun
        Measurements with final weights.
    nothing, found : Fit
        With no effect, and with those selected.
    rivals : tuple of Fit
        Fits in which one of the found effects is replaced or left out.
    scores : tuple of Scored
        All scores about what was found.
    by_chance : float
        Expected number of scores about the stated instrument as large as the largest, when nothing is hidden.
    inflation : float
        Number of measurements with correlated errors that count as one, given the effects found.
    """

    run: GaugeRun
    nothing: Fit
    found: Fit
    rivals: tuple[Fit, ...]
    scores: tuple[Scored, ...]
    by_chance: float
    inflation: float


def search(run: GaugeRun, start: Fit, library: Mapping[str, EffectModel], stated: Stated) -> Search:
    """Add effects while the data require them; whether another set is better is decided in `judge`."""
    found, tried, scanned = start, list[Fit](), list[list[Scored]]()
    while True:
        scanned.append(scan(run, found, library, stated))
        better = refits(run, found, scanned[-1]) if by_chance(scanned[-1]) <= DETECTED else []
        if not better or not _is_needed(better[0], found, scanned[-1]) or len(scanned) > 2 * MOST_EFFECTS:
            break
        tried += [*better, found]
        run, found = _weighed_anew(run, refined(run, better[0]))
    ratio = chi2_inflation(scanned[-1])
    nothing, rivals = fit(run, start.state, ()), _rivals(run, found, tried, ratio)
    return Search(run, nothing, found, rivals, tuple(scanned[-1]), by_chance(scanned[0]), ratio)


def _weighed_anew(run: GaugeRun, found: Fit) -> tuple[GaugeRun, Fit]:
    """Return the run with weights from the residuals of the fit, and the fit with these weights.

    Weights from a fit without an effect reduce its size: where it acts, measurements count as outliers.
    """
    for _ in range(_WEIGHINGS):
        run = weighed(run, found.linearised)
        found = fit(run, found.state, found.terms, 1)
    return run, refined(run, fit(run, found.state, found.terms, _RIVAL_ITERATIONS))


def _rivals(run: GaugeRun, found: Fit, tried: Sequence[Fit], ratio: float) -> tuple[Fit, ...]:
    """Return the nearest fits with other effects, with the run's weights."""
    names, near = {key(found.terms)}, []
    for f in sorted(tried, key=lambda f: f.cost):
        if key(f.terms) not in names and f.cost < found.cost + _FAR * ratio:
            near.append(f)
            names.add(key(f.terms))
    again = (fit(run, f.state, f.terms, _RIVAL_ITERATIONS) for f in near[:_REWEIGHED])
    return tuple(refined(run, f) for f in again)


def by_chance(scores: Sequence[Scored]) -> float:
    """Return the expected number of scores as large as the largest when nothing is hidden."""
    return float(min((s.p_value for s in scores), default=1.0) * max(len(scores), 1))


def refits(run: GaugeRun, found: Fit, scores: Sequence[Scored]) -> list[Fit]:
    """Return the fits with each of the most promising effects added, best first; no impossible sizes."""
    promising = _promising(scores)
    worth = [s for s in promising if s.score.gain > _WORTH_REFITTING * promising[0].score.gain]
    found = found if run.measures_as(found.run) else replace(found, run=run)
    fits: list[Fit] = []
    near, allowed = np.inf, _FAR * chi2_inflation(scores)
    for s in sorted(worth, key=lambda s: -s.score.gain):
        # The linear prediction of a large effect is inaccurate, so that its fit starts from size zero.
        fits.append(fit_beside(found, s.model, s.shape, _RIVAL_ITERATIONS, near))
        near = min(near, fits[-1].cost + allowed)
    possible = [f for f in fits if f.terms[-1].model.possible(f.terms[-1].shape, f.terms[-1].amplitude)]
    return sorted(possible or fits, key=lambda f: f.cost)


def _promising(scores: Sequence[Scored]) -> list[Scored]:
    """Return the scores of largest gain: the best laws, each at its best course, and the best's others."""
    ranked = sorted(scores, key=lambda s: -s.score.gain)
    laws = list(dict.fromkeys(s.model.law for s in ranked))[:_REFITTED]
    best = [next(s for s in ranked if s.model.law == law) for law in laws]
    others = [s for s in ranked if laws and s.model.law == laws[0] and s is not best[0]]
    return [*best, *others[:_OTHER_COURSES]]


def chi2_inflation(scores: Sequence[Scored]) -> float:
    """Return by how much a gain of χ² is overestimated because errors of neighbours are correlated."""
    ratio = [s.score.gain / s.score.statistic for s in scores if s.score.statistic > 1]
    return float(max(np.median(ratio), 1.0)) if ratio else 1.0


def shift_px(found: Fit, term: Term) -> float:
    """Return the RMS shift, px, of rings and fiducials by a term."""
    return max(_shifts_px(found, term))


def ring_shift_alone_px(found: Fit, term: Term) -> float:
    """Return the RMS shift, px, of rings by a term; infinite where it also shifts fiducials."""
    ring, edge = _shifts_px(found, term)
    return np.inf if edge > 0 else ring


def _shifts_px(found: Fit, term: Term) -> tuple[float, float]:
    """Return the RMS shifts, px, of rings and of fiducials by a term."""
    ring = ring_shift_px(term.model, found.linearised.rings, term.shape, term.amplitude)
    edge = np.linalg.norm(
        texture_shift_px(term.model, found.linearised.edges, term.shape, term.amplitude), axis=1
    )
    return float(np.sqrt(np.nanmean(ring**2))), float(np.sqrt(np.nanmean(edge**2)))


def _is_needed(better: Fit, found: Fit, scores: Sequence[Scored]) -> bool:
    """Return whether one more effect gains enough and is large enough relative to the others."""
    *others, last = [shift_px(better, t) for t in better.terms]
    large = not others or last > LEAST_SHARE * max(others)
    gain = found.cost - better.cost
    return len(better.terms) <= MOST_EFFECTS and large and gain > LEAST_GAIN * chi2_inflation(scores)


def _in_own_units(state: Unknowns) -> Unknowns:
    """Return the state with the instrument's corrections in the parameters' own units."""
    correction = state.probe.parameters - state.stated.parameters
    return replace(state, instrument=correction, unsure=np.eye(len(correction)))
