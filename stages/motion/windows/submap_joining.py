"""Windows joined: each is laid on the one before by the frames they share, and all axes become one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Float, Int
from pipeline.geometry.axis import PipeAxis, axis_through, frames_at, to_pipe
from pipeline.geometry.rigid import from_parts, inverse, rotation_from_vector, transform, vector_from_rotation
from stages.motion.bundle_adjustment.residuals import ORIGIN_SIGMA
from stages.motion.bundle_adjustment.unknowns import AXIS_STEP_MM
from stages.motion.windows.error_chain import Chain, Link, interpolated
from stages.motion.windows.measured_run import Window
from stages.motion.windows.submaps import Settled, Submap, carried

_SEAM_SHARE = 0.5
_LEAST_WEIGHT = 1e-3


@dataclass(frozen=True)
class Joined:
    """A whole run in the frame of its first window.

    Attributes
    ----------
    submaps : tuple of Submap
        Its windows, each in a frame of its own.
    T_pc : (N, 4, 4)
    slip : (N,)
    axis : PipeAxis
    covariance : (N, 6, 6)
        Of the poses, as in `pipeline.artefacts.measured.Trajectory`.
    radius_mm, radius_sigma_mm : float
    settled : Settled
        Encoder scale and instrument.
    distance_sigma_mm : float
        1 σ of the distance along the axis from the first frame to the last.
    """

    submaps: tuple[Submap, ...]
    T_pc: Float
    slip: Float
    axis: PipeAxis
    covariance: Float
    radius_mm: float
    radius_sigma_mm: float
    settled: Settled
    distance_sigma_mm: float


@dataclass(frozen=True)
class Laid:
    """A submap's poses and slip in the first window's frame, and how its own frame and distance lie."""

    submap: Submap
    T_pc: Float
    slip: Float
    T_ow: Float
    distance_mm: float


def seam(window: Window, following: Window) -> int:
    """Return the frame, in the list of all frames, at which one window hands over to the next."""
    return (window.last - 1 + following.first) // 2


def join(submaps: Sequence[Submap], settled: Settled) -> Joined:
    """Lay every window on the one before it.

    Neighbouring windows see much the same in the frames they share, so these agree to a fraction of their σ:
    poses go over from one window to the other gradually, along the middle of the shared frames.
    """
    laid = lay(submaps)
    frames = submaps[-1].window.last
    T_pc, slip = np.zeros((frames, 4, 4)), np.zeros(frames)
    for part in laid:
        _write(part, T_pc, slip)
    radius = np.average([s.radius_mm for s in submaps], weights=[s.window.frames for s in submaps])
    response = np.mean([s.radius_response for s in submaps], 0)
    variance = float(np.mean([s.radius_variance for s in submaps])) / len(submaps)
    variance += float(response @ settled.covariance @ response)
    return Joined(
        tuple(submaps), T_pc, slip, one_axis(laid), _covariance(laid, settled), float(radius),
        float(np.sqrt(variance)), settled, _distance_sigma(submaps, settled),
    )  # fmt: skip


def lay(submaps: Sequence[Submap]) -> list[Laid]:
    """Return every window laid on the one before it."""
    laid = [Laid(submaps[0], submaps[0].T_pc, submaps[0].slip, np.eye(4), 0.0)]
    for submap in submaps[1:]:
        laid.append(_laid_on(laid[-1], submap))
    return laid


def chain_of(laid: Sequence[Laid], settled: Settled) -> Chain:
    """Return how errors run on through windows as they are laid."""
    links: list[Link] = []
    before = np.zeros((6, len(settled.value)))
    for part in laid:
        own, place = part.submap, part.submap.some
        turn = np.eye(6)
        turn[:3, :3] = part.T_ow[:3, :3]
        carry = carried(part.T_pc[place], part.T_pc[own.anchor])
        joint = np.einsum("ij,ajbk,lk->aibl", turn, own.joint, turn)
        response = carry @ before + turn @ own.response
        links.append(Link(own.window.first + place, carry, joint, response))
        before = response[-1]
    return Chain(tuple(links), np.diag(ORIGIN_SIGMA**2), settled.covariance)


def _laid_on(before: Laid, submap: Submap) -> Laid:
    first, last = submap.window.first, before.submap.window.last
    middle = seam(before.submap.window, submap.window)
    weight = _hat(np.arange(first, last), middle, _SEAM_SHARE * (last - first) / 2)
    old, new = before.T_pc[first - before.submap.window.first :], submap.T_pc[: last - first]
    at = middle - first
    step = _mean_step(inverse(old[at]) @ old, inverse(new[at]) @ new, weight)
    T_ow = old[at] @ step @ inverse(new[at])
    old_slip = before.slip[first - before.submap.window.first :]
    slip = submap.slip + np.average(old_slip - submap.slip[: last - first], weights=weight)
    there = _distance_of(before, old[at])
    distance = there - float(to_pipe(submap.axis, new[at][:3, 3])[0])
    return Laid(submap, T_ow @ submap.T_pc, slip, T_ow, distance)


def _distance_of(laid: Laid, T_pc: Float) -> float:
    own = inverse(laid.T_ow) @ T_pc
    return laid.distance_mm + float(to_pipe(laid.submap.axis, own[:3, 3])[0])


def _hat(place: Int, middle: int, half: float) -> Float:
    return np.asarray(np.maximum(1 - np.abs(place - middle) / max(half, 1.0), 0.0))


def _mean_step(old: Float, new: Float, weight: Float) -> Float:
    """Return the one motion X (4, 4) with old ≈ X new for poses (K, 4, 4), in the weighted mean."""
    turn = vector_from_rotation(old[:, :3, :3] @ np.swapaxes(new[:, :3, :3], 1, 2))
    rotation = rotation_from_vector(np.average(turn, axis=0, weights=weight))
    shift = old[:, :3, 3] - new[:, :3, 3] @ rotation.T
    return from_parts(rotation, np.average(shift, axis=0, weights=weight))


def _write(part: Laid, T_pc: Float, slip: Float) -> None:
    """Write a window's poses behind those of the windows before, over which it gains weight gradually."""
    window = part.submap.window
    mine = slice(window.first, window.last)
    shared = int(np.count_nonzero(T_pc[mine, 3, 3]))
    ramp = np.ones(window.frames)
    if shared:
        start, end = shared * (1 - _SEAM_SHARE) / 2, shared * (1 + _SEAM_SHARE) / 2
        ramp[:shared] = np.clip((np.arange(shared) - start) / max(end - start, 1e-9), 0, 1)
    new, old = part.T_pc, np.where(T_pc[mine, 3:, 3:] > 0, T_pc[mine], part.T_pc)
    T_pc[mine] = _between(old, new, ramp)
    slip[mine] = slip[mine] * (1 - ramp) + part.slip * ramp


