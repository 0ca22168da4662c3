"""Submaps: the contribution of a window of frames to the whole run, and the parameters all windows share.

Windows are adjusted on their own, the shared parameters (encoder scale and instrument) are fused by
their information, and every window is adjusted again with these held. G. Sibley et al., "Sliding window
filter with application to planetary landing", 2010; S. Huang et al., "Sparse local submap joining filter for
building large-scale maps", 2008.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from pipeline.arrays import Float, Int
from pipeline.geometry.axis import PipeAxis
from pipeline.geometry.rigid import skew
from stages.motion.bundle_adjustment.equations import Measurements
from stages.motion.bundle_adjustment.solver import Estimate
from stages.motion.bundle_adjustment.unknowns import State

_COVARIANCES, _FEWEST_COVARIANCES = 60, 12
"""Frames of a run, and of each window at least, whose covariance is computed; between them it is
interpolated, since neighbouring frames have nearly the same. More would take time and memory. Not
measured."""
_INDEPENDENT_WINDOWS = 3.0
"""Largest number of windows whose information on the shared parameters is added: texture matching has the
same errors in all of them. As if independent, the eighty windows of a rendered 100 m moved the instrument by
36 of its σ and the distance by 435 mm; with three, by 1.6 σ and 27 mm (`python -m
tests.benchmarks.bench_long_run`, one run). Chosen on that run."""


@dataclass(frozen=True)
class Window:
    """Frames ``first`` to ``last`` (exclusive) of the list of all frames."""

    first: int
    last: int

    @property
    def frames(self) -> int:
        """Number of frames."""
        return self.last - self.first


@dataclass(frozen=True)
class SharedInformation:
    """A window's evidence on the shared parameters (S,): best values and added information."""

    value: Float
    information: Float


@dataclass(frozen=True)
class SharedParameters:
    """Encoder scale and instrument (S,) of the whole run, and their covariance (S, S)."""

    value: Float
    covariance: Float


@dataclass(frozen=True)
class Submap:
    """A window at its optimum, in a frame of its own.

    Attributes
    ----------
    window : Window
    T_pc : (n, 4, 4)
    slip : (n,)
    axis : PipeAxis
    radius_mm : float
    anchor : int
        Frame of the window relative to which errors are stated.
    sampled : (k,) int
        Frames of the window whose errors are known, from the anchor on; errors between them hardly differ.
    joint : (k, 6, k, 6)
        Covariance of their errors relative to the anchor, given the shared parameters.
    response : (k, 6, S)
        Derivatives of their poses, relative to the anchor, by the shared parameters.
    radius_variance : float
        Variance of the radius, mm², given the shared parameters.
    radius_response : (S,)
        Derivatives of the radius by the shared parameters.
    """

    window: Window
    T_pc: Float
    slip: Float
    axis: PipeAxis
    radius_mm: float
    anchor: int
    sampled: Int
    joint: Float
    response: Float
    radius_variance: float
    radius_response: Float

    @property
    def covariance(self) -> Float:
        """Return the covariance (k, 6, 6) of each frame's error relative to the anchor."""
        each = np.arange(len(self.sampled))
        return np.asarray(self.joint[each, :, each])


def cut_windows(frames: int, length: int, overlap: int) -> tuple[Window, ...]:
    """Return windows of one length that cover all frames, each overlapping the next by at least so many."""
    if frames <= length:
        return (Window(0, frames),)
    count = int(np.ceil((frames - overlap) / (length - overlap)))
    first = np.rint(np.linspace(0, frames - length, count)).astype(int)
    return tuple(Window(int(a), int(a) + length) for a in first)


def handover(window: Window, following: Window) -> int:
    """Return the frame, in the list of all, at which the next window takes over: the middle shared one."""
    return (window.last - 1 + following.first) // 2


def shared_information(estimate: Estimate, measured: Measurements) -> SharedInformation:
    """Return the evidence of a window, adjusted on its own, on the shared parameters."""
    state = estimate.state
    which = state.shared_columns
    posterior = np.linalg.inv(estimate.factor.border_covariance()[np.ix_(which, which)])
    own = posterior - np.diag(_stated_sigma(measured, state) ** -2)
    value, vector = np.linalg.eigh((own + own.T) / 2)
    return SharedInformation(state.shared, (vector * np.maximum(value, 0)) @ vector.T)


