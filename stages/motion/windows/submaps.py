"""What one window of frames tells: poses and axis of its own, and its say on what all windows share.

Windows are adjusted on their own, the numbers that all share (encoder scale and instrument) are put together
by their information, and every window is adjusted again with these settled. G. Sibley et al., "Sliding window
filter with application to planetary landing", 2010; S. Huang et al., "Sparse local submap joining filter for
building large-scale maps", 2008.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from pipeline.adjustment.bordered import Factor
from pipeline.arrays import Float, Int
from pipeline.errors import UnusableError
from pipeline.geometry.axis import PipeAxis
from pipeline.geometry.rigid import skew
from stages.motion.bundle_adjustment.equations import Measurements
from stages.motion.bundle_adjustment.solver import Adjusted, adjust, third_difference_sigma
from stages.motion.bundle_adjustment.unknowns import GLOBALS, State
from stages.motion.parameters import MotionParameters
from stages.motion.windows.measured_run import Window

_ROUGHLY, _CLOSELY = 1e-2, 1e-5
_COVARIANCES, _FEWEST_COVARIANCES = 60, 12
_SCALE = GLOBALS - 1
# Windows (as many frames as one has) that may agree by chance and not because they err alike.
_WINDOWS_WORTH = 3.0


@dataclass(frozen=True)
class Estimate:
    """The adjustment's end, the factorised equations there, and how smooth the motion was found (6,)."""

    adjusted: Adjusted
    factor: Factor
    smooth_sigma: Float

    @property
    def state(self) -> State:
        """Return the state at the optimum."""
        return self.adjusted.state


@dataclass(frozen=True)
class Say:
    """What a window says of the shared numbers (S,): best values and information beyond what was stated."""

    value: Float
    information: Float


@dataclass(frozen=True)
class Settled:
    """Shared numbers (S,) of the whole run and their covariance (S, S)."""

    value: Float
    covariance: Float


@dataclass(frozen=True)
class Submap:
    """A window at its optimum, reckoned from a frame of its own.

    Attributes
    ----------
    window : Window
    T_pc : (n, 4, 4)
    slip : (n,)
    axis : PipeAxis
    radius_mm : float
    anchor : int
        Frame of the window from which errors are counted.
    some : (k,) int
        Frames of the window whose errors are known; between them they hardly differ.
    joint : (k, 6, k, 6)
        Covariance of their errors since the anchor, the shared numbers as they are.
    response : (k, 6, S)
        Change of their poses since the anchor with the shared numbers.
    radius_variance : float
        Of the radius, the shared numbers as they are.
    radius_response : (S,)
    """

    window: Window
    T_pc: Float
    slip: Float
    axis: PipeAxis
    radius_mm: float
    anchor: int
    some: Int
    joint: Float
    response: Float
    radius_variance: float
    radius_response: Float

    @property
    def covariance(self) -> Float:
        """Return the covariance (k, 6, 6) of each frame's error since the anchor."""
        each = np.arange(len(self.some))
        return np.asarray(self.joint[each, :, each])


def estimated(start: State, measured: Measurements, parameters: MotionParameters) -> Estimate:
    """Adjust with free motion first, learn from it how smooth the motion is, then adjust again.

    Raises
    ------
    UnusableError
        When the motion is not determined.
    """
    with _refusals_named():
        free = adjust(start, measured, parameters, _ROUGHLY).state
        sigma = third_difference_sigma(free, measured.tracks.frames)
        smooth = adjust(free, replace(measured, smooth_sigma=sigma), parameters, _CLOSELY)
        return Estimate(smooth, smooth.equations.factor(), sigma)


def again(
    state: State, measured: Measurements, settled: Settled, smooth_sigma: Float, parameters: MotionParameters
) -> Estimate:
    """Adjust from a window's own optimum with the shared numbers settled.

    Raises
    ------
    UnusableError
        When the motion is not determined.
    """
    scale = np.append(state.globals[:_SCALE], settled.value[0])
    start = replace(state, globals=scale, instrument=settled.value[1:])
    held = replace(measured, smooth_sigma=smooth_sigma, settled=settled.value)
    with _refusals_named():
        found = adjust(start, held, parameters, _CLOSELY)
        return Estimate(found, found.equations.factor(), smooth_sigma)


def shared_numbers(state: State) -> Int:
    """Return the places of encoder scale and instrument in the border."""
    size = state.border_size
    return np.asarray(np.r_[_SCALE, size - len(state.instrument) : size])


def say_of(estimate: Estimate, measured: Measurements) -> Say:
    """Return what a window adjusted on its own says of the shared numbers."""
    state = estimate.state
    which = shared_numbers(state)
    posterior = np.linalg.inv(estimate.factor.border_covariance()[np.ix_(which, which)])
    own = posterior - np.diag(_stated_sigma(measured, state) ** -2)
    value, vector = np.linalg.eigh((own + own.T) / 2)
    return Say(np.append(state.globals[_SCALE], state.instrument), (vector * np.maximum(value, 0)) @ vector.T)


