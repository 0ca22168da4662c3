"""What closed loops show, laid on a joined run: its poses, slip, axis and covariance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.arrays import Float
from pipeline.geometry.axis import axis_through, frames_at, to_pipe
from pipeline.geometry.rigid import inverse, transform
from stages.motion.bundle_adjustment.unknowns import moved
from stages.motion.windows.error_chain import Chain, Conditioned, interpolated
from stages.motion.windows.submap_joining import Joined, Laid, one_axis

_STRETCH_MM = 20.0


def closed(joined: Joined, laid: Sequence[Laid], chain: Chain, found: Conditioned) -> Joined:
    """Return a run freed of the errors that its closures show."""
    frames = np.arange(len(joined.T_pc))
    error = interpolated(frames, chain.at, found.error)
    tangent = frames_at(joined.axis, to_pipe(joined.axis, joined.T_pc[:, :3, 3])[0])[1][..., 2]
    covariance = joined.covariance - interpolated(frames, chain.at, found.gained)
    # Closed loops take from the way what they take from the last pose, along the pipe there.
    before, after = (tangent[-1] @ c[-1, :3, :3] @ tangent[-1] for c in (joined.covariance, covariance))
    straightened = [_without(part, joined.T_pc, error) for part in laid]
    return replace(
        joined,
        T_pc=moved(joined.T_pc, -error),
        slip=joined.slip - np.einsum("ni,ni->n", tangent, error[:, :3]),
        axis=one_axis(straightened),
        covariance=covariance,
        distance_sigma_mm=joined.distance_sigma_mm * float(np.sqrt(max(after, 0.0) / before)),
    )


def _without(part: Laid, T_oc: Float, error: Float) -> Laid:
    """Return a window whose poses and axis are freed of the errors (N, 6) of all frames (N, 4, 4).

    Every point of the axis moves with the frames that were beside it, or with the last one before it.
    """
    mine = slice(part.submap.window.first, part.submap.window.last)
    own, T_ow, T_wo = part.submap.axis, part.T_ow, inverse(part.T_ow)
    beside = to_pipe(own, part.submap.T_pc[:, :3, 3])[0]
    turn_o = np.einsum("nij,nj->ni", T_oc[mine, :3, :3], error[mine, 3:])
    known = np.concatenate([error[mine, :3], turn_o, T_oc[mine, :3, 3]], 1)
    shift, turn, pivot = np.split(_by_distance(own.distance_mm, beside, known), 3, axis=1)
    before = transform(T_ow, own.origin_p)
    after = transform(T_wo, before - shift - np.cross(turn, before - pivot))
    first = float(own.distance_mm[0] - (T_ow[:3, :3] @ own.R_pa[0, :, 2]) @ shift[0])
    axis = axis_through(after, own.R_pa[0, :, 0], first)
    T_pc = T_wo @ moved(part.T_pc, -error[mine])
    return replace(part, submap=replace(part.submap, T_pc=T_pc, axis=axis), T_pc=T_ow @ T_pc)


def _by_distance(wanted_mm: Float, at_mm: Float, value: Float) -> Float:
    """Return values (M, V) at distances (M,): means, over short stretches, of those (n, V) at (n,)."""
    stretch = np.floor((at_mm - at_mm.min()) / _STRETCH_MM).astype(np.int64)
    _, stretch, count = np.unique(stretch, return_inverse=True, return_counts=True)
    mean = [np.bincount(stretch, column) / count for column in (at_mm, *value.T)]
    return np.stack([np.interp(wanted_mm, mean[0], column) for column in mean[1:]], -1)
