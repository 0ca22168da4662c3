"""How well a hypothesis predicts regimes that it was not fitted to, in px, compared with the noise floor."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.spatial import cKDTree

from pipeline.arrays import Bool, Float, Int
from stages.calibrate.gauge.edges import Edges
from stages.diagnose.effects.courses import of_own_clock
from stages.diagnose.gauge.elimination import FrameSums, eliminate_globals
from stages.diagnose.gauge.equations import EDGE, RING, Equations, Part
from stages.diagnose.gauge.fit import Fit, evidence, kept_columns, own_unknowns
from stages.diagnose.gauge.hypotheses import Judged, Regime
from stages.diagnose.gauge.linearise import asking
from stages.diagnose.gauge.points import BASELINE_SIZE
from stages.diagnose.gauge.run import GaugeRun
from stages.diagnose.gauge.sets import prior_sigma
from stages.diagnose.inference import INSTRUMENT, Column, Evidence, Stated, estimate, total
from stages.diagnose.result import FitQuality

_RIDGE = 1e-9
# Kinds of measurements that are predicted; encoder readings are not used, because they may be wrong
# themselves.
_SEEN_KINDS = (RING, EDGE)
# Long enough that the poses within a block are consistent, short enough that several lie on each side of an
# event.
_BLOCK_FRAMES = 8
_SAME_AZIMUTH_RAD = np.radians(3.0)
# Two edges in different pictures are at one place where the instrument's error is the same, like two rings at
# one azimuth: 3° of a circle of 400 px. Number of near edges among which one of another picture is sought.
_SAME_PLACE_PX, _SAME_STEEPNESS_RAD, _NEIGHBOURS = 20.0, np.radians(15.0), 40
# Errors by reflectance and relief are correlated over a few mm of wall. Debt: data/debts.md.
_OTHER_WALL_MM = 10.0


@dataclass(frozen=True)
class Shared:
    """The shared unknowns of one part of the run: columns, present values, and normal equations."""

    columns: Sequence[Column | None]
    value: Float
    information: Float
    right: Float


# Maps the shared unknowns of a part to their step (K,).
Rule = Callable[[Shared], Float]


def fit_quality(
    run: GaugeRun, nothing: Judged, best: Judged, regimes: Sequence[Regime], stated: Stated
) -> FitQuality:
    """Return the RMS before and after of rings and fiducials, on all and on parts held out in turn.

    "Before" is with the instrument exactly as stated. Parts are the regimes; for a course in the run's own
    time they are alternating blocks of frames, since what follows a step cannot be predicted from what
    precedes it.
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
    """Return masks (N,) of the frames in every second block, and in the others."""
    block = np.arange(frames) // _BLOCK_FRAMES
    return [block % 2 == k for k in range(2)]


def repeatability_px(run: GaugeRun, found: Fit) -> float:
    """Return the RMS noise of rings and fiducials from image and wall, px.

    For rings it is the difference of two rings at the same azimuth on other wall of the same bore, over √2;
    for fiducials the difference of edges in different pictures at the same place of the image, or their
    stated σ if larger, since samples of one fiducial may have common errors. A remaining error of the
    instrument is the same in both, so that a bad fit does not raise the floor. A kind without such pairs is
    left out; NaN if both are.
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
    # Without pairs, NumPy's maximum stays NaN, which Python's may not.
    variance = np.array([rings, np.maximum(edges, stated)])
    weight = np.where(np.isfinite(variance), [of_rings.sum(), of_edges.sum()], 0.0)
    return float(np.sqrt(weight @ np.nan_to_num(variance) / weight.sum())) if weight.any() else float("nan")


def variance_of_pairs(value: Float, weight: Float, first: Int, second: Int) -> float:
    """Return the variance within pairs (P,) of values (M,), without what both members have in common.

    NaN without pairs. With products of weights, independent errors give exactly their weighted mean square.
    """
    both = weight[first] * weight[second]
    used = both > 0
    if not used.any():
        return float("nan")
    return float(np.average((value[second] - value[first])[used] ** 2, weights=both[used])) / 2


def _in_other_pictures(edges: Edges) -> tuple[Int, Int]:
    """Return pairs (P,) of edges in different pictures at one place of the image and of similar direction.

    Edges outside the domain of the camera model are left out.
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
    """Return pairs (P,) of ring bins of one azimuth and bore, as close in time as other wall allows.

    Parameters
    ----------
    azimuth_rad, frame, along_mm, section : (M,)
        Azimuth in the image; frame; place along the pipe; index of the bore.
    """
    turn, apart = turns_apart(frame, along_mm)
    first, second = at_one_azimuth(azimuth_rad, turn, apart, 2 * apart)
    alike = section[first] == section[second]
    return first[alike], second[alike]


