"""Selection of effects on a gauge run: weigh it, score all, refit with the best few, keep what is needed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.adjustment.levenberg_marquardt import Watch, unwatched
from pipeline.adjustment.motion_priors import third_difference_sigma
from pipeline.arrays import Float, Int
from stages.calibrate.gauge import MeasuredRun
from stages.calibrate.gauge.adjust import adjust
from stages.calibrate.gauge.geometry import BoreRings
from stages.calibrate.gauge.state import GaugeParameters, SheetModel, Unknowns, prior_directions
from stages.calibrate.gauge.terms import frame_spread
from stages.diagnose.effects.base import EffectModel
from stages.diagnose.effects.library import ring_shift_px, texture_shift_px
from stages.diagnose.gauge.fit import Fit, fit, fit_beside, own_parameters
from stages.diagnose.gauge.linearise import linearise
from stages.diagnose.gauge.points import bin_widths
from stages.diagnose.gauge.run import GaugeRun, Linearised, Term
from stages.diagnose.gauge.scan import Scored, refined, scan
from stages.diagnose.inference import Stated

# Something was left out when its probability by chance, corrected for all tried, is below this.
# Debt: data/debts.md.
DETECTED = 1e-4
_REFITTED = 4
_OTHER_COURSES = 2
_MOST_EFFECTS = 6
# So many effects are looked through together, once; of two each way is tried at once.
_FEW = 3
_WORTH_REFITTING = 0.1
_LEAST_GAIN = 20.0
_RIVAL_ITERATIONS = 5
# Rivals whose χ² is worse by more than this are not considered; how often and which weights are recomputed.
# Debt: data/debts.md.
_FAR, _REWEIGHED, _WEIGHINGS = 100.0, 4, 3
# A further effect or pattern smaller than this share of the first may be an error of the first one's law.
# Debt: data/debts.md.
LEAST_SHARE = 0.01
_CAUCHY = 2.5
# A bore is not believed to be better known than this. Debt: data/debts.md.
_LEAST_BORE_SIGMA_MM = 1e-3
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


def prepare(measured_run: MeasuredRun, watch: Watch = unwatched) -> tuple[GaugeRun, Unknowns]:
    """Return the run's measurements, and poses by an instrument free to follow whatever is there.

    Rings before the first frame with fiducials and after the last do not count: a ring alone does not tell
    how the probe is turned, and poses drift there.
    """
    measured, source, posed = measured_run.measured, measured_run.source, measured_run.posed
    measured = replace(measured, rings=_between(measured.rings, posed))
    loose = adjust(_freed(measured_run.start), measured, _FREE, watch).state
    rings = _between(source.on_bore(loose.T_pc, loose.probe, _FREE), posed)
    sigma = third_difference_sigma(loose.T_pc, posed)
    smooth = adjust(loose, replace(measured, rings=rings, smooth_sigma=sigma), _FREE, watch).state
    rings = _between(source.on_bore(smooth.T_pc, smooth.probe, _FREE), posed)
    run = GaugeRun(
        measured.edges, rings, bin_widths(source.rings, source.index, rings),
        measured.time_s, measured.encoder,
        max(measured.bore_sigma_mm, _LEAST_BORE_SIGMA_MM), _LOOSER * sigma,
        measured.edges.sigma_px**-2, np.ones(len(rings.frame)), watch,
    )  # fmt: skip
    return weighed(run, linearise(run, smooth, ())), stated_start(smooth)


def stated_start(state: Unknowns) -> Unknowns:
    """Return the poses of a state with the stated instrument."""
    return own_parameters(
        replace(state, instrument=0 * state.instrument, bore_mm=0 * state.bore_mm, edge_mm=0 * state.edge_mm)
    )


def weighed(run: GaugeRun, found: Linearised) -> GaugeRun:
    """Return the run with weights by the residuals' spread frame by frame, outliers counting little."""
    assert found.rings.per_px_c is not None
    of, count = found.equations, len(run.edges.uv)
    edges, rings = slice(0, count), slice(count, count + len(run.rings.uv))
    sigma_mm = run.rings.sigma_px * np.linalg.norm(found.rings.per_px_c, axis=1)
    return replace(
        run,
        edge_weight=_weight(of.frame[edges], of.residual[edges], run.edges.sigma_px),
        ring_weight=_weight(of.frame[rings], of.residual[rings], sigma_mm),
    )


