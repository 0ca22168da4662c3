"""Joins submaps: each window is aligned with the one before by the frames that they share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Float, Int
from pipeline.geometry.axis import PipeAxis, axis_through, distance_along, frames_at, to_pipe
from pipeline.geometry.rigid import from_parts, inverse, rotation_from_vector, transform, vector_from_rotation
from stages.motion.bundle_adjustment.residuals import ORIGIN_SIGMA
from stages.motion.bundle_adjustment.unknowns import AXIS_STEP_MM
from stages.motion.windows.error_chain import ErrorChain, Link, interpolated
from stages.motion.windows.submaps import SharedParameters, Submap, carried_error, handover

_BLENDED = 0.5
"""Middle share of an overlap over which poses are blended from one window to the next: the outer quarters are
worst determined in one of the two. Not measured."""
_LEAST_WEIGHT = 1e-3
"""Weight of an axis, mm, beyond the wall that its window passed, where no other window has an axis."""


@dataclass(frozen=True)
class PlacedSubmap:
    """A submap in the frame O of the run's first window.

    Attributes
    ----------
    submap : Submap
    T_pc : (n, 4, 4)
        Poses in O.
    slip : (n,)
    T_ow : (4, 4)
        The submap's own frame W in O.
    distance_mm : float
        Added to distances along the submap's axis to get those along the run.
    """

    submap: Submap
    T_pc: Float
    slip: Float
    T_ow: Float
    distance_mm: float


@dataclass(frozen=True)
class JoinedRun:
    """A whole run in the frame O of its first window.

    Attributes
    ----------
    placed : tuple of PlacedSubmap
    chain : ErrorChain
        Errors of the submaps as placed.
    T_pc : (N, 4, 4)
    slip : (N,)
    axis : PipeAxis
    covariance : (N, 6, 6)
        Covariance of the poses, as in `pipeline.artefacts.measured.Trajectory`.
    radius_mm, radius_sigma_mm : float
    shared : SharedParameters
    distance_sigma_mm : float
        1 σ of the distance along the axis from the first frame to the last.
    """

    placed: tuple[PlacedSubmap, ...]
    chain: ErrorChain
    T_pc: Float
    slip: Float
    axis: PipeAxis
    covariance: Float
    radius_mm: float
    radius_sigma_mm: float
    shared: SharedParameters
    distance_sigma_mm: float

    def with_scale_sigma(self, relative: float) -> JoinedRun:
        """Return the run with an additional relative 1 σ that all distances share."""
        way = np.zeros((len(self.T_pc), 6))
        way[:, :3] = relative * (self.T_pc[:, :3, 3] - self.T_pc[0, :3, 3])
        covariance = self.covariance + way[:, :, None] * way[:, None, :]
        own = relative * float(np.ptp(distance_along(self.axis, self.T_pc)))
        both = float(np.hypot(self.distance_sigma_mm, own))
        return replace(self, covariance=covariance, distance_sigma_mm=both)

    @property
    def turn_variance(self) -> Float:
        """Return the variance (N, 3) of rotations summed up to every frame: `ErrorChain.turn_variances`."""
        return interpolated(np.arange(len(self.T_pc)), self.chain.at, self.chain.turn_variances())


def join_submaps(submaps: Sequence[Submap], shared: SharedParameters) -> JoinedRun:
    """Align every window with the one before it.

    Neighbouring windows use nearly the same data in the frames they share, so these agree to a fraction of
    their σ: poses are blended gradually from one window to the other, in the middle of the shared frames.
    """
    placed = _placed(submaps)
    T_pc, slip = _blended(placed)
    chain = _error_chain(placed, shared)
    covariance = interpolated(np.arange(len(T_pc)), chain.at, chain.covariances())
    radius = np.average([s.radius_mm for s in submaps], weights=[s.window.frames for s in submaps])
    return JoinedRun(
        tuple(placed), chain, T_pc, slip, merged_axis(placed), covariance, float(radius),
        _radius_sigma(submaps, shared), shared, _distance_sigma(submaps, shared),
    )  # fmt: skip


def merged_axis(placed: Sequence[PlacedSubmap]) -> PipeAxis:
    """Return the mean of all windows' axes, each with the largest weight in the middle of its wall."""
    if len(placed) == 1:
        return placed[0].submap.axis
    spans = [part.submap.axis.distance_mm[[0, -1]] + part.distance_mm for part in placed]
    first, last = min(s[0] for s in spans), max(s[1] for s in spans)
    distance = first + AXIS_STEP_MM * np.arange(int((last - first) / AXIS_STEP_MM) + 1)
    total, weight = np.zeros((len(distance), 3)), np.zeros(len(distance))
    for part, span in zip(placed, spans, strict=True):
        mine = slice(*np.searchsorted(distance, [span[0], span[1] + 1e-9]))
        origin = frames_at(part.submap.axis, distance[mine] - part.distance_mm)[0]
        seen = to_pipe(part.submap.axis, part.submap.T_pc[:, :3, 3])[0] + part.distance_mm
        inside = np.minimum(distance[mine] - seen.min(), seen.max() - distance[mine])
        share = np.maximum(inside, 0.0) + _LEAST_WEIGHT
        total[mine] += share[:, None] * transform(part.T_ow, origin)
        weight[mine] += share
    origin = total / weight[:, None]
    return axis_through(origin, placed[0].submap.axis.R_pa[0, :, 0], float(first))


def _placed(submaps: Sequence[Submap]) -> list[PlacedSubmap]:
    placed = [PlacedSubmap(submaps[0], submaps[0].T_pc, submaps[0].slip, np.eye(4), 0.0)]
    for submap in submaps[1:]:
        placed.append(_placed_on(placed[-1], submap))
    return placed


