"""How well a hypothesis predicts regimes that it was not fitted to, in px, beside the noise floor."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from stages.diagnose.effects.generic import VOCABULARY
from stages.diagnose.evidence import INSTRUMENT, Evidence, total
from stages.diagnose.gauge.elimination import EDGE, RING, Equations, Part, eliminate_globals, eliminate_poses
from stages.diagnose.gauge.fit import kept_columns, own_unknowns
from stages.diagnose.gauge.judge import Judged, Regime, prior_sigma
from stages.diagnose.gauge.run import GaugeRun, linearise, ring_mm_per_px
from stages.diagnose.inference import Stated, estimate
from stages.diagnose.result import FitQuality

Float = NDArray[np.float64]


def fit_quality(
    run: GaugeRun, nothing: Judged, best: Judged, regimes: Sequence[Regime], stated: Stated
) -> FitQuality:
    """Return the r.m.s. before and after of rings and fiducials, on all and on regimes held out in turn.

    The noise floor is what is left when the patterns of the empirical vocabulary are free in addition.
    """
    everything = Part(np.ones(len(run.time_s), bool))
    floor = _rms_px(run, best, [everything], [None], stated, generic=True)
    before, after = (_rms_px(run, j, [everything], [None], stated) for j in (nothing, best))
    parts = [r.part for r in regimes]
    held = []
    for j in (nothing, best):
        others = [total([e for e in j.by_regime if e is not left]) for left in j.by_regime]
        held.append(_rms_px(run, j, parts, others, stated) if len(parts) > 1 else np.nan)
    return FitQuality("px", before, after, held[0], held[1], floor)


def _rms_px(
    run: GaugeRun, judged: Judged, parts: Sequence[Part], known_from: Sequence[Evidence | None],
    stated: Stated, generic: bool = False,
) -> float:  # fmt: skip
    """Return the r.m.s. of parts of the run, shared unknowns known from elsewhere or free."""
    asked = VOCABULARY if generic else ()
    about = linearise(run, judged.fit.state, judged.fit.terms, asked, with_baseline=True)
    per_px = np.full(len(about.equations.frame), np.nan)
    per_px[about.equations.kind == RING] = ring_mm_per_px(about.rings)
    per_px[about.equations.kind == EDGE] = 1.0
    squares = weights = 0.0
    for part, others in zip(parts, known_from, strict=True):
        use = part.frames[about.equations.frame] & np.isin(about.equations.kind, part.kinds)
        equations = about.equations.of(part)
        reduced = eliminate_poses(equations, about.motion, len(judged.fit.state.T_pc))
        left = eliminate_globals(reduced, own_unknowns(run, judged.fit, equations.by_global.shape[1]))
        columns, value = kept_columns(judged.fit, asked)
        kept = _known(others, judged, columns, value, stated, left.information, left.right)
        step = left.step + left.follow @ kept
        residual = _residual(equations, reduced.pose_step - reduced.pose_by_global @ step, step)
        shown = np.isin(equations.kind, (RING, EDGE))
        in_px = residual[shown] / per_px[use][shown]
        weight = equations.weight[shown] * per_px[use][shown] ** 2
        squares, weights = squares + float(weight @ in_px**2), weights + float(weight.sum())
    return float(np.sqrt(squares / weights))


def _known(
    others: Evidence | None, judged: Judged, columns: Sequence[object], value: Float, stated: Stated,
    information: Float, right: Float,
) -> Float:  # fmt: skip
    """Return the step (K,) of the shared unknowns: from other regimes, or the best in this part itself."""
    if others is None:
        scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
        ridge = information / np.outer(scale, scale) + 1e-9 * np.eye(len(scale))
        moving = np.array([c is not None and getattr(c, "effect", "") != INSTRUMENT for c in columns])
        step = np.zeros(len(scale))
        step[moving] = np.linalg.solve(ridge[np.ix_(moving, moving)], (right / scale)[moving]) / scale[moving]
        return step
    place = {c: k for k, c in enumerate(others.columns)}
    found = estimate(others, stated, prior_sigma(others, judged.fit.terms)).value
    return np.array([
        found[place[c]] - v if c in place else 0.0 for c, v in zip(columns, value, strict=True)
    ])  # fmt: skip


def _residual(equations: Equations, pose: Float, step: Float) -> Float:
    moved = np.einsum("mi,mi->m", equations.by_pose, pose[equations.frame])
    return np.asarray(equations.residual + moved + equations.by_global @ step)
