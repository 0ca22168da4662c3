"""Preintegration: converts an IMU's readings to rotations between nodes and mean forces at them, in C.

C. Forster et al., "On-manifold preintegration for real-time visual-inertial odometry", 2017, § V.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate

import numpy as np

from pipeline.adjustment.robust import robust_spread
from pipeline.arrays import Float, Int
from pipeline.geometry.rigid import rotation_from_vector, vector_from_rotation
from pipeline.instrument.probe import ImuMount
from pipeline.machine.stage import Context
from pipeline.recording.base import Imu
from stages.motion.route.nodes import Inertia, Rest
from stages.motion.route.rotation_graph import STANDARD_GRAVITY

_MEAN_S = 1.0
"""Time around a node over which forces are averaged, s: longer than a wobble of the probe (some Hz), shorter
than the time between nodes. A choice."""
_LONGEST_GAP_S = 0.1
"""Longest gap in the readings over which the rate is interpolated: ten readings of a slow IMU at 100 Hz."""
_STILL_S, _STILL_MM, _EASED_S = 2.0, 0.1, 0.3
"""A probe stands if it moves by less than 0.1 mm in 2 s; 0.3 s at both ends are left out. Not measured."""
_LEAST_BIAS_RAD_S = 2e-6
"""Least 1 σ of a bias at rest: the Earth turns by 7e-5 rad/s, and a probe by some degrees during a run."""
_RESPONSE_ERROR = 0.01
"""1 σ of a gyroscope's scale, and of its sensitivity to rotation about another axis: data sheets of consumer
chips state 1 to 3 % and 1 to 2 %. Both are constant, so that bends that the camera sees determine them."""
_LEAST_FORCE_M_S2 = 0.01
"""Smallest 1 σ of a mean force: a milligravity."""
_TURNING, _APART = 3.0, 0.5
"""A gyroscope is checked if the camera turns by three of its σ or more. The two may then differ by half of
the rotation; a mount that is wrong by 30° makes them differ by as much."""
_NOT_GRAVITY = 0.1
"""Largest relative difference of the usual force from gravity. Consumer accelerometers err by 4 % at most
(data sheets)."""


def inertia_at(
    imu: Imu,
    mount: ImuMount,
    time_s: Float,
    R_pc: Float,
    still: Sequence[tuple[float, float]],
    context: Context,
) -> Inertia | None:
    """Return an IMU's measurements at and between nodes; None, with a warning, if it does not cover the run.

    Parameters
    ----------
    imu, mount
    time_s : (K,)
        Times of the nodes, on the recording's clock, which the IMU is assumed to share; ascending.
    R_pc : (K, 3, 3)
        Camera's rotations at the nodes by vision, to estimate the scatter of forces.
    still
        Times from and to which the probe stood, when the gyroscope shows its bias.
    context
    """
    refusal = _refusal(imu, time_s)
    if refusal:
        context.warn(
            f"the IMU is not used: {refusal}. What to do: check clock (s, as in frames.csv) and units"
        )
        return None
    inner = (imu.time_s > time_s[0]) & (imu.time_s < time_s[-1])
    at = np.unique(np.concatenate([time_s, imu.time_s[inner]]))
    bias_c = _usual_bias(imu, mount, time_s, R_pc)
    turned, node = _rotations(imu, mount, at, bias_c), np.searchsorted(at, time_s)
    back = np.swapaxes(turned[node[1:]], 1, 2)
    R_step = np.swapaxes(turned[node[:-1]], 1, 2) @ turned[node[1:]]
    # The bias acts in C at each moment, and the rest of the step rotates it further.
    passed = np.concatenate([np.zeros((1, 3, 3)), np.cumsum(turned[1:] * np.diff(at)[:, None, None], 0)])
    by_bias = back @ (passed[node[1:]] - passed[node[:-1]])
    step_s = np.diff(time_s)
    force_c = _mean_forces(imu, mount, at, turned, node)
    shown = np.einsum("kij,kj->ki", R_pc, force_c)
    # Second differences remove gravity, since vision's rotation is reliable only over short times: their σ is
    # √6.
    scatter = robust_spread(np.diff(shown, 2, axis=0).ravel()) / np.sqrt(6) if len(shown) > 4 else 0.0
    noise = mount.accelerometer_noise_density / np.sqrt(_MEAN_S)
    return Inertia(
        R_step, by_bias, bias_c, step_s, mount.gyroscope_noise_density**2 * step_s,
        mount.gyroscope_random_walk**2 * step_s, force_c,
        float(max(scatter, noise, _LEAST_FORCE_M_S2)), mount.accelerometer_bias, _RESPONSE_ERROR,
        _rests(imu, mount, time_s, still),
    )  # fmt: skip


def contradicts(inertia: Inertia, R_pc: Float) -> bool:
    """Return whether gyroscope and camera rotate differently beyond a bias: another mount, unit or clock.

    If the camera rotates by no more than the gyroscope's error, the test is impossible, and the IMU is used.
    """
    step_s = inertia.step_s[:, None]
    seen = vector_from_rotation(np.swapaxes(R_pc[:-1], 1, 2) @ R_pc[1:]) / step_s
    by_gyroscope = vector_from_rotation(inertia.R_step) / step_s
    noise = np.sqrt(np.median(inertia.step_variance / inertia.step_s**2) + inertia.walk_variance.sum())
    apart, turning = (robust_spread((x - np.median(x, 0)).ravel()) for x in (seen - by_gyroscope, seen))
    return bool(turning > _TURNING * noise and apart > _APART * turning)


def still_spans(time_s: Float, distance_mm: Float) -> list[tuple[float, float]]:
    """Return the times (from, to) through which a probe stood, from its distances (N,) at times (N,)."""
    later = np.searchsorted(time_s, time_s + _STILL_S)
    inside = np.flatnonzero(later < len(time_s))
    still = inside[np.abs(distance_mm[later[inside]] - distance_mm[inside]) < _STILL_MM]
    out: list[tuple[float, float]] = []
    for k in still.tolist():
        begin, end = float(time_s[k]), float(time_s[later[k]])
        if out and begin <= out[-1][1]:
            out[-1] = (out[-1][0], end)
        else:
            out.append((begin, end))
    return out


def _rests(
    imu: Imu, mount: ImuMount, time_s: Float, still: Sequence[tuple[float, float]]
) -> tuple[Rest, ...]:
    out = []
    for begin, end in still:
        during = (imu.time_s >= begin + _EASED_S) & (imu.time_s <= end - _EASED_S)
        if during.sum() < 2:
            continue
        node = int(np.argmin(np.abs(time_s - (begin + end) / 2)))
        sigma = mount.gyroscope_noise_density / np.sqrt(end - begin - 2 * _EASED_S)
        rate_c = imu.rate_rad_s[during].mean(0) @ mount.R_ci.T
        out.append(Rest(node, rate_c, float(np.hypot(sigma, _LEAST_BIAS_RAD_S))))
    return tuple(out)


def _refusal(imu: Imu, time_s: Float) -> str:
    """Return why an IMU cannot be used, empty where it can."""
    if imu.time_s[0] > time_s[0] + _LONGEST_GAP_S or imu.time_s[-1] < time_s[-1] - _LONGEST_GAP_S:
        return (
            f"its readings cover {imu.time_s[0]:.2f} to {imu.time_s[-1]:.2f} s, the frames "
            f"{time_s[0]:.2f} to {time_s[-1]:.2f} s"
        )
    inside = (imu.time_s >= time_s[0]) & (imu.time_s <= time_s[-1])
    gap = float(np.diff(imu.time_s[inside]).max(initial=0.0))
    if gap > _LONGEST_GAP_S:
        return f"its readings pause for {gap:.2f} s"
    usual = float(np.median(np.linalg.norm(imu.force_m_s2, axis=1)))
    if abs(usual - STANDARD_GRAVITY) > _NOT_GRAVITY * STANDARD_GRAVITY:
        return f"its accelerometer usually shows {usual:.2f} m/s², which is not gravity"
    return ""


def _usual_bias(imu: Imu, mount: ImuMount, time_s: Float, R_pc: Float) -> Float:
    """Return the usual excess (3,) of the gyroscope's rate over the camera's, rad/s in C."""
    passed = np.concatenate(
        [np.zeros((1, 3)), np.cumsum(imu.rate_rad_s[1:] * np.diff(imu.time_s)[:, None], 0)]
    )
    turned = np.diff(np.stack([np.interp(time_s, imu.time_s, passed[:, i]) for i in range(3)], -1), axis=0)
    seen = vector_from_rotation(np.swapaxes(R_pc[:-1], 1, 2) @ R_pc[1:])
    return np.asarray(np.median((turned @ mount.R_ci.T - seen) / np.diff(time_s)[:, None], axis=0))


def _rotations(imu: Imu, mount: ImuMount, at: Float, bias_c: Float) -> Float:
    """Return the rotations (n, 3, 3) in C from the first of ascending times to each, rates linear between."""
    rate = np.stack([np.interp(at, imu.time_s, imu.rate_rad_s[:, i]) for i in range(3)], -1) @ mount.R_ci.T
    rate = rate - bias_c
    small = rotation_from_vector((rate[1:] + rate[:-1]) / 2 * np.diff(at)[:, None])
    return np.array(list(accumulate(small, np.matmul, initial=np.eye(3))))


def _mean_forces(imu: Imu, mount: ImuMount, at: Float, turned: Float, node: Int) -> Float:
    """Return the mean forces (K, 3) around nodes, in C at the node: rotated back by the gyroscope.

    ``turned`` (n, 3, 3) are the rotations at times ``at`` (n,), ``node`` (K,) the nodes' places among these.
    """
    force = np.stack([np.interp(at, imu.time_s, imu.force_m_s2[:, i]) for i in range(3)], -1) @ mount.R_ci.T
    still = np.einsum("nij,nj->ni", turned, force)
    total = np.concatenate([np.zeros((1, 3)), np.cumsum(still, 0)])
    first = np.searchsorted(at, at[node] - _MEAN_S / 2)
    last = np.searchsorted(at, at[node] + _MEAN_S / 2, "right")
    mean = (total[last] - total[first]) / (last - first)[:, None]
    return np.asarray(np.einsum("kij,ki->kj", turned[node], mean))
