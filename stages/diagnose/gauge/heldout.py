"""How well a hypothesis predicts regimes that it was not fitted to, in px, beside the noise floor."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from pipeline.arrays import Float
from stages.diagnose.effects.base import EffectModel, Shape
from stages.diagnose.effects.generic import VOCABULARY
from stages.diagnose.gauge.elimination import EDGE, RING, Equations, Part, eliminate_globals, eliminate_poses
from stages.diagnose.gauge.fit import Fit, kept_columns, own_unknowns
from stages.diagnose.gauge.judge import Judged, Regime, prior_sigma
from stages.diagnose.gauge.points import BASELINE_SIZE
from stages.diagnose.gauge.run import GaugeRun, linearise, ring_mm_per_px
from stages.diagnose.inference import INSTRUMENT, Column, Evidence, Stated, estimate, total
from stages.diagnose.result import FitQuality

_RIDGE = 1e-9


@dataclass(frozen=True)
class Shared:
    """The shared unknowns of one part of the run: their columns, present values, and normal equations."""

    columns: Sequence[Column | None]
    value: Float
    information: Float
    right: Float


# From the shared unknowns of a part to their step (K,).
Rule = Callable[[Shared], Float]


def fit_quality(
    run: GaugeRun, nothing: Judged, best: Judged, regimes: Sequence[Regime], stated: Stated
) -> FitQuality:
    """Return the r.m.s. before and after of rings and fiducials, on all and on regimes held out in turn.

    Before is with the instrument exactly as stated. The noise floor is what is left when the patterns of the
    empirical vocabulary are free in addition.
    """
    everything = [Part(np.ones(len(run.time_s), bool))]
    floor = _rms_px(run, best, everything, [_free], VOCABULARY)
    before = _rms_px(run, nothing, everything, [_as_stated])
    after = _rms_px(run, best, everything, [_free])
    parts = [r.part for r in regimes]
    if len(parts) < 2:
        return FitQuality("px", before, after, np.nan, np.nan, floor)
    learned = [
        partial(_from_others, total([e for e in best.by_regime if e is not left]), best.fit, stated)
        for left in best.by_regime
    ]
    held_before = _rms_px(run, nothing, parts, [_as_stated] * len(parts))
    return FitQuality("px", before, after, held_before, _rms_px(run, best, parts, learned), floor)


def _rms_px(
    run: GaugeRun, judged: Judged, parts: Sequence[Part], rules: Sequence[Rule],
    asked: Sequence[tuple[EffectModel, Shape]] = (),
) -> float:  # fmt: skip
    """Return the weighted r.m.s. of parts of the run, each with its poses and own unknowns at their best."""
    about = linearise(run, judged.fit.state, judged.fit.terms, asked, with_baseline=True)
    # Smooth patterns of a hundredth of a pixel would take up what is asked about: they stay out of it.
    about.equations.by_global[:, -BASELINE_SIZE:] = 0.0
    per_px = np.full(len(about.equations.frame), np.nan)
    per_px[about.equations.kind == RING] = ring_mm_per_px(about.rings)
    per_px[about.equations.kind == EDGE] = 1.0
    columns, value = kept_columns(judged.fit, asked)
    squares = weights = 0.0
    for part, rule in zip(parts, rules, strict=True):
        use = part.frames[about.equations.frame] & np.isin(about.equations.kind, part.kinds)
        equations = about.equations.of(part)
        reduced = eliminate_poses(equations, about.motion, len(judged.fit.state.T_pc))
        left, _ = eliminate_globals(reduced, own_unknowns(run, judged.fit, equations.by_global.shape[1]))
        step = left.step + left.follow @ rule(Shared(columns, value, left.information, left.right))
        residual = _residual(equations, reduced.pose_step - reduced.pose_by_global @ step, step)
        # What is off the camera model has no weight, and no residual either.
        shown = np.isin(equations.kind, (RING, EDGE)) & (equations.weight > 0)
        weight = equations.weight[shown] * per_px[use][shown] ** 2
        squares += float(weight @ (residual[shown] / per_px[use][shown]) ** 2)
        weights += float(weight.sum())
    return float(np.sqrt(squares / weights))


def _as_stated(shared: Shared) -> Float:
    """Go back to the stated instrument."""
    return -shared.value


def _free(shared: Shared) -> Float:
    """Let effects go to their best in the part itself, the instrument staying."""
    scale = np.sqrt(np.maximum(np.diag(shared.information), 1e-300))
    ridge = shared.information / np.outer(scale, scale) + _RIDGE * np.eye(len(scale))
    free = np.array([c is not None and c.effect != INSTRUMENT for c in shared.columns], bool)
    step = np.zeros(len(scale))
    step[free] = np.linalg.solve(ridge[np.ix_(free, free)], (shared.right / scale)[free]) / scale[free]
    return step


def _from_others(others: Evidence, found: Fit, stated: Stated, shared: Shared) -> Float:
    """Take what other regimes say."""
    known = estimate(others, stated, prior_sigma(others, found.terms)).value
    place = {c: k for k, c in enumerate(others.columns)}
    return np.array(
        [
            known[place[c]] - v if c in place else 0.0
            for c, v in zip(shared.columns, shared.value, strict=True)
        ]
    )


def _residual(equations: Equations, pose: Float, step: Float) -> Float:
    moved = np.einsum("mi,mi->m", equations.by_pose, pose[equations.frame])
    return np.asarray(equations.residual + moved + equations.by_global @ step)