def fuse_shared(
    evidence: Sequence[SharedInformation], new_shares: Sequence[float], measured: Measurements, state: State
) -> SharedParameters:
    """Return the shared parameters from the evidence of all windows and the stated values.

    Errors of texture matching are the same in every window: beyond the information of a few windows
    (`_INDEPENDENT_WINDOWS`) agreement adds none.

    Parameters
    ----------
    evidence
        Evidence of all windows.
    new_shares
        Share of each window that the one before it has not seen.
    measured, state
        Those of any window: they give the stated values and the number of parameters.
    """
    stated = np.diag(_stated_sigma(measured, state) ** -2)
    mean = np.append(1.0, np.zeros(len(state.instrument)))
    information, right = stated.copy(), np.zeros(len(mean))
    believed = min(1.0, _INDEPENDENT_WINDOWS / sum(new_shares))
    for own, share in zip(evidence, new_shares, strict=True):
        information += believed * share * own.information
        right += believed * share * (own.information + stated) @ (own.value - mean)
    covariance = np.asarray(np.linalg.inv(information), float)
    return SharedParameters(mean + covariance @ right, covariance)


def submap_of(estimate: Estimate, window: Window, anchor: int, last: int, windows: int) -> Submap:
    """Return the submap of a window, with errors from frame ``anchor`` to frame ``last`` of it.

    All other unknowns, mainly landmarks, are marginalised. ``windows`` is the number of windows of the run.
    """
    state, factor = estimate.state, estimate.factor
    which = state.shared_columns
    count = max(_COVARIANCES // windows, _FEWEST_COVARIANCES)
    sampled = np.unique(np.linspace(anchor, last, min(last - anchor + 1, count)).round().astype(int))
    with threadpool_limits(1):  # more threads gain nothing on blocks this small
        border = factor.border_covariance()
        by_shared, border_by_shared = factor.response(which)
        covariance = factor.joint_covariance(sampled)[:, :6, :, :6]
    shared, T_pc = border[np.ix_(which, which)], state.T_pc[sampled]
    response = _relative_response(by_shared[sampled, :6], T_pc)
    joint = _relative_covariance(covariance, T_pc)
    joint -= np.swapaxes(response[:, None] @ shared @ np.swapaxes(response, 1, 2), 1, 2)
    radius = border_by_shared[0]
    return Submap(
        window, state.T_pc, state.slip, state.axis, float(state.globals[0]), anchor, sampled, joint,
        response, max(float(border[0, 0] - radius @ shared @ radius), 0.0), radius,
    )  # fmt: skip


def carried_error(T_pc: Float, anchor_T_pc: Float) -> Float:
    """Return the derivatives (k, 6, 6) of the errors of poses (k, 4, 4) fixed to an anchor, by its error.

    An error (d, w) means the pose [R exp(w), t + d], as in `unknowns.moved`.
    """
    out = np.zeros((len(T_pc), 6, 6))
    turn = anchor_T_pc[:3, :3]
    out[:, :3, :3] = np.eye(3)
    out[:, :3, 3:] = -skew(T_pc[:, :3, 3] - anchor_T_pc[:3, 3]) @ turn
    out[:, 3:, 3:] = np.swapaxes(T_pc[:, :3, :3], 1, 2) @ turn
    return out


def _stated_sigma(measured: Measurements, state: State) -> Float:
    """Return 1 σ (S,) of the shared parameters as stated with the probe."""
    return np.append(measured.probe.encoder_scale_sigma, np.ones(len(state.instrument)))


def _relative_response(change: Float, T_pc: Float) -> Float:
    """Return derivatives (k, 6, S) of poses (k, 4, 4) relative to the first of them."""
    return np.asarray(change - carried_error(T_pc, T_pc[0]) @ change[0])


def _relative_covariance(joint: Float, T_pc: Float) -> Float:
    """Return the covariances (k, 6, k, 6) of poses relative to the first of them."""
    carry = carried_error(T_pc, T_pc[0])
    back = np.swapaxes(carry, 1, 2)
    with_first = carry[:, None] @ np.swapaxes(joint[:, :, 0], 1, 2)  # (k, k, first's 6, frame's 6)
    out = np.swapaxes(joint, 1, 2) + carry[:, None] @ joint[0, :, 0] @ back
    out = out - with_first - np.swapaxes(np.swapaxes(with_first, 0, 1), 2, 3)
    return np.swapaxes(out, 1, 2)