def settle(says: Sequence[Say], shares: Sequence[float], measured: Measurements, state: State) -> Settled:
    """Return the shared numbers that all windows together bear out.

    What texture gets wrong it gets wrong alike in every window: beyond a few windows' worth their agreement
    says no more. Taken for independent, eighty of them moved an instrument by 36 of its σ.

    Parameters
    ----------
    says
        Of all windows.
    shares
        Part of each window that no other one has seen before.
    measured, state
        Of any window: what was stated, and how many numbers there are.
    """
    stated = np.diag(_stated_sigma(measured, state) ** -2)
    mean = np.append(1.0, np.zeros(len(state.instrument)))
    information, right = stated.copy(), np.zeros(len(mean))
    believed = min(1.0, _WINDOWS_WORTH / sum(shares))
    for say, share in zip(says, shares, strict=True):
        information += believed * share * say.information
        right += believed * share * (say.information + stated) @ (say.value - mean)
    covariance = np.asarray(np.linalg.inv(information), float)
    return Settled(mean + covariance @ right, covariance)


def submap_of(estimate: Estimate, window: Window, anchor: int, last: int, windows: int = 1) -> Submap:
    """Return what others need of a window; errors are counted from ``anchor`` up to frame ``last`` of it."""
    state, factor = estimate.state, estimate.factor
    which = shared_numbers(state)
    count = max(_COVARIANCES // windows, _FEWEST_COVARIANCES)
    some = np.unique(np.linspace(anchor, last, min(last - anchor + 1, count)).round().astype(int))
    with threadpool_limits(1):  # as in `_refusals_named`
        border = factor.border_covariance()
        by_shared, border_by_shared = factor.response(which)
        covariance = factor.joint_covariance(some)[:, :6, :, :6]
    shared, T_pc = border[np.ix_(which, which)], state.T_pc[some]
    response = _since_first(by_shared[some, :6], T_pc)
    joint = _relative(covariance, T_pc)
    joint -= np.swapaxes(response[:, None] @ shared @ np.swapaxes(response, 1, 2), 1, 2)
    radius = border_by_shared[0]
    return Submap(
        window, state.T_pc, state.slip, state.axis, float(state.globals[0]), anchor, some, joint,
        response, max(float(border[0, 0] - radius @ shared @ radius), 0.0), radius,
    )  # fmt: skip


def carried(T_pc: Float, anchor_T_pc: Float) -> Float:
    """Return (k, 6, 6) what an error (d, w) of the anchor's pose does to poses (k, 4, 4) fixed to it."""
    out = np.zeros((len(T_pc), 6, 6))
    turn = anchor_T_pc[:3, :3]
    out[:, :3, :3] = np.eye(3)
    out[:, :3, 3:] = -skew(T_pc[:, :3, 3] - anchor_T_pc[:3, 3]) @ turn
    out[:, 3:, 3:] = np.swapaxes(T_pc[:, :3, :3], 1, 2) @ turn
    return out


def _stated_sigma(measured: Measurements, state: State) -> Float:
    return np.append(measured.probe.encoder_scale_sigma, np.ones(len(state.instrument)))


def _since_first(change: Float, T_pc: Float) -> Float:
    """Return changes (k, 6, S) of poses (k, 4, 4) as seen from the first of them."""
    return np.asarray(change - carried(T_pc, T_pc[0]) @ change[0])


def _relative(joint: Float, T_pc: Float) -> Float:
    """Return the covariances (k, 6, k, 6) of poses as seen from the first, of joint ones (k, 6, k, 6)."""
    carry = carried(T_pc, T_pc[0])
    back = np.swapaxes(carry, 1, 2)
    with_first = carry[:, None] @ np.swapaxes(joint[:, :, 0], 1, 2)  # (k, k, first's 6, frame's 6)
    out = np.swapaxes(joint, 1, 2) + carry[:, None] @ joint[0, :, 0] @ back
    out = out - with_first - np.swapaxes(np.swapaxes(with_first, 0, 1), 2, 3)
    return np.swapaxes(out, 1, 2)


@contextmanager
def _refusals_named() -> Iterator[None]:
    """Turn equations that cannot be solved into an error for people."""
    try:
        # More threads gain nothing on blocks this small, and stall when the machine is busy.
        with threadpool_limits(1):
            yield
    except np.linalg.LinAlgError as error:
        raise UnusableError(
            "motion",
            f"the motion is not determined by this recording ({error})",
            hint="record more lit frames or rings, or give an encoder",
        ) from error