def _between(rings: BoreRings, posed: Int) -> BoreRings:
    return rings.select((rings.frame >= posed.min()) & (rings.frame <= posed.max()))


def _freed(state: Unknowns) -> Unknowns:
    unsure = prior_directions(state.stated, SheetModel.DECENTRED_WAVY, _FREE)
    return replace(state, unsure=unsure, instrument=np.zeros(unsure.shape[1]))


def _weight(frame: Int, residual: Float, sigma: Float) -> Float:
    in_sigma = residual / sigma
    spread = frame_spread(frame, in_sigma)
    return np.asarray(1 / (1 + (in_sigma / spread / _CAUCHY) ** 2) / (sigma * spread) ** 2)


@dataclass(frozen=True)
class Step:
    """One step of the selection: the fit it starts from, all scores there, and the refits tried.

    ``by_chance`` is how many scores as large as the largest are expected when nothing more is hidden.
    """

    before: Fit
    scores: tuple[Scored, ...]
    tried: tuple[Fit, ...]
    by_chance: float


@dataclass(frozen=True)
class Search:
    """The selection's outcome.

    Attributes
    ----------
    run : GaugeRun
        Measurements with final weights.
    nothing, found : Fit
        With no effect, and with those selected.
    rivals : tuple of Fit
        Fits with another effect in one found one's place, or without one.
    steps : tuple of Step
    alike : float
        How many measurements that err alike count as one, after the effects found.
    """

    run: GaugeRun
    nothing: Fit
    found: Fit
    rivals: tuple[Fit, ...]
    steps: tuple[Step, ...]
    alike: float

    def watched(self, watch: Watch) -> Search:
        """Return the outcome with another watch, whichever of its fits is gone on from."""
        return replace(
            self, run=replace(self.run, watch=watch), nothing=self.nothing.watched(watch),
            found=self.found.watched(watch), rivals=tuple(f.watched(watch) for f in self.rivals),
        )  # fmt: skip


def search(run: GaugeRun, start: Fit, library: Mapping[str, EffectModel], stated: Stated) -> Search:
    """Add effects while the data ask for them; then see whether rivals do better in their places.

    A rival in an earlier one's place is looked for when the second effect comes, because the first was found
    with all others still there, and once more when nothing more is asked for.
    """
    nothing, found, steps = start, start, []
    rivals: tuple[Fit, ...] = ()
    exchanged = False
    while True:
        step, better = _extended(run, found, library, stated)
        steps.append(step)
        at_end = better is None or len(better.terms) > _MOST_EFFECTS
        if at_end and (exchanged or len(found.terms) < _FEW):
            break
        better, tried = refined(run, better) if better is not None and not at_end else found, step.tried
        if at_end or len(better.terms) == _FEW - 1:
            better, others = _exchanged(run, better, () if at_end else step.tried, library, stated)
            tried, exchanged = (*others, found), at_end
        run, found, rivals = _weighed_anew(run, better, (*tried, *rivals), alike(step.scores))
        nothing = fit(run, start.state, ())
    return Search(run, nothing, found, tuple(rivals), tuple(steps), alike(steps[-1].scores))


def _weighed_anew(
    run: GaugeRun, found: Fit, tried: Sequence[Fit], ratio: float
) -> tuple[GaugeRun, Fit, tuple[Fit, ...]]:
    """Return the run with weights by what the fit leaves, and the fit and its near rivals with these.

    Weights from a fit without an effect hold its size back: where it acts, measurements count as outliers.
    """
    names = [t.model.name for t in found.terms]
    near = [f for f in tried if f.cost < found.cost + _FAR * ratio]
    others = [f for f in near if [t.model.name for t in f.terms] != names]
    for _ in range(_WEIGHINGS):
        run = weighed(run, found.linearised)
        found = fit(run, found.state, found.terms, 1)
    found = refined(run, fit(run, found.state, found.terms, _RIVAL_ITERATIONS))
    rest = (
        refined(run, fit(run, f.state, f.terms, _RIVAL_ITERATIONS))
        for f in sorted(others, key=lambda f: f.cost)[:_REWEIGHED]
    )
    return run, *_sorted(found, list(rest))


def by_chance(scores: Sequence[Scored]) -> float:
    """Return how many scores as large as the largest are expected when nothing is hidden."""
    return float(min((s.p_value for s in scores), default=1.0) * max(len(scores), 1))


