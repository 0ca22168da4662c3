"""Confirm effects within a gauge run from disjoint parts of it; sizes with all their uncertainties."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Float
from pipeline.physics.effect import CourseKind
from stages.diagnose.agreement import Part as Measured
from stages.diagnose.agreement import agreement, drawn, sized, turn_deg
from stages.diagnose.effects.base import Shape
from stages.diagnose.effects.library import ring_shift_px
from stages.diagnose.gauge.equations import EDGE, RING, Part
from stages.diagnose.gauge.fit import Fit, evidence
from stages.diagnose.gauge.hypotheses import Judged, Regime
from stages.diagnose.gauge.points import SHARP, Moving, moved
from stages.diagnose.gauge.run import GaugeRun, Term
from stages.diagnose.gauge.scan import change_time, freed
from stages.diagnose.gauge.sets import prior_sigma
from stages.diagnose.inference import Evidence, Stated, estimate
from stages.diagnose.result import Confirmation, CourseFound, Value

# Estimates from disjoint measurements agree unless chance makes such a difference less often than this: an
# effect is compared about five times, and noise may contradict it once in a thousand cases.
_AGREE = 2e-4
_LEAST_FRAMES = 8


def confirmations(
    run: GaugeRun, judged: Judged, regimes: Sequence[Regime], terms: Sequence[Term], stated: Stated
) -> tuple[tuple[Confirmation, ...], ...]:
    """Return, for each term, whether disjoint parts of the run agree, each part against all the others."""
    shared = [_by_bore(regimes), _by_direction(run, judged)]
    parts = [[*shared, _by_half(run, term)] for term in terms]
    everything = np.ones(len(run.time_s), bool)
    distinct = {(where, p.frames.tobytes()): p for groups in parts for each in groups for where, p in each}
    kinds = [Part(everything, (EDGE,)), Part(everything, (EDGE, RING))]
    _, edges, both, *said = evidence(run, judged.fit, (), [*kinds, *distinct.values()])
    known = dict(zip(distinct, said, strict=True))
    out = []
    for term, groups in zip(terms, parts, strict=True):
        compared = []
        for each in groups:
            of_parts = [(where, known[where, p.frames.tobytes()]) for where, p in each]
            partial = [partial_of(where, e, judged, term, stated) for where, e in of_parts]
            pairs = itertools.pairwise(p for p in partial if p is not None)
            compared += [_compared(a, b, term) for a, b in pairs]
        compared.append(_by_kind(edges, both, judged, term, stated))
        reliable = term.model.kind is not CourseKind.STEP or passes_again(
            run, judged.fit.state.T_pc, term.shape[0]
        )
        out.append(tuple(c for c in compared if reliable and c is not None))
    return tuple(out)


def passes_again(run: GaugeRun, T_pc: Float, step_s: float) -> bool:
    """Return whether the probe is on the same stretch of the pipe before and after a step.

    If not, the step may be a place instead: a gauge that differs from its drawing from there on.
    """
    along, after = T_pc[:, 2, 3], run.time_s - run.time_s[0] >= step_s
    if after.all() or not after.any():
        return False
    low = max(along[after].min(), along[~after].min())
    high = min(along[after].max(), along[~after].max())
    shared = (along >= low) & (along <= high)
    return bool(min((shared & after).sum(), (shared & ~after).sum()) >= _LEAST_FRAMES)


def partial_of(where: str, part: Evidence, judged: Judged, term: Term, stated: Stated) -> Measured | None:
    """Return the term's amplitudes from a part of the measurements, with the other terms free."""
    result = estimate(part, stated, 10 * prior_sigma(part, judged.fit.terms))
    wanted = [(term.model.name, a.name, term.shape) for a in term.amplitudes]
    keys = [(c.effect, c.amplitude, c.shape) for c in part.columns]
    at = [keys.index(w) for w in wanted]
    if not np.all(np.diag(part.information)[at] > 0):
        return None
    # For a difference of evidence of two kinds, the spread may come out below that of independent errors.
    ratio = np.diag(part.score_covariance)[at] / np.diag(part.information)[at]
    inflation = np.sqrt(np.maximum(ratio, 1.0))
    covariance = result.covariance[np.ix_(at, at)] * np.outer(inflation, inflation)
    return Measured(where, "", result.value[at], covariance)


def _by_bore(regimes: Sequence[Regime]) -> list[tuple[str, Part]]:
    """Return the parts of the run that are within one bore each."""
    out = []
    for section in sorted({r.section for r in regimes}):
        mask = np.any([r.part.frames for r in regimes if r.section == section], axis=0)
        out.append((f"bore {section + 1}", Part(mask)))
    return out


def _by_direction(run: GaugeRun, judged: Judged) -> list[tuple[str, Part]]:
    speed = np.gradient(judged.fit.state.T_pc[:, 2, 3], run.time_s)
    masks = [("forward travel", speed > 0), ("backward travel", speed < 0)]
    if min(m.sum() for _, m in masks) < _LEAST_FRAMES:
        return []
    return [(where, Part(mask)) for where, mask in masks]


