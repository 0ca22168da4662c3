"""Long runs as chains of poses without pictures.

A pipe, a camera with the usual errors of vision, and an IMU.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from pipeline.arrays import Float
from pipeline.artefacts.measured import Trajectory
from pipeline.geometry.axis import PipeAxis, axis_through, frames_at
from pipeline.geometry.rigid import from_parts, rotation_from_vector, vector_from_rotation
from pipeline.instrument.probe import ImuMount
from pipeline.recording.base import Imu
from stages.motion.route.rotation_graph import STRAIGHT_MM, STRAIGHTNESS_RAD

STEP_MM, SPEED_MM_S, RADIUS_MM = 50.0, 150.0, 50.0
WALK = 1e-4 / np.sqrt(1000.0)
"""1 σ of the heading estimated by vision, rad/√mm: 0.1 mrad after a metre, 1 mrad after a hundred."""
SCALE = 1e-3
"""1 σ of the scale of distance: an encoder wheel worn by a thousandth."""
RESPONSE = 0.01
"""1 σ of a gyroscope's scale errors and of its cross-axis sensitivity, as of consumer chips."""


@dataclass(frozen=True)
class Chain:
    """A run as vision estimates it, and its true poses (N, 4, 4), which have the same first pose."""

    seen: Trajectory
    T_pc: Float
    axis: PipeAxis

    @property
    def turn_variance(self) -> Float:
        """Return the variance (N, 3) of the rotation that the camera measured up to each frame."""
        return np.diagonal(self.seen.covariance, axis1=1, axis2=2)[:, 3:]


def curved(*pieces: tuple[float, float, float]) -> PipeAxis:
    """Return an axis of pieces: (length mm, angle rad, azimuth of the bend)."""
    tangent, across = [], np.eye(3)
    for length, angle, toward in pieces:
        count = max(round(length / STEP_MM), 1)
        turn = angle / count * np.array([-np.sin(toward), np.cos(toward), 0.0])
        for _ in range(count):
            tangent.append(across[:, 2] * length / count)
            across = across @ rotation_from_vector(turn)
    origin = np.concatenate([np.zeros((1, 3)), np.cumsum(tangent, 0)])
    return axis_through(origin, np.array([1.0, 0.0, 0.0]), 0.0)


def bowed(axis: PipeAxis, seed: int) -> PipeAxis:
    """Return the axis with tubes that smoothly deviate from its lines, as the prior of the route assumes."""
    step_mm = float(np.diff(axis.distance_mm).mean())
    smooth = STRAIGHT_MM / (2 * np.sqrt(np.pi) * step_mm)  # has the same integral as constant leans
    white = np.random.default_rng(seed).standard_normal((len(axis.distance_mm) - 1, 2))
    lean = gaussian_filter1d(white, smooth, axis=0, mode="wrap") * np.sqrt(2 * np.sqrt(np.pi) * smooth)
    beside = axis.R_pa[:-1, :, :2] @ (STRAIGHTNESS_RAD * lean)[..., None]
    way = np.diff(axis.origin_p, axis=0) + step_mm * beside[..., 0]
    origin = np.concatenate([np.zeros((1, 3)), np.cumsum(way, 0)])
    return axis_through(origin, np.array([1.0, 0.0, 0.0]), 0.0)