def refits(run: GaugeRun, found: Fit, scores: Sequence[Scored], most: int = _REFITTED) -> list[Fit]:
    """Return the fits with each of the most promising effects added, best first; no impossible sizes."""
    promising = _promising(scores, most)
    worth = [s for s in promising if s.score.gain > _WORTH_REFITTING * promising[0].score.gain]
    found = found if run.measures_as(found.run) else replace(found, run=run)
    fits: list[Fit] = []
    near, allowed = np.inf, _FAR * alike(scores)
    for s in sorted(worth, key=lambda s: -s.score.gain):
        # The linear prediction of a large effect is wrong, so that its fit starts from size zero.
        fits.append(fit_beside(found, s.model, s.shape, _RIVAL_ITERATIONS, near))
        near = min(near, fits[-1].cost + allowed)
    possible = [f for f in fits if f.terms[-1].model.possible(f.terms[-1].shape, f.terms[-1].amplitude)]
    return sorted(possible or fits, key=lambda f: f.cost)


def _promising(scores: Sequence[Scored], most: int) -> list[Scored]:
    """Return the scores of the most gain: so many laws with their best courses, and the best law's others."""
    ranked = sorted(scores, key=lambda s: -s.score.gain)
    laws = list(dict.fromkeys(s.model.law for s in ranked))[:most]
    best = [next(s for s in ranked if s.model.law == law) for law in laws]
    others = [s for s in ranked if laws and s.model.law == laws[0] and s is not best[0]]
    return [*best, *others[:_OTHER_COURSES]]


def alike(scores: Sequence[Scored]) -> float:
    """Return by how much a gain of χ² is overestimated because neighbouring errors are correlated."""
    ratio = [s.score.gain / s.score.statistic for s in scores if s.score.statistic > 1]
    return float(max(np.median(ratio), 1.0)) if ratio else 1.0


def shift_px(found: Fit, term: Term) -> float:
    """Return the r.m.s. shift in px of rings and fiducials by a term."""
    ring = ring_shift_px(term.model, found.linearised.rings, term.shape, term.amplitude)
    edge = np.linalg.norm(
        texture_shift_px(term.model, found.linearised.edges, term.shape, term.amplitude), axis=1
    )
    return float(max(np.sqrt(np.nanmean(ring**2)), np.sqrt(np.nanmean(edge**2))))


def _extended(
    run: GaugeRun, found: Fit, library: Mapping[str, EffectModel], stated: Stated
) -> tuple[Step, Fit | None]:
    scores = scan(run, found, library, stated)
    expected = by_chance(scores)
    if expected > DETECTED:
        return Step(found, tuple(scores), (), expected), None
    tried = refits(run, found, scores)
    step = Step(found, tuple(scores), tuple(tried), expected)
    best = tried[0]
    needed = found.cost - best.cost > _LEAST_GAIN * alike(scores) and _counts(best)
    return step, best if needed else None


def _counts(found: Fit) -> bool:
    """Return whether the last effect is large enough beside the others to count."""
    sizes = [shift_px(found, t) for t in found.terms]
    return len(sizes) < 2 or sizes[-1] > LEAST_SHARE * max(sizes[:-1])


def _exchanged(
    run: GaugeRun, found: Fit, tried: Sequence[Fit], library: Mapping[str, EffectModel], stated: Stated
) -> tuple[Fit, tuple[Fit, ...]]:
    """Try another effect in each earlier term's place; the last one's rivals were tried when it came.

    An effect may come back with another frequency or time constant, now that what disturbed it is taken out.
    """
    every = [found, *tried]
    for k in range(len(found.terms) - 1):
        others = found.terms[:k] + found.terms[k + 1 :]
        reduced = fit(run, found.state, others, _RIVAL_ITERATIONS)
        term = found.terms[k]
        taken = {term.model.name} if term.model.shape_step(term.shape) is None else set()
        scores = [s for s in scan(run, reduced, library, stated) if s.model.name not in taken]
        every += [reduced, *(refined(run, f) for f in refits(run, reduced, scores, 3))]
    return _sorted(every[0], every[1:])


def _sorted(found: Fit, others: Sequence[Fit]) -> tuple[Fit, tuple[Fit, ...]]:
    """Return the fit of the least cost among those with as many terms, and all others."""
    full = [f for f in (found, *others) if len(f.terms) == len(found.terms)]
    best = min(full, key=lambda f: f.cost)
    return best, tuple(f for f in (found, *others) if f is not best)