def _by_half(run: GaugeRun, term: Term) -> list[tuple[str, Part]]:
    """Return the halves of the run, or of what follows a step."""
    step = term.model.kind is CourseKind.STEP
    begun = run.time_s - run.time_s[0] >= (term.shape[0] if step else 0.0)
    if begun.sum() < 2 * _LEAST_FRAMES:
        return []
    early = run.time_s < np.median(run.time_s[begun])
    return [("first half", Part(begun & early)), ("second half", Part(begun & ~early))]


def _compared(first: Measured, second: Measured, term: Term) -> Confirmation | None:
    """Return whether two estimates agree in sign and size; None when either is too uncertain."""
    size = float(np.linalg.norm(term.amplitude))
    found = agreement(_in_words(first, term), _in_words(second, term), size=size, rarest=_AGREE)
    return found.confirmation if found is not None else None


def _in_words(part: Measured, term: Term) -> Measured:
    return replace(part, words=sized(term.model, term.shape, part.value, part.covariance))


def _by_kind(
    edges: Evidence, both: Evidence, judged: Judged, term: Term, stated: Stated
) -> Confirmation | None:
    """Return fiducials against rings: the camera affects both, the sheet only the rings."""
    if not _seen(edges, term):
        return None
    from_edges = partial_of("fiducials alone", edges, judged, term, stated)
    rings = Evidence(
        both.columns, both.information - edges.information, both.right - edges.right,
        both.score_covariance - edges.score_covariance, both.misfit - edges.misfit, both.degrees,
    )  # fmt: skip
    from_rings = partial_of("rings alone", rings, judged, term, stated)
    if from_edges is None or from_rings is None:
        return None
    return _compared(from_edges, from_rings, term)


def _seen(edges: Evidence, term: Term) -> bool:
    at = [k for k, c in enumerate(edges.columns) if c.effect == term.model.name]
    return bool(np.all(np.diag(edges.information)[at] > 0))


@dataclass(frozen=True)
class Sized:
    """A term, its continuous shape free, with the covariance (Q, Q) of its amplitudes.

    ``time_s`` is the time of a step.
    """

    term: Term
    covariance: Float
    time_s: Value | None = None


def sizes_of(run: GaugeRun, judged: Judged, stated: Stated, inflation: float) -> tuple[Sized, ...]:
    """Return the terms of a hypothesis with covariances from data, shapes, and the accuracy of laws."""
    free = freed(run, judged.fit)
    whole = judged.evidence if free is judged.fit else evidence(run, free, ())[0]
    about = replace(judged, fit=free, evidence=whole)
    sized = [_sized(run, about, term, stated) for term in free.terms]
    return tuple(
        replace(s, time_s=change_time(run, free, k, inflation)) if s.term.model.kind is CourseKind.STEP else s
        for k, s in enumerate(sized)
    )


def _sized(run: GaugeRun, judged: Judged, term: Term, stated: Stated) -> Sized:
    part = partial_of("all", judged.evidence, judged, term, stated)
    covariance = part.covariance if part is not None else np.zeros((len(term.amplitude),) * 2)
    share = np.hypot(term.model.law_sigma, lost_motion(run, judged.fit, term))
    return Sized(term, covariance + share**2 * np.outer(term.amplitude, term.amplitude))


def lost_motion(run: GaugeRun, found: Fit, term: Term) -> float:
    """Return by which fraction a term's size is too large because rates over many frames lose fast motion.

    If a law is proportional to the motion c, of which k is kept, its size comes out ⟨c, k⟩ / ⟨k, k⟩ times too
    large. Rates over few frames stand for c: independent noise of the poses adds the same to both products.
    """
    points = found.at(run).rings
    sharp = moved(points, Moving.of(found.state.T_pc, run.time_s, SHARP), run.rings.outward)
    kept, whole = (ring_shift_px(term.model, p, *term.at(term.amplitude)) for p in (points, sharp))
    return float(abs(1 - kept @ kept / (whole @ kept))) if whole @ kept else 0.0


def quantities(sized: Sized) -> dict[str, Value]:
    """Return the catalogue's quantities with 1 σ."""
    return _numbers(sized, sized.term.model.quantities)


def course_of(sized: Sized) -> CourseFound:
    """Return the term's course with 1 σ."""
    numbers = _numbers(sized, sized.term.model.course)
    if sized.time_s is not None:
        numbers["time_s"] = sized.time_s
    return CourseFound(str(sized.term.model.kind), numbers)


def _numbers(sized: Sized, numbers: Callable[[Shape, Float], dict[str, float]]) -> dict[str, Value]:
    term = sized.term
    turn = turn_deg(term.model, *term.at(term.amplitude))
    return drawn(lambda a: numbers(*term.at(a)), term.amplitude, sized.covariance, turn)
