"""The pose graph: errors of a joined run estimated from closed loops, and the corrected run.

A closure measures a difference of errors between two far ends of the chain of windows. Conditioning the chain
on all closures is the least-squares solution of the graph. D. Simon, "Optimal state estimation", 2006, § 3.1.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.special import chdtrc

from pipeline.arrays import Float, Int
from pipeline.geometry.axis import axis_through, frames_at, to_pipe
from pipeline.geometry.rigid import inverse, transform
from stages.motion.bundle_adjustment.unknowns import moved
from stages.motion.windows.error_chain import ErrorChain, ErrorSums, interpolated
from stages.motion.windows.submap_joining import JoinedRun, PlacedSubmap, merged_axis

_STRETCH_MM = 20.0
"""Length of axis over which the errors of the frames beside it are averaged: shorter than a spline knot of
the axis (30 mm). Not measured."""


@dataclass(frozen=True)
class Closures:
    """C measured differences between errors of the chain.

    Attributes
    ----------
    by_error : ErrorSums
    residual : (C,)
    sigma : (C,)
        1 σ of the measurements, which are independent.
    place : (C,) int
        Revisit of each closure: those of one revisit are judged together.
    """

    by_error: ErrorSums
    residual: Float
    sigma: Float
    place: Int

    def at(self, places: Int) -> Closures:
        """Return those of some revisits."""
        mine = np.flatnonzero(np.isin(self.place, places))
        by_error = self.by_error.select(mine, np.ones(len(mine)))
        return Closures(by_error, self.residual[mine], self.sigma[mine], self.place[mine])

    def residual_covariance(self, chain: ErrorChain) -> Float:
        """Return the covariance (C, C) of the residuals before any loop is closed."""
        return chain.covariance_of(self.by_error) + np.diag(self.sigma**2)


@dataclass(frozen=True)
class Conditioned:
    """Estimated errors (K, 6), and the reduction (K, 6, 6) of their covariances by the closures."""

    error: Float
    gained: Float


def conditioned(chain: ErrorChain, closures: Closures) -> Conditioned:
    """Return the errors at the chain's frames, estimated from all closures together."""
    factor = cho_factor(closures.residual_covariance(chain), lower=True)
    error, gained = [], []
    for found in chain.covariances_with(closures.by_error):
        gain = cho_solve(factor, found.reshape(-1, found.shape[2]).T).T.reshape(found.shape)
        error.append(gain @ closures.residual)
        gained.append(np.einsum("kic,kjc->kij", gain, found))
    fall = np.concatenate(gained)
    return Conditioned(np.concatenate(error), (fall + np.swapaxes(fall, 1, 2)) / 2)


def contradicted_places(covariance: Float, closures: Closures, least_probability: float) -> set[int]:
    """Return the revisits whose closures contradict the motion and all other revisits.

    The worst is removed first, then the others are tested again. If two contradict each other and no third
    one shows which is wrong, both are removed. ``covariance`` (C, C) is `Closures.residual_covariance`.
    """
    out: set[int] = set()
    while True:
        found = _probabilities(covariance, closures, out)
        worst = min(found, key=lambda place: (found[place], place), default=-1)
        if worst < 0 or found[worst] >= least_probability:
            return out
        doubted = {place for place in found if place != worst and found[place] < least_probability}
        out |= {worst} | {
            place
            for place in doubted
            if _probabilities(covariance, closures, out | {place})[worst] >= least_probability
        }


def corrected(joined: JoinedRun, found: Conditioned) -> JoinedRun:
    """Return a run corrected for the errors that its closures show: poses, slip, axis and covariance."""
    frames, at = np.arange(len(joined.T_pc)), joined.chain.at
    error = interpolated(frames, at, found.error)
    tangent = frames_at(joined.axis, to_pipe(joined.axis, joined.T_pc[:, :3, 3])[0])[1][..., 2]
    covariance = joined.covariance - interpolated(frames, at, found.gained)
    # Closed loops reduce the variance of the distance in the same proportion as that of the last pose along
    # the pipe.
    before, after = (tangent[-1] @ c[-1, :3, :3] @ tangent[-1] for c in (joined.covariance, covariance))
    placed = [_corrected_submap(part, joined.T_pc, error) for part in joined.placed]
    return replace(
        joined,
        T_pc=moved(joined.T_pc, -error),
        slip=joined.slip - np.einsum("ni,ni->n", tangent, error[:, :3]),
        axis=merged_axis(placed),
        covariance=covariance,
        distance_sigma_mm=joined.distance_sigma_mm * float(np.sqrt(max(after, 0.0) / before)),
    )


def _probabilities(covariance: Float, closures: Closures, out: set[int]) -> dict[int, float]:
    """Return for each revisit the probability of its deviation from the prediction of all others.

    Given all others, the covariance of a revisit's residuals is the inverse of its block of the inverse
    covariance (that of a conditioned Gaussian).
    """
    keep = np.flatnonzero(~np.isin(closures.place, list(out)))
    information = np.asarray(np.linalg.inv(covariance[np.ix_(keep, keep)]), float)
    pull = information @ closures.residual[keep]
    found = {}
    for place in np.unique(closures.place[keep]).tolist():
        mine = closures.place[keep] == place
        square = float(pull[mine] @ np.linalg.solve(information[np.ix_(mine, mine)], pull[mine]))
        found[place] = float(chdtrc(int(mine.sum()), square))
    return found


def _corrected_submap(part: PlacedSubmap, T_oc: Float, error: Float) -> PlacedSubmap:
    """Return a window whose poses and axis are corrected for the errors (N, 6) of all frames (N, 4, 4).

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