def _between(old: Float, new: Float, share: Float) -> Float:
    """Return poses (n, 4, 4) the ``share`` (n,) of the way from old to new."""
    turn = vector_from_rotation(np.swapaxes(old[:, :3, :3], 1, 2) @ new[:, :3, :3])
    rotation = old[:, :3, :3] @ rotation_from_vector(share[:, None] * turn)
    origin = old[:, :3, 3] + share[:, None] * (new[:, :3, 3] - old[:, :3, 3])
    whole = share == 1
    return np.where(whole[:, None, None], new, from_parts(rotation, origin))


def one_axis(laid: Sequence[Laid]) -> PipeAxis:
    """Return the mean of all windows' axes, each weighing most in the middle of the wall it saw."""
    if len(laid) == 1:
        return laid[0].submap.axis
    spans = [laid_.submap.axis.distance_mm[[0, -1]] + laid_.distance_mm for laid_ in laid]
    first, last = min(s[0] for s in spans), max(s[1] for s in spans)
    distance = first + AXIS_STEP_MM * np.arange(int((last - first) / AXIS_STEP_MM) + 1)
    total, weight = np.zeros((len(distance), 3)), np.zeros(len(distance))
    for part, span in zip(laid, spans, strict=True):
        mine = slice(*np.searchsorted(distance, [span[0], span[1] + 1e-9]))
        origin = frames_at(part.submap.axis, distance[mine] - part.distance_mm)[0]
        seen = to_pipe(part.submap.axis, part.submap.T_pc[:, :3, 3])[0] + part.distance_mm
        inside = np.minimum(distance[mine] - seen.min(), seen.max() - distance[mine])
        share = np.maximum(inside, 0.0) + _LEAST_WEIGHT
        total[mine] += share[:, None] * transform(part.T_ow, origin)
        weight[mine] += share
    origin = total / weight[:, None]
    return axis_through(origin, laid[0].submap.axis.R_pa[0, :, 0], float(first))


def _distance_sigma(submaps: Sequence[Submap], settled: Settled) -> float:
    """Return 1 σ of the distance along the axis: each window's own, and what they share.

    Where the pipe points drifts from window to window, which turns the way behind and does not lengthen it.
    """
    variance, response = 0.0, np.zeros(len(settled.value))
    for own in submaps:
        tangent = frames_at(own.axis, to_pipe(own.axis, own.T_pc[own.some[-1], :3, 3])[0])[1][:, 2]
        variance += float(tangent @ own.covariance[-1, :3, :3] @ tangent)
        response += tangent @ own.response[-1, :3]
    return float(np.sqrt(variance + response @ settled.covariance @ response))


def _covariance(laid: Sequence[Laid], settled: Settled) -> Float:
    """Return (N, 6, 6): errors go on from anchor to anchor, those of the shared numbers alike in all."""
    frames = laid[-1].submap.window.last
    at: list[Int] = []
    values: list[Float] = []
    start = np.diag(ORIGIN_SIGMA**2)
    start_response = np.zeros((6, len(settled.value)))
    for part in laid:
        own, place = part.submap, part.submap.some
        carry = carried(part.T_pc[place], part.T_pc[own.anchor])
        turn = np.eye(6)
        turn[:3, :3] = part.T_ow[:3, :3]
        random = carry @ start @ np.swapaxes(carry, 1, 2) + turn @ own.covariance @ turn.T
        response = carry @ start_response + turn @ own.response
        at.append(own.window.first + place)
        values.append(random + response @ settled.covariance @ np.swapaxes(response, 1, 2))
        start, start_response = random[-1], response[-1]
    return interpolated(np.arange(frames), np.concatenate(at), np.concatenate(values))