def chain(
    axis: PipeAxis, drift: tuple[float, float] = (0.0, 0.0), seed: int = 0, rest_s: float = 0.0
) -> Chain:
    """Return a run along an axis, its camera's heading drifting by ``drift``, rad/mm about x and y of C.

    The probe stands still for ``rest_s`` before its start and after its end.
    """
    random = np.random.default_rng(seed)
    stops = round(rest_s * SPEED_MM_S / STEP_MM)
    s = np.concatenate([np.zeros(stops), axis.distance_mm, np.full(stops, axis.distance_mm[-1])])
    time_s = np.arange(len(s)) * STEP_MM / SPEED_MM_S
    origin, section = frames_at(axis, s)
    wobble = np.stack([0.01 * np.sin(s / 400), 0.008 * np.sin(s / 310), 0.3 * np.sin(s / 9000)], -1)
    R_true = section @ rotation_from_vector(wobble - wobble[0])
    step = np.swapaxes(R_true[:-1], 1, 2) @ R_true[1:]
    ds = np.diff(s)[:, None]
    error = ds * np.array([*drift, 0.0]) + WALK * np.sqrt(ds) * random.standard_normal((len(ds), 3))
    R_seen = [R_true[0]]
    for turn, off in zip(step, rotation_from_vector(error), strict=True):
        R_seen.append(R_seen[-1] @ turn @ off)
    R = np.array(R_seen)
    way = np.einsum("kij,kj->ki", _middle(R) @ np.swapaxes(_middle(R_true), 1, 2), np.diff(origin, axis=0))
    place = np.concatenate([np.zeros((1, 3)), np.cumsum(way, 0)]) * (1 + SCALE * random.standard_normal())
    covariance = np.zeros((len(s), 6, 6))
    covariance[:, [3, 4, 5], [3, 4, 5]] = (WALK**2 * (s - s[0]))[:, None]
    covariance[:, :3, :3] = SCALE**2 * place[:, :, None] * place[:, None, :]
    seen_axis = axis_through(place[np.append(True, np.diff(s) > 0)], np.array([1.0, 0.0, 0.0]), 0.0)
    seen = Trajectory(
        np.arange(len(s)), time_s, from_parts(R, place), covariance, seen_axis, RADIUS_MM,
        1.0, 0.0, 0.0, (), distance_sigma_mm=SCALE * float(s[-1]),
    )  # fmt: skip
    return Chain(seen, from_parts(R_true, origin), axis)


def errors_in_sigma(found: Trajectory, run: Chain, at: Sequence[int]) -> Float:
    """Return the errors (k, 6) of position in P and rotation in C of some frames, over their stated σ."""
    way = found.T_pc[at, :3, 3] - run.T_pc[at, :3, 3]
    turn = vector_from_rotation(np.swapaxes(run.T_pc[at, :3, :3], 1, 2) @ found.T_pc[at, :3, :3])
    sigma = np.sqrt(np.diagonal(found.covariance[at], axis1=1, axis2=2))
    return np.concatenate([way, turn], 1) / sigma


def _middle(R: Float) -> Float:
    """Return the rotations (N - 1, 3, 3) halfway between consecutive ones of (N, 3, 3)."""
    return R[:-1] @ rotation_from_vector(vector_from_rotation(np.swapaxes(R[:-1], 1, 2) @ R[1:]) / 2)


def drawn_imu(run: Chain, mount: ImuMount, up_p: Float, seed: int = 0, rate_hz: float = 100.0) -> Imu:
    """Return the readings of an IMU on the true run, with errors drawn from its stated uncertainties."""
    random, time_s = np.random.default_rng(seed), run.seen.time_s
    turn = vector_from_rotation(np.swapaxes(run.T_pc[:-1, :3, :3], 1, 2) @ run.T_pc[1:, :3, :3])
    rate = turn / np.diff(time_s)[:, None]
    at = np.arange(time_s[0], time_s[-1] + 1 / rate_hz, 1 / rate_hz)
    # A reading is the mean over its interval, like the output of a chip's filter.
    turned = np.concatenate([np.zeros((1, 3)), np.cumsum(turn, 0)])
    edges = np.append(at - 0.5 / rate_hz, at[-1] + 0.5 / rate_hz)
    passed = np.stack([np.interp(edges, time_s, turned[:, i]) for i in range(3)], -1)
    place = np.clip(np.searchsorted(time_s, at, "right") - 1, 0, len(rate) - 1)
    R_pc = run.T_pc[place, :3, :3] @ rotation_from_vector(rate[place] * (at - time_s[place])[:, None])
    n = (len(at), 3)
    walk = np.cumsum(random.standard_normal(n), 0) * mount.gyroscope_random_walk / np.sqrt(rate_hz)
    bias = 0.02 * random.standard_normal(3) + walk
    response = np.eye(3) + RESPONSE * random.standard_normal((3, 3))
    gyro = np.diff(passed, axis=0) * rate_hz @ mount.R_ci @ response + bias
    gyro += mount.gyroscope_noise_density * np.sqrt(rate_hz) * random.standard_normal(n)
    force = np.einsum("nij,i->nj", R_pc, 9.81 * up_p) @ mount.R_ci
    force += mount.accelerometer_bias * random.standard_normal(3)
    force += mount.accelerometer_noise_density * np.sqrt(rate_hz) * random.standard_normal(n)
    return Imu(at, gyro, force)