def _placed_on(before: PlacedSubmap, submap: Submap) -> PlacedSubmap:
    first, last = submap.window.first, before.submap.window.last
    middle = handover(before.submap.window, submap.window)
    weight = _hat(np.arange(first, last), middle, _BLENDED * (last - first) / 2)
    old, new = before.T_pc[first - before.submap.window.first :], submap.T_pc[: last - first]
    at = middle - first
    step = _mean_step(inverse(old[at]) @ old, inverse(new[at]) @ new, weight)
    T_ow = old[at] @ step @ inverse(new[at])
    old_slip = before.slip[first - before.submap.window.first :]
    slip = submap.slip + np.average(old_slip - submap.slip[: last - first], weights=weight)
    there = _distance_of(before, old[at])
    distance = there - float(to_pipe(submap.axis, new[at][:3, 3])[0])
    return PlacedSubmap(submap, T_ow @ submap.T_pc, slip, T_ow, distance)


def _distance_of(placed: PlacedSubmap, T_pc: Float) -> float:
    own = inverse(placed.T_ow) @ T_pc
    return placed.distance_mm + float(to_pipe(placed.submap.axis, own[:3, 3])[0])


def _hat(place: Int, middle: int, half: float) -> Float:
    """Return weights (K,) that fall linearly from 1 in the middle to 0 at a distance ``half``."""
    return np.asarray(np.maximum(1 - np.abs(place - middle) / max(half, 1.0), 0.0))


def _mean_step(old: Float, new: Float, weight: Float) -> Float:
    """Return the transform X (4, 4) with old ≈ X new for poses (K, 4, 4), in the weighted mean."""
    turn = vector_from_rotation(old[:, :3, :3] @ np.swapaxes(new[:, :3, :3], 1, 2))
    rotation = rotation_from_vector(np.average(turn, axis=0, weights=weight))
    shift = old[:, :3, 3] - new[:, :3, 3] @ rotation.T
    return from_parts(rotation, np.average(shift, axis=0, weights=weight))


def _blended(placed: Sequence[PlacedSubmap]) -> tuple[Float, Float]:
    """Return poses (N, 4, 4) and slip (N,) of all frames; each window gains weight gradually."""
    frames = placed[-1].submap.window.last
    T_pc, slip = np.zeros((frames, 4, 4)), np.zeros(frames)
    for part in placed:
        window = part.submap.window
        mine = slice(window.first, window.last)
        shared = int(np.count_nonzero(T_pc[mine, 3, 3]))
        share = np.ones(window.frames)
        if shared:
            start, end = shared * (1 - _BLENDED) / 2, shared * (1 + _BLENDED) / 2
            share[:shared] = np.clip((np.arange(shared) - start) / max(end - start, 1e-9), 0, 1)
        old = np.where(T_pc[mine, 3:, 3:] > 0, T_pc[mine], part.T_pc)
        T_pc[mine] = _between(old, part.T_pc, share)
        slip[mine] = slip[mine] * (1 - share) + part.slip * share
    return T_pc, slip


def _between(old: Float, new: Float, share: Float) -> Float:
    """Return poses (n, 4, 4) interpolated from old to new by a ``share`` (n,)."""
    turn = vector_from_rotation(np.swapaxes(old[:, :3, :3], 1, 2) @ new[:, :3, :3])
    rotation = old[:, :3, :3] @ rotation_from_vector(share[:, None] * turn)
    origin = old[:, :3, 3] + share[:, None] * (new[:, :3, 3] - old[:, :3, 3])
    whole = share == 1
    return np.where(whole[:, None, None], new, from_parts(rotation, origin))


def _error_chain(placed: Sequence[PlacedSubmap], shared: SharedParameters) -> ErrorChain:
    """Return the chain of errors through the placed windows."""
    links: list[Link] = []
    before = np.zeros((6, len(shared.value)))
    for part in placed:
        own, place = part.submap, part.submap.sampled
        turn = np.eye(6)
        turn[:3, :3] = part.T_ow[:3, :3]
        carry = carried_error(part.T_pc[place], part.T_pc[own.anchor])
        joint = np.einsum("ij,ajbk,lk->aibl", turn, own.joint, turn)
        response = carry @ before + turn @ own.response
        links.append(Link(own.window.first + place, carry, joint, response))
        before = response[-1]
    return ErrorChain(tuple(links), np.diag(ORIGIN_SIGMA**2), shared.covariance)


def _radius_sigma(submaps: Sequence[Submap], shared: SharedParameters) -> float:
    """Return 1 σ of the mean radius: independent in each window, except for the shared parameters."""
    response = np.mean([s.radius_response for s in submaps], 0)
    variance = float(np.mean([s.radius_variance for s in submaps])) / len(submaps)
    return float(np.sqrt(variance + float(response @ shared.covariance @ response)))


def _distance_sigma(submaps: Sequence[Submap], shared: SharedParameters) -> float:
    """Return 1 σ of the distance along the axis: independent in each window, except for shared parameters.

    The direction of the pipe drifts from window to window; that rotates the following part of the path
    without making it longer.
    """
    variance, response = 0.0, np.zeros(len(shared.value))
    for own in submaps:
        last_mm = to_pipe(own.axis, own.T_pc[own.sampled[-1], :3, 3])[0]
        tangent = frames_at(own.axis, last_mm)[1][:, 2]
        variance += float(tangent @ own.covariance[-1, :3, :3] @ tangent)
        response += tangent @ own.response[-1, :3]
    return float(np.sqrt(variance + response @ shared.covariance @ response))