def turns_apart(frame: Int, along_mm: Float) -> tuple[Int, int]:
    """Return the rank (M,) of each bin's frame, and how many ranks apart two frames show other wall."""
    frames, at, turn = np.unique(frame, return_index=True, return_inverse=True)
    step_mm = float(np.median(np.abs(np.diff(along_mm[at])))) if len(frames) > 1 else np.inf
    apart = min(max(int(np.ceil(_OTHER_WALL_MM / max(step_mm, 1e-9))), 1), max(len(frames) // 4, 1))
    return turn, apart


def at_one_azimuth(azimuth_rad: Float, turn: Int, apart: int, most: int) -> tuple[Int, Int]:
    """Return pairs (P,) of ring bins (M,) of one azimuth, each with the one ``apart`` places later.

    Where frames are missing they are farther apart, but by no more than ``most`` frames.
    """
    place = np.round(azimuth_rad / _SAME_AZIMUTH_RAD).astype(np.int64)
    order = np.lexsort((turn, place))
    first, second = order[:-apart], order[apart:]
    alike = (place[first] == place[second]) & (turn[second] - turn[first] <= most)
    return first[alike], second[alike]


def _rms_px(run: GaugeRun, judged: Judged, parts: Sequence[Part], rules: Sequence[Rule]) -> float:
    """Return the weighted RMS of parts of the run, px, each with its own unknowns at their optimum."""
    about = judged.fit.at(run)
    # Smooth patterns of a hundredth of a pixel would absorb what is tested: they are excluded.
    whole = asking(run, judged.fit.state, about, (), with_baseline=True)
    whole.by_global[:, -BASELINE_SIZE:] = 0.0
    columns, value = kept_columns(judged.fit, ())
    sums, squares, weights = FrameSums.of(whole), 0.0, 0.0
    for part, rule in zip(parts, rules, strict=True):
        equations, reduced = whole.of(part), sums.reduced(about.motion, part)
        left, _ = eliminate_globals(reduced, own_unknowns(run, judged.fit, equations.size))
        step = left.step + left.follow @ rule(Shared(columns, value, left.information, left.right))
        residual = _residual(equations, reduced.pose_step - reduced.pose_by_global @ step, step)
        # Points outside the camera model have no weight and no residual.
        shown = np.isin(equations.kind, (RING, EDGE)) & (equations.weight > 0)
        weight = equations.weight[shown]
        squares += float(weight @ residual[shown] ** 2)
        weights += float(weight.sum())
    return float(np.sqrt(squares / weights))


def _as_stated(shared: Shared) -> Float:
    """Return the step back to the stated instrument."""
    return -shared.value


def _free(shared: Shared) -> Float:
    """Return the step of the effects to their optimum in the part itself, with the instrument fixed."""
    scale = np.sqrt(np.maximum(np.diag(shared.information), 1e-300))
    ridge = shared.information / np.outer(scale, scale) + _RIDGE * np.eye(len(scale))
    free = np.array([c is not None and c.effect != INSTRUMENT for c in shared.columns], bool)
    step = np.zeros(len(scale))
    step[free] = np.linalg.solve(ridge[np.ix_(free, free)], (shared.right / scale)[free]) / scale[free]
    return step


def _from_others(others: Evidence, found: Fit, stated: Stated, shared: Shared) -> Float:
    """Return the step to the values that the other regimes give."""
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
