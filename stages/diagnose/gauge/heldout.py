"""How well a hypothesis predicts regimes that it was not fitted to, in px, beside the noise floor."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.spatial import cKDTree

from pipeline.arrays import Bool, Float, Int
from stages.calibrate.gauge.edges import Edges
from stages.diagnose.effects.courses import of_own_clock
from stages.diagnose.gauge.elimination import EDGE, RING, Equations, Part, eliminate_globals, eliminate_poses
from stages.diagnose.gauge.fit import Fit, evidence, kept_columns, own_unknowns
from stages.diagnose.gauge.hypotheses import Judged, Regime
from stages.diagnose.gauge.linearise import asking
from stages.diagnose.gauge.points import BASELINE_SIZE
from stages.diagnose.gauge.run import GaugeRun
from stages.diagnose.gauge.sets import prior_sigma
from stages.diagnose.inference import INSTRUMENT, Column, Evidence, Stated, estimate, total
from stages.diagnose.result import FitQuality

_RIDGE = 1e-9
# What is predicted; the encoder's readings have no say in it, because they may be wrong themselves.
_SEEN_KINDS = (RING, EDGE)
# So long that the poses of a block hold together, so short that several lie on either side of an event.
_BLOCK_FRAMES = 8
_SAME_AZIMUTH_RAD = np.radians(3.0)
# Two edges of other pictures are at one place where the instrument's error is alike, as two rings are at one
# azimuth: 3° of a circle of 400 px; how many near ones are looked through for one of another picture.
_SAME_PLACE_PX, _SAME_STEEPNESS_RAD, _NEIGHBOURS = 20.0, np.radians(15.0), 40
# What reflectance and relief do to a line is alike over a few mm of wall. Debt: data/debts.md.
_OTHER_WALL_MM = 10.0


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
    """Return the r.m.s. before and after of rings and fiducials, on all and on parts held out in turn.

    Before is with the instrument exactly as stated. Parts are the regimes; with a course in the run's own
    time they are blocks of frames by turns: what comes after a step is not to be told from before it.
    """
    everything = [Part(np.ones(len(run.time_s), bool), _SEEN_KINDS)]
    floor = repeatability_px(run, best.fit)
    before = _rms_px(run, nothing, everything, [_as_stated])
    after = _rms_px(run, best, everything, [_free])
    parts = [replace(r.part, kinds=_SEEN_KINDS) for r in regimes]
    if len(parts) < 2:
        return FitQuality("px", before, after, np.nan, np.nan, floor)
    by_part: Sequence[Evidence] = best.by_regime
    if any(of_own_clock(t.model) for t in best.fit.terms):
        parts = [Part(frames, _SEEN_KINDS) for frames in _by_turns(len(run.time_s))]
        every = [Part(p.frames) for p in parts]
        by_part = evidence(run, best.fit, (), every, with_spread=False)[1:]
    learned = [
        partial(_from_others, total([e for e in by_part if e is not left]), best.fit, stated)
        for left in by_part
    ]
    held_before = _rms_px(run, nothing, parts, [_as_stated] * len(parts))
    return FitQuality("px", before, after, held_before, _rms_px(run, best, parts, learned), floor)


def _by_turns(frames: int) -> list[Bool]:
    """Return masks (N,) of the frames in every other block, and in the rest."""
    block = np.arange(frames) // _BLOCK_FRAMES
    return [block % 2 == k for k in range(2)]


def repeatability_px(run: GaugeRun, found: Fit) -> float:
    """Return the r.m.s. noise of rings and fiducials, of image and wall.

    Of rings it is what two of them differ by at the same azimuth on other wall of the same bore, over √2; of
    fiducials what edges differ by that other pictures show at the same place of the image, or their stated σ
    where that is more: samples of one fiducial may err alike. An error of the instrument that is left is
    alike in both, so that a bad fit makes no larger floor. A kind that repeats nowhere is left out; NaN where
    neither does.
    """
    equations = found.linearised.equations
    ring, edge = equations.kind == RING, equations.kind == EDGE
    of_rings, of_edges = equations.weight[ring], equations.weight[edge]
    stated = float(of_edges @ run.edges.sigma_px**2) / max(float(of_edges.sum()), 1e-300)
    edges = variance_of_pairs(equations.residual[edge], of_edges, *_in_other_pictures(run.edges))
    along_mm = found.state.T_pc[run.rings.frame, 2, 3]
    azimuth = np.arctan2(run.rings.outward[:, 1], run.rings.outward[:, 0])
    pairs = on_other_wall(azimuth, run.rings.frame, along_mm, run.rings.section)
    rings = variance_of_pairs(equations.residual[ring], of_rings, *pairs)
    # Without pairs NumPy's maximum stays NaN, where Python's may not.
    variance = np.array([rings, np.maximum(edges, stated)])
    weight = np.where(np.isfinite(variance), [of_rings.sum(), of_edges.sum()], 0.0)
    return float(np.sqrt(weight @ np.nan_to_num(variance) / weight.sum())) if weight.any() else float("nan")


def variance_of_pairs(value: Float, weight: Float, first: Int, second: Int) -> float:
    """Return the variance that pairs (P,) of values (M,) show, whatever both have in common.

    It is NaN without pairs. With the product of weights independent errors come to just their weighted mean
    square.
    """
    both = weight[first] * weight[second]
    used = both > 0
    if not used.any():
        return float("nan")
    return float(np.average((value[second] - value[first])[used] ** 2, weights=both[used])) / 2


def _in_other_pictures(edges: Edges) -> tuple[Int, Int]:
    """Return pairs (P,) of fiducials' edges of other pictures, at one place of the image and as steep.

    Edges that the camera model sees nowhere have no place.
    """
    place = np.concatenate([edges.uv / _SAME_PLACE_PX, edges.normal / _SAME_STEEPNESS_RAD], axis=1)
    seen = np.flatnonzero(np.isfinite(place).all(axis=1))
    if len(seen) < 2:
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    apart, near = cKDTree(place[seen]).query(place[seen], k=min(_NEIGHBOURS, len(seen)))
    near, frame = np.asarray(near), edges.frame[seen]
    other = (frame[near] != frame[:, None]) & (apart < 1)
    first = np.flatnonzero(other.any(axis=1))
    return seen[first], seen[near[first, np.argmax(other[first], axis=1)]]


def on_other_wall(azimuth_rad: Float, frame: Int, along_mm: Float, section: Int) -> tuple[Int, Int]:
    """Return pairs (P,) of ring bins of one azimuth and bore, as near in time as other wall allows.

    Parameters
    ----------
    azimuth_rad, frame, along_mm, section : (M,)
        In the image; where along the pipe; in which bore.
    """
    turn, apart = turns_apart(frame, along_mm)
    first, second = at_one_azimuth(azimuth_rad, turn, apart, 2 * apart)
    alike = section[first] == section[second]
    return first[alike], second[alike]


def turns_apart(frame: Int, along_mm: Float) -> tuple[Int, int]:
    """Return which (M,) of all frames each is, and how many frames are apart so as to show other wall."""
    frames, at, turn = np.unique(frame, return_index=True, return_inverse=True)
    step_mm = float(np.median(np.abs(np.diff(along_mm[at])))) if len(frames) > 1 else np.inf
    apart = min(max(int(np.ceil(_OTHER_WALL_MM / max(step_mm, 1e-9))), 1), max(len(frames) // 4, 1))
    return turn, apart


def at_one_azimuth(azimuth_rad: Float, turn: Int, apart: int, most: int) -> tuple[Int, Int]:
    """Return pairs (P,) of ring bins (M,) of one azimuth, each with the one ``apart`` places on.

    Where frames are missing there they are farther apart, but by no more than ``most`` frames.
    """
    place = np.round(azimuth_rad / _SAME_AZIMUTH_RAD).astype(np.int64)
    order = np.lexsort((turn, place))
    first, second = order[:-apart], order[apart:]
    alike = (place[first] == place[second]) & (turn[second] - turn[first] <= most)
    return first[alike], second[alike]


def _rms_px(run: GaugeRun, judged: Judged, parts: Sequence[Part], rules: Sequence[Rule]) -> float:
    """Return the weighted r.m.s. of parts of the run, each with its poses and own unknowns at their best."""
    about = judged.fit.at(run)
    # Smooth patterns of a hundredth of a pixel would take up what is asked about: they stay out of it.
    whole = asking(run, judged.fit.state, about, (), with_baseline=True)
    whole.by_global[:, -BASELINE_SIZE:] = 0.0
    columns, value = kept_columns(judged.fit, ())
    squares = weights = 0.0
    for part, rule in zip(parts, rules, strict=True):
        equations = whole.of(part)
        reduced = eliminate_poses(equations, about.motion, len(judged.fit.state.T_pc))
        left, _ = eliminate_globals(reduced, own_unknowns(run, judged.fit, equations.size))
        step = left.step + left.follow @ rule(Shared(columns, value, left.information, left.right))
        residual = _residual(equations, reduced.pose_step - reduced.pose_by_global @ step, step)
        # What is off the camera model has no weight, and no residual either.
        shown = np.isin(equations.kind, (RING, EDGE)) & (equations.weight > 0)
        weight = equations.weight[shown]
        squares += float(weight @ residual[shown] ** 2)
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
    by_edge = np.where(equations.edge >= 0, step[equations.edge], 0.0) * equations.by_edge
    return np.asarray(equations.residual + moved + by_edge + equations.by_global @ step[equations.place])
