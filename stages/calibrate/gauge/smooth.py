"""The motion is smooth: third differences of the poses are small, and how small is learned from the run."""

from __future__ import annotations

import numpy as np

from pipeline.adjustment.bordered import Rows
from pipeline.adjustment.robust import Cauchy, robust_spreads
from pipeline.adjustment.sums import BLOCK
from pipeline.arrays import Float, Int
from pipeline.geometry.rigid import vector_from_rotation
from stages.calibrate.gauge.state import Unknowns

LOOSE = np.array([0.3, 0.3, 0.3, 0.01, 0.01, 0.01])
_FLOOR = np.array([1e-4] * 3 + [1e-6] * 3)
_SOFT = 5.0


def smooth_rows(state: Unknowns, time_s: Float, sigma: Float) -> Rows:
    """Hold third divided differences of position and turn of neighbouring frames to 0 ± ``sigma`` (6,)."""
    first = np.arange(max(len(time_s) - 3, 0))
    frame = first[:, None] + np.arange(4)
    coefficient = _third_difference(time_s[frame])
    residual = np.einsum("mk,mki->mi", coefficient, _poses(state.T_pc[frame]))
    by_frame = np.zeros((len(first), 6, 4, BLOCK))
    for i in range(6):
        by_frame[:, i, :, i] = coefficient
    every = np.broadcast_to(sigma, residual.shape).ravel()
    none = np.zeros((6 * len(first), state.border_size))
    return Rows(
        np.repeat(frame, 6, 0), by_frame.reshape(-1, 4, BLOCK), none, residual.ravel(), every, Cauchy(_SOFT)
    )


def learned_sigma(T_pc: Float, known: Int) -> Float:
    """Return the robust size (6,) of third differences between frames ``known``, scaled to all frames.

    Third differences of a motion driven by white jerk grow with the 2.5th power of the stride.
    """
    if len(known) < 8:
        return LOOSE
    window = known[np.arange(len(known) - 3)[:, None] + np.arange(4)]
    third = np.einsum("k,nki->ni", np.array([-1.0, 3, -3, 1]), _poses(T_pc[window]))
    stride = float(np.median(np.diff(known)))
    return np.asarray(np.maximum(robust_spreads(third, axis=0) / stride**2.5, _FLOOR))


def _poses(T_pc: Float) -> Float:
    """Return position and turn (M, 4, 6), the turn from the second of four poses (M, 4, 4, 4)."""
    turn = vector_from_rotation(np.swapaxes(T_pc[:, 1:2, :3, :3], -1, -2) @ T_pc[..., :3, :3])
    return np.concatenate([T_pc[..., :3, 3], turn], -1)


def _third_difference(time_s: Float) -> Float:
    """Return coefficients (M, 4) of the third divided difference; those of even spacing are −1, 3, −3, 1."""
    t = 3 * (time_s - time_s[:, :1]) / np.maximum(time_s[:, 3:] - time_s[:, :1], 1e-12)
    gap = t[:, :, None] - t[:, None, :] + np.eye(4)
    return np.asarray(6 / np.prod(gap, -1))
